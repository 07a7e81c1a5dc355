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
from gmapping.original.motion import Motion
from gmapping.original.params import OriginalParams
from gmapping.original.scan import end_points
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
        self._renderer = Renderer(params.resolution, params.occupied, params.max_cells)
        self._way = self._turn = math.inf
        names = ("scans", "inserted", "rejected", "resampled", "switched", "collapsed", "failed")
        self._counts = dict.fromkeys(names, 0)
        self._populate(params.n_particles)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; return the best particle's pose, between keyframes by odometry."""
        before, p = self.pose, self.params
        step = self._motion.step(scan)
        if self._counts["scans"] > 0:
            self._move(step or IDENTITY)  # 1
        elif step is None:
            self._populate(1)  # without odometry there is no noise
        points, far = end_points(scan, p.beam_offset, p.max_range)
        if len(points) == 0:
            self._counts["rejected"] += 1
        elif self._due(step) and self.tiles.admits(self.pose, far):
            self._filter(points, far)
            rays, _ = end_points(scan, 0.0, p.max_range)
            self._renderer.keep(np.vstack([rays, scan.laser.mount[:2]]), self.pose)
        self._counts["scans"] += 1
        self._motion.learn(before.between(self.pose))
        return self.pose

    def map(self) -> OccupancyGrid:
        """The best particle's map, drawn from its history of keyframes."""
        return self._renderer.snapshot(self.particles.history(self.particles.best))()

    def report(self) -> dict[str, Any]:
        """Counts, and what the particles' maps take."""
        return self._counts | self._motion.used | self.tiles.counts

    def _move(self, way: Pose2) -> None:
        draws = self._rng.standard_normal((len(self.particles), 3))
        self.particles.move(np.array(way) + draws * self._motion.noise(way))
        self._way += math.hypot(way.x, way.y)
        self._turn += abs(way.theta)
        self.pose = self.pose @ way

    def _due(self, step: Pose2 | None) -> bool:
        """Whether the odometry has gone far enough; without odometry every scan is a keyframe."""
        far = self._way >= self.params.linear_update
        return far or self._turn >= self.params.angular_update or step is None

    def _filter(self, points: Floats, far: float) -> None:
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
        self._insert(points, far)  # 4
        self.particles.remember()
        self.pose = self.particles.best_pose
        self._way = self._turn = 0.0

    def _insert(self, points: Floats, far: float) -> None:
        self.tiles.cover(self.particles.poses, far)
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
