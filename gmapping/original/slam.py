"""The published program of GMapping: a particle filter with a hill climb per particle.

[Grisetti07] G. Grisetti, C. Stachniss, W. Burgard, "Improved Techniques for Grid Mapping with
Rao-Blackwellized Particle Filters", IEEE Transactions on Robotics 23(1), 2007, as gmapping of
OpenSLAM has it:

1. Motion: every particle moves by the odometry, with noise of its own; that is the pose published.
2. At a keyframe every particle climbs to the peak of its score in its own map; its weight grows by
   the scan's likelihood there.
3. The number of effective particles n_eff = 1 / sum w^2 follows from the weights; below a share of
   the particles they are resampled.
4. The end points are written into every particle's map.
5. The particle of greatest weight over its life is the one that is reported.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gmapping.original.map import HitMap
from gmapping.original.motion import Motion, Step
from gmapping.original.params import OriginalParams
from gmapping.original.scan import EndPoints
from gmapping.particles import Particles
from gmapping.render import Renderer
from slams.params import Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan


class Original:
    """gmapping; `quality` is the share of the particles whose last climb has not failed."""

    Params: ClassVar[type[Params]] = OriginalParams

    def __init__(self, params: OriginalParams) -> None:
        self.params = params
        self.pose = IDENTITY
        self.quality = 1.0
        self._rng = np.random.default_rng(params.seed)
        self._motion = Motion(params)
        self._points = EndPoints(params, params.beam_offset)
        self._renderer = Renderer(params.resolution, params.occupied)
        self._rays = EndPoints(params, 0.0)
        self._way = self._turn = math.inf
        names = ("scans", "inserted", "rejected", "resampled", "switched", "collapsed", "failed")
        self._counts = dict.fromkeys(names, 0)
        self._populate(params.n_particles)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; return the best particle's pose, between keyframes by odometry."""
        before = self.pose
        step = self._motion.step(scan)
        if self._counts["scans"] > 0:
            self._move(step)  # 1
        elif not step.measured:
            self._populate(1)  # without odometry there is no noise
        points = self._points(scan)
        if len(points) == 0:
            self._counts["rejected"] += 1
        elif self._due(step) and self.tiles.admits(self.pose, _farthest(points)):
            self._filter(points)
            scan_and_laser = np.vstack([self._rays(scan), scan.laser.mount[:2]])
            self._renderer.keep(scan_and_laser, self.pose)
        self._counts["scans"] += 1
        self._motion.learn(before.between(self.pose))
        return self.pose

    def map(self) -> OccupancyGrid:
        """The best particle's map, drawn from its history of keyframes."""
        return self._renderer.snapshot(self.trajectory())()

    def trajectory(self) -> Floats:
        """The best particle's poses (k, 3) x, y [m], theta [rad] at the keyframes."""
        return self.particles.history(self.particles.best)

    def report(self) -> dict[str, Any]:
        """Counts, and what the particles' maps take."""
        return self._counts | self._motion.used | self.tiles.counts

    def _move(self, step: Step) -> None:
        way = step.pose if step.measured else IDENTITY
        draws = self._rng.standard_normal((len(self.particles), 3))
        self.particles.move(np.array(way) + draws * self._motion.noise(way))
        self._way += math.hypot(way.x, way.y)
        self._turn += abs(way.theta)
        self.pose = self.pose @ way

    def _due(self, step: Step) -> bool:
        """Whether the odometry has gone far enough; without odometry every scan is a keyframe."""
        far = self._way >= self.params.linear_update
        return far or self._turn >= self.params.angular_update or not step.measured

    def _filter(self, points: Floats) -> None:
        if self._counts["inserted"] == 0:
            self.particles.poses[:] = self.pose
        else:
            log_w, failed = self.tiles.match(points, self.particles.poses)  # 2
            self._counts["failed"] += failed
            self.quality = 1.0 - failed / len(log_w)
            self.particles.weigh(log_w, self.params.gain * len(log_w))
            if self.particles.n_eff < self.params.resample_threshold * len(log_w):
                self._follow(self.particles.draw_ancestors(self._rng.random()), "resampled")  # 3
            leader = self.particles.leader()  # 5
            self._counts["switched"] += leader != self.particles.best
            self.particles.best = leader
        self._insert(points)  # 4
        self.particles.remember()
        self.pose = self.particles.best_pose
        self._way = self._turn = 0.0

    def _insert(self, points: Floats) -> None:
        self.tiles.cover(*self.particles.extent(_farthest(points)))
        if not self.tiles.insert(points, self.particles.poses):  # all go on from the best one
            self._follow(np.full(len(self.particles), self.particles.best), "collapsed")
        self._counts["inserted"] += 1

    def _follow(self, ancestors: NDArray[np.int64], why: str) -> None:
        self.particles.follow(ancestors)
        self.tiles.inherit(ancestors)
        self._counts[why] += 1

    def _populate(self, n_particles: int) -> None:
        self.particles = Particles(n_particles)
        self.tiles = HitMap(self.params, n_particles)


def _farthest(points: Floats) -> float:
    """The greatest distance [m] of points (n, 2 or more) from the base."""
    return float(np.hypot(points[:, 0], points[:, 1]).max())
