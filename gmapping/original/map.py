"""HitMap: one map of end points for every particle."""

from __future__ import annotations

import numpy as np

from gmapping.map import TileMap
from gmapping.original.map_kernels import insert_hits
from gmapping.original.match_kernels import ClimbModel, climb_all
from gmapping.original.params import OriginalParams
from slams.types import Floats


class HitMap(TileMap):
    """Tiles whose cells keep mean and number of the hits, and which neighbors have hits."""

    def __init__(self, params: OriginalParams, n_particles: int) -> None:
        tiles = params.max_tiles, params.max_cells
        super().__init__(n_particles, 1, params.resolution, *tiles)
        self._model = ClimbModel(
            params.score_sigma,
            params.likelihood_sigma,
            params.linear_step,
            params.angular_step,
            params.iterations,
            params.missed,
            params.minimum_score,
        )

    def match(self, points: Floats, poses: Floats) -> tuple[Floats, int]:
        """Move poses to the peaks of their scores; log likelihoods there, and failures."""
        log_w = np.zeros(len(poses))
        failed = climb_all(self.tiles, points, self._model, poses, log_w)
        return log_w, failed

    def insert(self, points: Floats, poses: Floats) -> bool:
        """Insert the points into the particles' maps at these poses; False if no tile was free."""
        return insert_hits(self.tiles, poses, points) == 0
