"""How far along a corridor a robot is that was matched again after a gap.

ours. Walls beside explain a scan wherever along them the robot is, so a match there stands, however
far the robot went unseen; only the few beams that end where the corridor does tell. So each beam is
asked where along the corridor the map explains it, and those that it explains elsewhere say where.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.localize.chart import Chart
from slams.localize.chart_kernels import EXPLAINED, OPEN, REFUTED, UNKNOWN
from slams.types import Floats, Pose2

FARTHEST, STEP = 3.0, 0.1  # m to either side: a robot's way in some seconds; below what agrees
FINE = 0.02  # m, of the place at last
APART = 0.5  # m; places closer than this are one
SURE = 2.5  # deviations of what is said by chance; seven beams of one mind are as many
ALIKE = 0.5  # share of the beams gained that are gained at another place, too
KNOWN = 0.8  # share of the beams that the place explains: else the robot is elsewhere altogether

Said = NDArray[np.int8]


def farther_along(chart: Chart, points: Floats, laser: Pose2, along: Floats) -> Pose2 | None:
    """Where along the unit vector `along` (2,) the map explains beams that it does not here.

    points (n, 2) [m] in the frame of the laser, whose pose is meant. None if it is as good here, or
    at several places.
    """
    steps = _steps(FARTHEST, STEP)
    said = np.array([chart.judged(points, _moved(laser, along, s)) for s in steps.tolist()])
    best = _best(steps, said)
    if best is None or np.mean(said[best] == EXPLAINED) < KNOWN:
        return None
    telling = points[_gained(said)[best]]
    finer = steps[best] + _steps(2.0 * STEP, FINE)
    off = [chart.distances(telling, _moved(laser, along, s)).mean() for s in finer.tolist()]
    return _moved(laser, along, float(finer[np.argmin(off)]))


def _best(steps: Floats, said: Said) -> int | None:
    """The step at which clearly more is said (steps, beams) than at the middle one, none elsewhere.

    What is unknown here or there is not counted: from where the map begins all is known, and would
    lead there.
    """
    here = said[len(steps) // 2]
    more = np.where((said == UNKNOWN) | (here == UNKNOWN), 0, said - here)
    lead = more.sum(axis=1)
    best, gained = int(np.argmax(lead)), _gained(said).sum(axis=1)
    sure = lead[best] > SURE * math.sqrt((more[best] ** 2).sum())
    elsewhere = gained[np.abs(steps - steps[best]) > APART].max()
    return best if sure and elsewhere <= ALIKE * gained[best] else None


def _gained(said: Said) -> NDArray[np.bool_]:
    """The beams (steps, beams) explained at a step, and known not to be at the middle one."""
    here = said[len(said) // 2]
    return np.asarray((said == EXPLAINED) & ((here == OPEN) | (here == REFUTED)))


def _steps(half: float, step: float) -> Floats:
    """From -half to half [m]; the middle one is 0."""
    n = round(half / step)
    return np.asarray(step * np.arange(-n, n + 1), np.float64)


def _moved(pose: Pose2, along: Floats, by: float) -> Pose2:
    x, y = along.tolist()
    return Pose2(pose.x + by * x, pose.y + by * y, pose.theta)
