"""What comes out of a registration."""

from __future__ import annotations

from typing import NamedTuple

from slams.types import Floats, Pose2


class Fix(NamedTuple):
    """A registered pose: whether to trust it, quality in [0, 1], wide start used.

    `aligned` is the pose before an earlier slip was made good along a direction that the scan sees
    badly: the robot did not drive that far, it was not where it was thought to be.
    `information` (3, 3) [1/m2, 1/(m rad), 1/rad2] is what the scan alone says of the pose,
    `doubt` (2, 2) [m2] the variance of a slip.
    """

    pose: Pose2
    aligned: Pose2
    good: bool
    quality: float
    information: Floats
    doubt: Floats
    searched: bool = False
