"""What a matcher finds: the pose of one scan, or the peaks around all particles."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from gmapping.map import TileMap
from gmapping.scan import View
from slams.geometry import Prior, unlikely
from slams.motion.track import Track
from slams.types import Floats, Pose2, wrap_angle

HALF_STEPS = 8  # of a search to either side, at most
FIRM = np.outer((10.0, 10.0, 1.0), (10.0, 10.0, 1.0))  # times the information: a place that stays


class Match(NamedTuple):
    """A pose in the reported particle's map.

    `quality` is the share of the beams that lie where the map has something, `seen` (3, 3) the
    information of the scan, `cost` what of its negative log likelihood depends on the pose, `old`
    the share that ground of old explains.
    """

    pose: Pose2
    quality: float
    seen: Floats
    cost: float
    old: float = 0.0


def far_off(poses: Floats, means: Floats, information: Floats) -> Floats:
    """Squared distances (k,) of poses (k, 3) from means (k, 3), by information (k, 3, 3)."""
    off = poses - means
    off[:, 2] = wrap_angle(off[:, 2])
    squares: Floats = np.einsum("ki,kij,kj->k", off, information, off)
    return squares


def strange(match: Match, prior: Prior) -> float:
    """How far a match is from what is known, squared, in deviations of that."""
    pose, mean = np.array([match.pose]), np.array([prior.pose])
    return float(far_off(pose, mean, prior.information[None])[0])


def with_prior(match: Match, prior: Prior) -> float:
    """Cost of a match and of its distance from the prior.

    Of two places an independent beam tells no more than e to one, however far it is off.
    """
    return match.cost + unlikely(strange(match, prior))


class Proposals(NamedTuple):
    """The Gaussians that particles are drawn from, and what they make of the weights.

    Peaks (n, 3), lower triangles L (n, 3, 3) of their information L L^T, log weights (n,).
    """

    peaks: Floats
    factors: Floats
    log_w: Floats


class Matcher(Protocol):
    """Matches scans to the particles' maps, `tiles`, and writes into them."""

    tiles: TileMap

    def match(self, view: View, owner: int, prior: Prior, start: Pose2) -> Match:
        """The peak near `start` in the map of one particle."""
        ...

    def search(self, view: View, owner: int, center: Pose2, half: Floats) -> Pose2:
        """The best pose of a lattice as wide as `half` (3,) [m, m, rad] to either side."""
        ...

    def propose(self, view: View, means: Floats, information: Floats, track: Track) -> Proposals:
        """[Grisetti07] improved proposal of every particle; means (n, 3), information (n, 3, 3).

        track: of the reported one, which has matched the same scan.
        """
        ...

    def insert(self, view: View, poses: Floats) -> bool:
        """Write a scan into the particles' maps, at these poses; False if there was no room."""
        ...


def lattice(half: Floats, step: Floats) -> Floats:
    """Offsets (k, 3) of a lattice around 0, steps (3,), not beyond `half` (3,)."""
    counts = np.minimum(half // step, HALF_STEPS)
    x, y, theta = (np.arange(-n, n + 1) for n in counts)
    cells = np.stack(np.meshgrid(x, y, theta, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(cells * step, np.float64)
