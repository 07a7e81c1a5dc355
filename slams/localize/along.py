"""How far along a corridor a robot is that was matched again after a gap.

ours. Walls beside explain a scan wherever along them the robot is, so a match there stands, however
far the robot went unseen; only the few beams that end where the corridor does tell. So each beam is
asked where along the corridor the map explains it, and those that it explains elsewhere say where.
"""

from __future__ import annotations

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

    def _said(of: Floats, steps: Floats) -> Said:
        return np.array([chart.judged(of, _moved(laser, along, s)) for s in steps.tolist()])

    here, steps = chart.judged(points, laser), _steps(FARTHEST, STEP)
    asks = (here == OPEN) | (here == REFUTED)  # what is explained here speaks for no other place
    asking, rest = points[asks], points[~asks]
    said = _said(asking, steps)
    maybe = np.flatnonzero(_lead(said, here[asks]) > 0.0)
    if len(maybe) == 0:
        return None
    all_said = np.hstack([said[maybe], _said(rest, steps[maybe])])
    lead = _lead(all_said, np.concatenate([here[asks], here[~asks]]))
    first, gained = int(np.argmax(lead)), said == EXPLAINED
    best, explained = maybe[first], np.mean(all_said[first] == EXPLAINED)
    elsewhere = gained[np.abs(steps - steps[best]) > APART].sum(axis=1).max()
    alike = elsewhere > ALIKE * gained[best].sum()
    if lead[first] <= 0.0 or alike or explained < KNOWN:
        return None
    telling = asking[gained[best]]
    finer = steps[best] + _steps(2.0 * STEP, FINE)
    off = [chart.distances(telling, _moved(laser, along, s)).mean() for s in finer.tolist()]
    return _moved(laser, along, float(finer[np.argmin(off)]))


def _lead(said: Said, here: Said) -> Floats:
    """What is said (steps, beams) more than `here` (beams,), beyond what chance says.

    What is unknown here or there is not counted: from where the map begins all is known, and would
    lead there.
    """
    more = np.where((said == UNKNOWN) | (here == UNKNOWN), 0, said - here).astype(np.float64)
    return np.asarray(more.sum(axis=1) - SURE * np.sqrt((more**2).sum(axis=1)))


def _steps(half: float, step: float) -> Floats:
    """From -half to half [m]; the middle one is 0."""
    n = round(half / step)
    return np.asarray(step * np.arange(-n, n + 1), np.float64)


def _moved(pose: Pose2, along: Floats, by: float) -> Pose2:
    x, y = along.tolist()
    return Pose2(pose.x + by * x, pose.y + by * y, pose.theta)
