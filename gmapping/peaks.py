"""Peaks of likelihood x prior in the particles' maps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gmapping.map_kernels import SurfaceModel
from gmapping.match_kernels import Prior, register
from gmapping.tile_kernels import Tiles
from slams.types import Floats

SPARSE = 100  # points the lattice search looks at
WIDEST = 0.6  # m, rad; the search goes no farther
LATTICE = np.array([0.1, 0.1, 0.03])  # m, m, rad; within the reach of Gauss-Newton


class Belief(NamedTuple):
    """What is believed of one pose (3,) before the scan, and its covariance (3, 3)."""

    pose: Floats
    covariance: Floats

    def prior(self, n: int = 1) -> Prior:
        """The same for n starts."""
        information = np.linalg.inv(self.covariance)
        return Prior(np.tile(self.pose, (n, 1)), np.tile(information, (n, 1, 1)))


class Peaks(NamedTuple):
    """Poses (k, 3), negative log posterior (k,), information (k, 3, 3), beams close by (k,)."""

    poses: Floats
    cost: Floats
    information: Floats
    close: Floats


def climb(
    tiles: Tiles,
    owners: NDArray[np.int64],
    points: Floats,
    prior: Prior,
    starts: Floats,
    model: SurfaceModel,
) -> Peaks:
    """The peak near every start, in the map of its owner.

    Of the beams only a part is independent: in place of the original's gain over all particles.
    """
    poses, h, out = starts.copy(), np.zeros((len(starts), 3, 3)), np.zeros((len(starts), 5))
    register(tiles, owners, points, prior, model, poses, h, out)
    temper = min(1.0, model.independent / max(float(points[:, 4].sum()), 1.0))
    off = poses - prior.poses
    from_motion = 0.5 * np.einsum("ki,kij,kj->k", off, prior.information, off)
    cost = 0.5 * temper * out[:, 3] / model.sigma**2 + from_motion
    return Peaks(poses, cost, h, out[:, 4])


def search(tiles: Tiles, owner: int, points: Floats, belief: Belief, model: SurfaceModel) -> Floats:
    """The best pose (3,) of a lattice two standard deviations wide, as a start for `climb`."""
    half = np.minimum(2.0 * np.sqrt(np.diag(belief.covariance)), WIDEST) // LATTICE
    x, y, theta = (np.arange(-n, n + 1) for n in half)
    steps = np.stack(np.meshgrid(x, y, theta, indexing="ij"), axis=-1).reshape(-1, 3)
    prior, owners = belief.prior(len(steps)), np.full(len(steps), owner)
    sparse = np.ascontiguousarray(points[:: max(1, len(points) // SPARSE)])
    one_step = model._replace(steps=1)
    peaks = climb(tiles, owners, sparse, prior, prior.poses + steps * LATTICE, one_step)
    best: Floats = peaks.poses[np.argmin(peaks.cost)]
    return best
