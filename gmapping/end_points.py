"""The matcher of the preset `paper`: hill climb of end points; a Gaussian fitted to samples."""

from __future__ import annotations

import math

import numpy as np

from gmapping import climb_kernels as kernels
from gmapping.climb_kernels import HitModel
from gmapping.hit_kernels import N_HIT_VALUES, insert_ends
from gmapping.map import TileMap
from gmapping.match_kernels import Posterior
from gmapping.params import GMappingParams
from gmapping.particles import Proposals
from gmapping.render import empty_counts
from gmapping.render_kernels import BeamCounts
from gmapping.scan import View
from slams.frontend.motion_filter import Prediction
from slams.refine.lines import Match
from slams.types import Floats, Pose2, wrap_angle

FIRST_CLIMB_STEP = 0.01, 0.005  # m, rad: below the deviation of most peaks
N_CLIMB_HALVINGS = 3  # the last step is 1.25 mm
NO_FREE_SPACE = empty_counts((0, 0), (0, 0), 1.0)


class EndPointMatcher:
    """Matches the end points of a scan to the mean hits in the cells."""

    def __init__(self, params: GMappingParams) -> None:
        p = self._params = params
        self._hit_std = params.resolution / math.sqrt(12.0)  # m, of a hit uniform in its cell
        self.tiles = TileMap(p.n_particles, 1, p.resolution, p.max_tiles, p.max_cells, N_HIT_VALUES)

    def match(self, view: View, owner: int, prior: Prediction, start: Pose2) -> Match:
        """The mean of the samples around the peak near `start`, in the map of one particle."""
        poses, means, owners = np.array([start]), np.array([prior.pose]), np.array([owner])
        target = Posterior(self.tiles.tiles, owners, view.pieces, means, prior.information)
        covariance, _ = self._gaussians(view, target, poses)
        if prior.information.any():  # the match's information is that of the scan alone
            likelihood = target._replace(means=poses, information=np.zeros((3, 3)))
            covariance, _ = self._gaussians(view, likelihood, poses.copy())
        x, y, theta = poses[0].tolist()
        inlier_ratio = self.evaluate(view, owner, poses[0], NO_FREE_SPACE)[0] / view.beams
        pose, information = Pose2(x, y, float(wrap_angle(theta))), np.linalg.inv(covariance[0])
        return Match(pose, inlier_ratio, information=information)

    def propose(
        self, view: View, means: Floats, information: Floats, loops: list[Pose2], counts: BeamCounts
    ) -> Proposals:
        """[Grisetti07] improved proposal: mean, covariance and weight of samples at the peak."""
        poses, n = means.copy(), len(means)
        target = Posterior(self.tiles.tiles, np.arange(n), view.pieces, means, information)
        covariances, log_w = self._gaussians(view, target, poses)
        factors = np.linalg.cholesky(np.linalg.inv(covariances))
        return Proposals(poses, factors, log_w, np.zeros(n, np.bool_))

    def insert(self, view: View, poses: Floats, path_length: float) -> bool:
        """Insert the scan into the particles' maps at these poses; False if no tile was free."""
        return insert_ends(self.tiles.tiles, poses, view.pieces, self._params.cap) == 0

    def evaluate(
        self, view: View, owner: int, pose: Floats, counts: BeamCounts
    ) -> tuple[float, float]:
        """Inlier beams in one map, and beams in conflict with `counts`, at a pose (3,)."""
        return kernels.evaluate(self.tiles.tiles, owner, view.pieces, pose, counts)

    def _gaussians(self, view: View, target: Posterior, poses: Floats) -> tuple[Floats, Floats]:
        """Replace poses (k, 3) by the means of samples; covariances (k, 3, 3), log eta (k,)."""
        model = self._model(view)
        covariances, values = np.zeros((len(poses), 3, 3)), np.zeros(len(poses))
        kernels.climb(target, model, poses, values)
        kernels.sample(target, model, poses, covariances, values)
        return covariances, values

    def _model(self, view: View) -> HitModel:
        p, deviation = self._params, math.hypot(view.noise, self._hit_std)
        information = min(1.0, p.independent / view.beams) / deviation**2
        scale = max(p.band * p.resolution, 3.0 * view.noise)
        return HitModel(information, scale, *FIRST_CLIMB_STEP, N_CLIMB_HALVINGS)
