"""Kernels of what wheels count wrongly of every way, and a gyro of every second.

ours. Wheels that are smaller than believed count too much of every way, by the same share. As noise
of single steps that would average out; where scans see nothing along a corridor it adds up. So does
a gyro's bias where the map is drawn as it says. Both are learned from ways over which every match
saw for itself where it was: a match that follows its prediction would only confirm it.
"""

from __future__ import annotations

from typing import Any

from slams.jit import njit

SEEN = 0.01  # m: deviation of a match by its scan alone, above which it does not see; and of the
# map from place to place, which no match knows
LENGTH = 1.0  # m: of a way that tells
PRIOR = 0.03  # deviation of a scale before anything is known
WALK = 0.002  # deviation of a scale after one meter more
STEADY = 0.003  # rad: the same as `SEEN` for headings
SECONDS = 2.0  # s: of a time that tells
BIAS = 0.01  # rad/s: deviation of a bias before anything is known
DRIFT = 1e-4  # rad/s: deviation of a bias after one second more
BLIND = 10.0  # m that no match saw, from which on the map has the scale of the wheels
BELIEVED = 4.0  # times the own variance: what contradicts all else tells of no scale
STRANGE = 4.0  # deviations, beyond which a way tells of no scale: a stall, a jump


@njit(inner=True, borrows=True)
def calibrate(number: Any, found: float, match: float, last: float) -> None:
    """Learn from a step that was `found` so long [m], with the variances of both its ends. ours.

    `wrong`: a way is 1 + wrong times what is told. A corridor that was driven blind stands in the
    map as the wheels told it: whoever learns better only then comes back by another length, and
    rings of corridors do not close. So nothing is learned any more after `BLIND` meters of that.
    """
    limit = SEEN * SEEN
    if match >= limit:
        number.blind += abs(number.told)
    if not sees(number, match, last, limit) or number.blind > BLIND:
        return
    number.way += number.told
    number.gone += found
    number.unsure += WALK * WALK * abs(number.told)
    if abs(number.way) >= LENGTH:
        error = number.gone / number.way - 1.0 - number.wrong
        learn(number, error, number.start + match + 2.0 * (limit + number.late))


@njit(inner=True, borrows=True)
def calibrate_gyro(number: Any, found: float, match: float, last: float, dt: float) -> None:
    """Learn from a turn that was `found` [rad] in `dt` [s], with the variances of both its ends.

    ours. `wrong`: so much faster [rad/s] the robot turns than is told.
    """
    limit = STEADY * STEADY
    if not sees(number, match, last, limit):
        return
    number.way += dt
    number.gone += found - number.told
    number.unsure += DRIFT * DRIFT * dt
    if number.way >= SECONDS:
        learn(number, number.gone / number.way - number.wrong, number.start + match + 2.0 * limit)


@njit(inner=True, borrows=True)
def sees(number: Any, match: float, last: float, limit: float) -> bool:
    """Whether a step tells of its source: seen at both ends, and nothing contradicts. ours."""
    tells = number.variance < BELIEVED * number.own and match < limit and last < limit
    if not tells:
        number.way = number.gone = 0.0
    elif number.way == 0.0:
        number.start = last
    return bool(tells)


@njit(inner=True, borrows=True)
def learn(number: Any, error: float, ends: float) -> None:
    """A Kalman filter of `wrong`, of variance `unsure`; `ends` is the variance of the way's ends.

    ours. What is strange makes it less sure, so that it is believed if it stays.
    """
    unsure, variance = number.unsure, ends / (number.way * number.way)
    number.way = number.gone = 0.0
    strange = error * error / (STRANGE * STRANGE)
    if strange > unsure + variance:
        number.unsure += strange
        return
    share = unsure / (unsure + variance)
    number.wrong += share * error
    number.unsure = (1.0 - share) * unsure
