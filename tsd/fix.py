"""What goes into a registration and what comes out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slams.types import Floats, Pose2


class Start(NamedTuple):
    """Predicted pose of the base, its deviation [m], [rad], and other poses worth a try.

    The last of these is where the base is if odometry is wrong; `doubtful` when it may be.
    """

    pose: Pose2
    deviation: float
    turn_deviation: float
    others: tuple[Pose2, ...]
    doubtful: bool = False


class Fix(NamedTuple):
    """A registered pose: whether to trust it, quality in [0, 1], wide start used.

    `slip` [m] is how far `pose` was moved along a direction that the scan sees badly, in the frame
    of the map: the robot did not drive that far, it was not where it was thought to be.
    `information` (3, 3) [1/m2, 1/(m rad), 1/rad2] holds the lower triangle of the normal
    equations, zeros where there are none.
    """

    pose: Pose2
    good: bool
    quality: float
    information: Floats
    searched: bool = False
    slip: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def none(cls, pose: Pose2) -> Fix:
        """No match: the given pose, not to be trusted."""
        return cls(pose, False, 0.0, np.zeros((3, 3)))

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) [m2, m rad, rad2]; inf where nothing is known."""
        full = np.tril(self.information) + np.tril(self.information, -1).T
        if np.linalg.matrix_rank(full) != 3:
            return np.full((3, 3), np.inf)
        return np.asarray(np.linalg.inv(full), np.float64)
