"""The kernel of how far wheels count the way wrongly.

ours. Wheels that are smaller than believed count too much of every way, by the same share. As noise
of single steps that would average out; where scans see nothing along a corridor it adds up. So the
share is learned, from ways over which every match saw for itself where it was: a match that follows
its prediction would only confirm it.
"""

from __future__ import annotations

from typing import Any

from slams.jit import njit

SEEN = 0.01  # m: deviation of a match by its scan alone, above which it does not see; and of the
# map from place to place, which no match knows
LENGTH = 1.0  # m: of a way that tells
PRIOR = 0.03  # deviation of a scale before anything is known
WALK = 0.002  # deviation of a scale after one meter more
BELIEVED = 4.0  # times the own variance: what contradicts all else tells of no scale
STRANGE = 4.0  # deviations, beyond which a way tells of no scale: a stall, a jump


@njit(inner=True, borrows=True)
def calibrate(number: Any, found: float, match: float, last: float) -> None:
    """Learn from a step that was `found` so long [m], with the variances of both its ends. ours.

    A Kalman filter of one number, `wrong` (a way is 1 + wrong times what is told), of variance
    `unsure`. What is strange makes it less sure, so that it is believed if it stays.
    """
    told, limit = number.told, SEEN * SEEN
    believed = number.variance < BELIEVED * number.own
    if not (believed and match < limit and last < limit):
        number.way = number.gone = 0.0
        return
    if number.way == 0.0:
        number.start = last
    number.way += told
    number.gone += found
    number.unsure += WALK * WALK * abs(told)
    if abs(number.way) < LENGTH:
        return
    way, unsure = number.way, number.unsure
    error = number.gone / way - 1.0 - number.wrong
    variance = (number.start + match + 2.0 * (limit + number.late)) / (way * way)
    number.way = number.gone = 0.0
    strange = error * error / (STRANGE * STRANGE)
    if strange > unsure + variance:
        number.unsure += strange
        return
    share = unsure / (unsure + variance)
    number.wrong += share * error
    number.unsure = (1.0 - share) * unsure
