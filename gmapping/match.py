"""What both matchers share: the proposals of all particles, and from when on surfaces are old."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gmapping.render_kernels import Counts
from slams.types import Floats, Pose2

OLD = 15.0  # m of way after which a surface is old: no robot sees a room that long without a loop


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
