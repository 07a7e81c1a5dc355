"""What a matcher offers: matches in one particle's map, and the proposals of all particles."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gmapping.map import TileMap
from gmapping.render_kernels import Counts
from gmapping.scan import View
from slams.geometry import Prior
from slams.refine.lines import Match
from slams.types import Floats, Pose2


class Revisit(NamedTuple):
    """Poses that the robot may have come back to, and what was seen from around there long ago."""

    poses: list[Pose2]
    seen: Counts


class Proposals(NamedTuple):
    """The Gaussians that particles are drawn from, and what they make of the weights.

    Peaks (n, 3), lower triangles L (n, 3, 3) of their information L L^T, log weights (n,), and
    which of them (n,) are where the robot was long ago: a loop closes.
    """

    peaks: Floats
    factors: Floats
    log_w: Floats
    closes: NDArray[np.bool_]


class Matcher(Protocol):
    """Matches scans to the particles' maps, `tiles`, and writes into them."""

    tiles: TileMap

    def match(self, view: View, owner: int, prior: Prior, start: Pose2) -> Match:
        """The peak near `start` in the map of one particle."""
        ...

    def propose(
        self, view: View, means: Floats, information: Floats, revisit: Revisit
    ) -> Proposals:
        """[Grisetti07] improved proposal of every particle; means (n, 3), information (n, 3, 3).

        ours: particles may be where the robot has come back to.
        """
        ...

    def insert(self, view: View, poses: Floats, way: float) -> bool:
        """Write a scan into the particles' maps, at these poses; False if there was no room.

        `way` [m] driven so far, more at every scan.
        """
        ...

    def evaluate(self, view: View, owner: int, pose: Pose2, seen: Counts) -> tuple[float, float]:
        """Shares of the beams that are inliers in one map, and that end where `seen` is free."""
        ...
