"""The published program of GMapping: a particle filter with a hill climb per particle.

[Grisetti07] G. Grisetti, C. Stachniss, W. Burgard, "Improved Techniques for Grid Mapping with
Rao-Blackwellized Particle Filters", IEEE Transactions on Robotics 23(1), 2007, as in gmapping of
OpenSLAM:

1. Motion: every particle moves by the odometry with its own noise, the output pose without noise.
2. At a keyframe every particle climbs to the peak of its score in its own map; its weight is
   multiplied by the likelihood of the scan.
3. The particles are resampled if n_eff = 1 / sum w^2 is below a share of their number.
4. The end points are inserted into every particle's map.
5. The best particle, of greatest lifetime weight, is the output: its pose and map are the result.
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
    """gmapping; `quality` is the share of the particles with a successful last climb."""

    Params: ClassVar[type[Params]] = OriginalParams

    def __init__(self, params: OriginalParams) -> None:
        self.params = params
        self.pose = IDENTITY
        self.quality = 1.0
        self._rng = np.random.default_rng(params.seed)
        self._motion = Motion(params)
        self._renderer = Renderer(params.resolution, params.occupied, params.max_cells)
        self._distance = self._rotation = math.inf
        names = ("scans", "inserted", "rejected", "resampled", "switched", "collapsed", "failed")
        self._counts = dict.fromkeys(names, 0)
        self._populate(params.n_particles)

    def update(self, scan: Scan) -> Pose2:
        """Process a scan; returns the output particle's pose, between keyframes by odometry."""
        p = self.params
        step = self._motion.step(scan)
        if self._counts["scans"] > 0:
            self._move(step or IDENTITY)  # 1
        elif step is None:
            self._populate(1)  # without motion noise all particles would be equal
        points, radius = end_points(scan, p.beam_offset, p.max_range)
        if len(points) == 0:
            self._counts["rejected"] += 1
        elif self._due(step) and self.tiles.admits(self.pose, radius):
            self._filter(points, radius)
            rays, _ = end_points(scan, 0.0, p.max_range)
            self._renderer.add_keyframe(np.vstack([rays, scan.laser.mount[:2]]), self.pose)
        self._counts["scans"] += 1
        return self.pose

    def map(self) -> OccupancyGrid:
        """The output particle's map, drawn from its history of keyframes."""
        return self._renderer.snapshot(self.particles.history(self.particles.output))()

    def report(self) -> dict[str, Any]:
        """Counts of scans, and the size of the particles' maps."""
        return self._counts | self._motion.used | self.tiles.counts

    def _move(self, motion: Pose2) -> None:
        draws = self._rng.standard_normal((len(self.particles), 3))
        self.particles.move(np.array(motion) + draws * self._motion.noise(motion))
        self._distance += math.hypot(motion.x, motion.y)
        self._rotation += abs(motion.theta)
        self.pose = self.pose @ motion

    def _due(self, step: Pose2 | None) -> bool:
        """Whether the odometry has moved enough; without odometry every scan is a keyframe."""
        moved = self._distance >= self.params.linear_update
        return moved or self._rotation >= self.params.angular_update or step is None

    def _filter(self, points: Floats, radius: float) -> None:
        if self._counts["inserted"] == 0:
            self.particles.poses[:] = self.pose
        else:
            log_w, failed = self.tiles.match(points, self.particles.poses)  # 2
            self._counts["failed"] += failed
            self.quality = 1.0 - failed / len(log_w)
            self.particles.weigh(log_w, self.params.gain * len(log_w))
            if self.particles.n_eff < self.params.resample_threshold * len(log_w):
                self._inherit(self.particles.draw_ancestors(self._rng.random()), "resampled")  # 3
            best = self.particles.best()  # 5
            self._counts["switched"] += best != self.particles.output
            self.particles.output = best
        self._insert(points, radius)  # 4
        self.particles.append_to_history()
        self.pose = self.particles.output_pose
        self._distance = self._rotation = 0.0

    def _insert(self, points: Floats, radius: float) -> None:
        self.tiles.cover(self.particles.poses, radius)
        if not self.tiles.insert(points, self.particles.poses):  # all copy the output particle
            self._inherit(np.full(len(self.particles), self.particles.output), "collapsed")
        self._counts["inserted"] += 1

    def _inherit(self, ancestors: NDArray[np.int64], count: str) -> None:
        self.particles.inherit(ancestors)
        self.tiles.inherit(ancestors)
        self._counts[count] += 1

    def _populate(self, n_particles: int) -> None:
        self.particles = Particles(n_particles)
        self.tiles = HitMap(self.params, n_particles)
