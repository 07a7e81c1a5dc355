"""GMapping: Rao-Blackwellized particle filter over robot paths, each with a map of its own.

[Grisetti07] G. Grisetti, C. Stachniss, W. Burgard, "Improved Techniques for Grid Mapping with
Rao-Blackwellized Particle Filters", IEEE Transactions on Robotics 23(1), 2007.

1. Motion: odometry, a gyro or the last motion predicts the step since the last scan.
2. Tracking (ours): every scan is matched to the best particle's map.
3. At a key scan every particle is matched to its own map and drawn from a Gaussian around the
   peak (the improved proposal); its weight grows by the scan's likelihood.
4. The number of effective particles n_eff = 1 / sum w^2 follows from the weights.
5. Below a share of the particles they are resampled (adaptive resampling): maps are shared, not
   copied.
6. The scan is written into every particle's map.
7. The particle of greatest weight over its life is the one that is reported.

The published program, `gmapping@original`, stands in `original`.
"""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar

import numpy as np

from gmapping.map import TileMap
from gmapping.motion import Motion, Step
from gmapping.params import GMappingParams
from gmapping.particles import Particles
from gmapping.render import Renderer
from gmapping.scan import EndPoints
from gmapping.surface import SurfaceMatcher
from slams.params import Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan


class GMapping:
    """The particle filter; parameters say what predicts motion.

    `pose` is the last pose, `covariance` (3, 3) [m, rad] its uncertainty, `quality` the share of
    the last scan that lies where the map has surfaces; `frozen`: nothing enters the map;
    `particles` and `tiles` the filter's state.
    """

    Params: ClassVar[type[Params]] = GMappingParams

    def __init__(self, params: GMappingParams) -> None:
        self.params = params
        self.pose = IDENTITY
        self.frozen = False
        self._rng = np.random.default_rng(params.seed)
        self._motion = Motion(params)
        self._renderer = Renderer(params.resolution, params.occupied)
        self._rays = EndPoints(params)
        self._counts = {"scans": 0, "inserted": 0, "rejected": 0, "resampled": 0, "switched": 0}
        self._counts |= {"collapsed": 0}
        self.particles = Particles(params.n_particles)
        layers = SurfaceMatcher.layers
        tiles = params.max_tiles, params.max_cells
        self.tiles = TileMap(params.n_particles, layers, params.resolution, *tiles)
        self._matcher = SurfaceMatcher(params, self._motion, self.particles, self.tiles)

    def update(self, scan: Scan) -> Pose2:
        """Track a scan; at key scans run the filter. Returns the best particle's pose."""
        before = self.pose
        step = self._motion.step(scan)  # 1
        if self._counts["scans"] == 0:
            points = self._matcher.points(scan, step)
        else:
            self.pose, points, step = self._matcher.track(before, step, scan, self._rng)  # 2
        if len(points) == 0:
            self._counts["rejected"] += 1
        elif self._enters(step, points):
            self._filter(points)
            self._keep(scan, step)
        self._counts["scans"] += 1
        self._motion.learn(before.between(self.pose))
        return self.pose

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Take a scan whose pose is known, at rest; it enters the maps unless `frozen`."""
        step = self._motion.rest(scan)
        points = self._matcher.points(scan, step)
        self.pose = pose
        self._share_one_map()
        self.particles.poses[:] = pose
        self._matcher.place(pose)
        if len(points) > 0 and not self.frozen and self.tiles.admits(pose, points):
            self._insert(points)
            self._keep(scan, step)
        self._counts["scans"] += 1

    def map(self) -> OccupancyGrid:
        """The best particle's map, drawn from its history of key scans."""
        return self._renderer.grid(self.trajectory())

    def trajectory(self) -> Floats:
        """The best particle's poses (k, 3) x, y [m], theta [rad] at the key scans."""
        return self.particles.history(self.particles.best)

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last pose [m, rad], in the map frame."""
        return self._matcher.covariance

    @property
    def quality(self) -> float:
        """How well the last scan fitted, 0 to 1."""
        return self._matcher.quality

    def report(self) -> dict[str, Any]:
        """Counts, and what the particles' maps take."""
        tiles = {"tiles": self.tiles.used, "tiles_peak": self.tiles.peak}
        shared = {"tiles_shared": round(self.tiles.shared, 3), "particles": len(self.particles)}
        counts = self._counts | self._matcher.counts | self._motion.used
        return counts | tiles | shared | self.tiles.extent.counts

    def _filter(self, points: Floats) -> None:
        if self._counts["inserted"] == 0:
            self.particles.poses[:] = self.pose
        else:
            log_w = self._matcher.propose(self.pose, points, self._rng)  # 3
            self.particles.weigh(log_w, self._matcher.temper)  # 4
            if self.particles.n_eff < self.params.resample_threshold * len(self.particles):
                self._resample()  # 5
            self._counts["switched"] += self.particles.elect(self.params.switch_margin)  # 7
        self._insert(points)  # 6
        self.pose = self.particles.best_pose
        self._matcher.start_way(self.pose)

    def _resample(self) -> None:
        ancestors = self.particles.draw_ancestors(self._rng.random())
        self.particles.follow(ancestors)
        self.tiles.inherit(ancestors)
        self._counts["resampled"] += 1

    def _insert(self, points: Floats) -> None:
        self.tiles.cover(*self.particles.extent(points))
        if not self._matcher.insert(points, self.particles.poses):
            self._share_one_map()  # out of tiles
            self._counts["collapsed"] += 1
        self._counts["inserted"] += 1
        self.particles.remember()

    def _enters(self, step: Step, points: Floats) -> bool:
        """Whether the scan is a key scan that the map has room for."""
        due = self._matcher.due(self.pose, step)
        return due and not self.frozen and self.tiles.admits(self.pose, points)

    def _keep(self, scan: Scan, step: Step) -> None:
        """Remember a key scan, to draw the map from."""
        self._renderer.keep(partial(self._rays.ray, scan, step))

    def _share_one_map(self) -> None:
        """All particles go on from the best one, with one map between them."""
        ancestors = np.full(len(self.particles), self.particles.best)
        self.particles.follow(ancestors)
        self.tiles.inherit(ancestors)
