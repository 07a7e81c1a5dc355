"""The matcher of the preset `paper`: end points, climbed; the proposal is fitted to samples."""

from __future__ import annotations

import math

import numpy as np

from gmapping import climb_kernels as kernels
from gmapping.climb_kernels import Field
from gmapping.hit_kernels import HIT_DEPTH, insert_ends
from gmapping.map import TileMap
from gmapping.match_kernels import Posterior
from gmapping.params import GMappingParams
from gmapping.particles import Proposals
from gmapping.render import blank
from gmapping.render_kernels import Counts
from gmapping.scan import View
from slams.frontend.motion_filter import Prediction
from slams.refine.lines import Match
from slams.types import Floats, Pose2, wrap_angle

CLIMB_STEP = 0.01, 0.005  # m, rad: the first, below the deviation of most peaks
CLIMB_HALVINGS = 3  # of it: the last step is 1.25 mm
UNSEEN = blank((0, 0), (0, 0), 1.0)  # nothing is known to be free


class EndPointMatcher:
    """Distances of a scan's end points from the mean hits in the cells."""

    def __init__(self, params: GMappingParams) -> None:
        p = self._params = params
        self._cell = params.resolution / math.sqrt(12.0)  # m, how far a mean hit is off
        self.tiles = TileMap(p.n_particles, 1, p.resolution, p.max_tiles, p.max_cells, HIT_DEPTH)

    def match(self, view: View, owner: int, prior: Prediction, start: Pose2) -> Match:
        """The mean of the samples around the peak near `start`, in the map of one particle."""
        poses, means, owners = np.array([start]), np.array([prior.pose]), np.array([owner])
        of = Posterior(self.tiles.tiles, owners, view.pieces, means, prior.information)
        covariance, _ = self._gaussians(view, of, poses)
        if prior.information.any():  # what the scan alone says
            alone = of._replace(means=poses, information=np.zeros((3, 3)))
            covariance, _ = self._gaussians(view, alone, poses.copy())
        x, y, theta = poses[0].tolist()
        share = self.evaluate(view, owner, poses[0], UNSEEN)[0] / view.beams
        pose, seen = Pose2(x, y, float(wrap_angle(theta))), np.linalg.inv(covariance[0])
        return Match(pose, share, 1.0 / self._field(view).worth, seen)

    def propose(
        self, view: View, means: Floats, information: Floats, places: list[Pose2], seen: Counts
    ) -> Proposals:
        """[Grisetti07] improved proposal, mean, covariance and weight of samples at the peak."""
        poses, n = means.copy(), len(means)
        of = Posterior(self.tiles.tiles, np.arange(n), view.pieces, means, information)
        covariances, log_w = self._gaussians(view, of, poses)
        factors = np.linalg.cholesky(np.linalg.inv(covariances))
        return Proposals(poses, factors, log_w, np.zeros(n, np.bool_))

    def insert(self, view: View, poses: Floats, way: float) -> bool:
        """Write the scan into the particles' maps, at these poses; False if there was no room."""
        return insert_ends(self.tiles.tiles, poses, view.pieces, self._params.cap) == 0

    def evaluate(self, view: View, owner: int, pose: Floats, seen: Counts) -> tuple[float, float]:
        """Beams that are inliers in one map, and that end where `seen` is free; pose (3,)."""
        return kernels.evaluate(self.tiles.tiles, owner, view.pieces, pose, seen)

    def _gaussians(self, view: View, of: Posterior, poses: Floats) -> tuple[Floats, Floats]:
        """Poses (k, 3) become the samples' means; covariances (k, 3, 3), log eta (k,)."""
        field = self._field(view)
        covariances, values = np.zeros((len(poses), 3, 3)), np.zeros(len(poses))
        kernels.climb(of, field, poses, values)
        kernels.sample(of, field, poses, covariances, values)
        return covariances, values

    def _field(self, view: View) -> Field:
        p, deviation = self._params, math.hypot(view.noise, self._cell)
        worth = min(1.0, p.independent / view.beams) / deviation**2
        soft = max(p.band * p.resolution, 3.0 * view.noise)
        return Field(worth, soft, *CLIMB_STEP, CLIMB_HALVINGS)
