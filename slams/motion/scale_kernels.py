"""Kernels of what wheels count wrongly of every way, and a gyro of every second.

ours. Wheels that are smaller than believed count too much of every way, by the same share; where
one is smaller than the other they veer, and count a turn of every way. As noise of single steps
that would average out; where scans see nothing along a corridor it adds up. So does a gyro's bias
where the map is drawn as it says. All are learned from ways over which every match saw for itself
where it was: a match that follows its prediction would only confirm it.
"""

from __future__ import annotations

from typing import Any

from slams.jit import njit

SEEN = 0.01  # m: deviation of a match by its scan alone, above which it does not see; and of the
# map from place to place, which no match knows
LENGTH, LONG = 1.0, 3.0  # m: of a way that tells of its scale, and of the veer
PRIOR = 0.03  # deviation of a scale before anything is known
WALK = 0.002  # deviation of a scale after one meter more
VEER, BEND = 0.05, 0.001  # rad/m: of a veer before anything is known, and after one meter more
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
def calibrate_veer(
    number: Any, way: float, found: float, match: float, last: float, law: Any
) -> None:
    """Learn from a `way` [m] whose turn was `found`, with the variances of both its ends. ours.

    `wrong`: so much more than is told the robot turns on every meter [rad/m]. A corner tells less
    than a straight way: the scale of turns is not known either. Headings are seen along corridors
    as well, so there is no end to learning.
    """
    limit = STEADY * STEADY
    if not sees(number, match, last, limit):
        return
    number.way += way
    number.gone += found - number.told
    number.turned += number.told
    number.unsure += BEND * BEND * abs(way)
    if abs(number.way) >= LONG:
        slip = law.turn_slip_way**2 * abs(number.way) + (law.turn_scale * number.turned) ** 2
        error = number.gone / number.way - number.wrong
        learn(number, error, number.start + match + slip + 2.0 * (limit + number.late))


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
        begin_way(number)
    elif number.way == 0.0:
        number.start = last
    return bool(tells)


@njit(inner=True, borrows=True)
def begin_way(number: Any) -> None:
    """Nothing is told of a way yet. ours."""
    number.way = number.gone = number.turned = 0.0


@njit(inner=True, borrows=True)
def learn(number: Any, error: float, ends: float) -> None:
    """A Kalman filter of `wrong`, of variance `unsure`; `ends` is the variance of the way's ends.

    ours. What is strange makes it less sure, so that it is believed if it stays.
    """
    unsure, variance = number.unsure, ends / (number.way * number.way)
    begin_way(number)
    strange = error * error / (STRANGE * STRANGE)
    if strange > unsure + variance:
        number.unsure += strange
        return
    share = unsure / (unsure + variance)
    number.wrong += share * error
    number.unsure = (1.0 - share) * unsure
