"""The matcher of the preset `paper`: end points, climbed; the proposal is fitted to samples."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gmapping import climb_kernels as kernels
from gmapping.climb_kernels import Field
from gmapping.hit_kernels import HIT_DEPTH, insert_ends
from gmapping.map import TileMap
from gmapping.match import Match, Proposals, lattice
from gmapping.match_kernels import Prior as Priors
from gmapping.params import GMappingParams
from gmapping.scan import View
from slams.geometry import Prior
from slams.motion.track import Track
from slams.types import Floats, Pose2, wrap_angle

STEP = np.array([0.1, 0.1, 0.05])  # m, m, rad, of the search; the climb bridges what is between
SPARSE = 100  # pieces that the search looks at
FAINT = 1e-6  # share of an information that is lost in rounding


class EndPointMatcher:
    """Distances of a scan's end points from the mean hits in the cells."""

    def __init__(self, params: GMappingParams) -> None:
        p = self._params = params
        self._cell = params.resolution / math.sqrt(12.0)  # m, how far a mean hit is off
        self.tiles = TileMap(p.n_particles, 1, p.resolution, p.max_tiles, p.max_cells, HIT_DEPTH)

    def match(self, view: View, owner: int, prior: Prior, start: Pose2) -> Match:
        """The mean of the Gaussian around the peak near `start`, in the map of one particle."""
        poses, owners, field = np.array([start]), np.array([owner]), self._field(view)
        known = Priors(np.array([prior.pose]), prior.information[None])
        covariances, _ = self._gaussians(view, owners, known, poses)
        total, near = kernels.explained(self.tiles.tiles, owner, view.pieces, poses[0], field)
        x, y, theta = poses[0].tolist()
        finest = np.array((field.way, field.way, field.turn)) / 2.0**field.halvings
        reach = np.maximum(np.sqrt(2.0 * np.diagonal(covariances[0])), finest)
        seen = kernels.information(self.tiles.tiles, owner, view.pieces, poses[0], reach, field)
        pose, cost = Pose2(x, y, float(wrap_angle(theta))), 0.5 * field.worth * total
        return Match(pose, near / view.beams, positive(seen), cost)

    def search(self, view: View, owner: int, center: Pose2, half: Floats) -> Pose2:
        """The best pose of a lattice, some halvings of the climb from each of its points."""
        starts = np.array(center) + lattice(half, STEP)
        n, known = len(starts), np.diag(1.0 / np.maximum(half, STEP) ** 2)
        prior = Priors(np.tile(np.array(center), (n, 1)), np.tile(known, (n, 1, 1)))
        sparse = np.ascontiguousarray(view.pieces[:: max(1, len(view.pieces) // SPARSE)])
        value, field = np.zeros(n), self._field(view)._replace(halvings=1)
        kernels.climb(self.tiles.tiles, np.full(n, owner), sparse, field, prior, starts, value)
        return Pose2(*starts[np.argmax(value)].tolist())

    def propose(self, view: View, means: Floats, information: Floats, track: Track) -> Proposals:
        """[Grisetti07] improved proposal, mean, covariance and weight of samples at the peak."""
        poses = means.copy()
        prior, owners = Priors(means, information), np.arange(len(means))
        covariances, log_w = self._gaussians(view, owners, prior, poses)
        return Proposals(poses, np.linalg.cholesky(np.linalg.inv(covariances)), log_w)

    def insert(self, view: View, poses: Floats) -> bool:
        """Write the scan into the particles' maps, at these poses; False if there was no room."""
        return insert_ends(self.tiles.tiles, poses, view.pieces, self._params.cap) == 0

    def _gaussians(
        self, view: View, owners: NDArray[np.int64], prior: Priors, poses: Floats
    ) -> tuple[Floats, Floats]:
        """Poses (k, 3) become the samples' means; covariances (k, 3, 3), log eta (k,)."""
        field, tiles = self._field(view), self.tiles.tiles
        covariances, values = np.zeros((len(poses), 3, 3)), np.zeros(len(poses))
        kernels.climb(tiles, owners, view.pieces, field, prior, poses, values)
        kernels.sample(tiles, owners, view.pieces, field, prior, poses, covariances, values)
        return covariances, values

    def _field(self, view: View) -> Field:
        p, deviation = self._params, math.hypot(view.noise, self._cell)
        worth = min(1.0, p.independent / view.beams) / deviation**2
        soft = max(p.soft, 3.0 * view.noise)
        return Field(worth, soft, p.climb_way, p.climb_turn, p.climb_halvings)


def positive(information: Floats) -> Floats:
    """The same (3, 3) without what is negative: a scan takes nothing from what is known.

    Of nothing at all there is no inverse: what is less than `FAINT` of the most is that much.
    """
    values, vectors = np.linalg.eigh(information)
    values = np.maximum(values, max(FAINT * values[-1], 0.0))
    return np.asarray((vectors * values) @ vectors.T, np.float64)
