"""Poses of one scan that take part in the choice, and what a climb is weighed against."""

from __future__ import annotations

from typing import NamedTuple

from slams.refine.lines import Match as Fit
from slams.types import Pose2

NEAR, NEAR_TURN = 0.05, 0.02  # m, rad: a fit from the prediction ends where one from there does
PULLED = 0.1  # price from which a fit may have been pulled away by what moves
ALIKE = 0.005  # evidence by which two poses are not told apart


class Match(NamedTuple):
    """A pose that takes part in the choice, what the scan says of it, and how it does there.

    `quality` 0..1, share of the scan that the map explains; `evidence` the same less the share
    that it contradicts; `value` the same less the price of contradicting the prediction.
    """

    fit: Fit
    quality: float
    evidence: float
    value: float
    refined: bool

    @property
    def is_pulled(self) -> bool:
        """Whether it contradicts the prediction by so much that something may have moved it."""
        return self.evidence - self.value > PULLED

    def explains_no_less(self, other: Match) -> bool:
        """Whether the map explains and contradicts as much of the scan as at another pose."""
        return self.evidence > other.evidence - ALIKE


def is_near(a: Pose2, b: Pose2, far: float = NEAR, turn: float = NEAR_TURN) -> bool:
    """Whether two poses are less than so far apart [m, rad]."""
    step = a.between(b)
    return max(abs(step.x), abs(step.y)) < far and abs(step.theta) < turn
