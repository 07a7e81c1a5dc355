"""Slip: how far along a corridor the robot is from where it was taken to be.

Gauss-Newton does not see it: the few things that face along a corridor are beyond its reach once
the robot has slipped, and noise holds the pose where it is. So the scan is laid along the corridor
and asked how much more of it agrees with the map there, thing by thing. A lead counts as far as it
is more than chance: in a bare corridor nothing agrees more or less anywhere, then nothing is
proven; things that are seen again from scan to scan prove more each time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from slams.types import Floats, Pose2

SHIFTS = np.linspace(-0.4, 0.4, 17)  # m, along the corridor
BETWEEN = float(SHIFTS[1] - SHIFTS[0]) ** 2 / 12.0  # m^2, variance of a place between two of them
CHANCE = 0.5  # deviations of a lead that count for nothing

# From a pose and offsets (n, 2) [m] to (n, 2): how many more of the scan's things agree with the
# map at the pose moved by each offset, and the sum of the squares of what each agrees more.
Leads = Callable[[Pose2, Floats], Floats]


class Slip(NamedTuple):
    """How far [m] to move the pose, and the information [1/m^2] about that, where proven."""

    moved: float
    information: float


def slip(leads: Floats, variance: float) -> Slip:
    """The slip by the leads (n, 2) at `SHIFTS`, if a pose of that variance [m^2] can have slipped.

    By Bayes: the mean of all places; what is not narrower after the look than before is no proof.
    """
    lead, chance = leads[:, 0], CHANCE * np.sqrt(leads[:, 1])
    evidence = np.sign(lead) * np.maximum(np.abs(lead) - chance, 0.0)
    before = np.exp(-0.5 * SHIFTS**2 / variance)
    after = before * np.exp(evidence - evidence.max())
    _, doubt_before = _moments(before)
    mean, doubt = _moments(after)
    return Slip(mean, max(1.0 / doubt - 1.0 / doubt_before, 0.0))


def _moments(likelihood: Floats) -> tuple[float, float]:
    """Mean [m] and variance [m^2] of a slip."""
    weight = likelihood / likelihood.sum()
    mean = float(weight @ SHIFTS)
    return mean, float(weight @ (SHIFTS - mean) ** 2) + BETWEEN
