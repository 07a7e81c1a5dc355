"""Kernels of when wheels were read: a scan may come with a pose of them that is older than itself.

ours. Recorders give a scan the last pose that the wheels have told. Where those tell seldom or out
of step with the laser, it is the same as the scan's before, and then two steps come at once, or
every so often half of one. Such errors do not add up like slips: what one step lacks the next has
too much. So the robot is kept where it was found in the frame of the odometry, `at`, as far as the
last reading was late and did not slip, and the next step is reckoned from there.
"""

from __future__ import annotations

import math
from typing import Any

from slams.geometry import wrap_angle
from slams.jit import njit
from slams.types import Records

MEMORY = 10.0  # s, in which it is learned how late readings are
LATEST, LONGEST = 0.2, 0.5  # s, deviation of a reading's time, and its most: more is no lateness
APART = 0.25  # s: of scans farther apart the robot itself goes to and fro, as key scans do
RATE = 0.5  # s, of the mean rate; readings that are so close are late alike

# Whether there is an `at` (1); the last step ahead [m] and its `change` from the one before; sums
# of how `ragged` steps are [m^2], and of squared `speeds` [m^2/s^2]
READING = "known ahead change ragged speeds"


@njit(inner=True, borrows=True)
def begin(wheels: Records, reads: Records, pose: Any) -> None:
    """The robot is where the wheels say. ours."""
    read = reads[0]
    read.known, read.ahead, read.change = 1.0, 0.0, 0.0
    for i in range(len(wheels)):
        wheels[i].at, wheels[i].rate, wheels[i].late = pose[i], 0.0, 0.0


@njit(inner=True, borrows=True)
def learn_lateness(
    wheels: Records, read: Any, told: Any, expected: float, slips: float, dt: float
) -> None:
    """Learn how late readings are from the step `told` by the wheels in `dt` [s]. ours.

    Steps that go to and fro from one scan to the next tell: a reading that is late by a whole step
    of the wheels, once in every few scans, has a variance of about the mean product of the changes
    of the steps. So have slips, of variance `slips`; how a robot changes its speed has not. A
    change that no reading of `LONGEST` ago makes, at the speed of the wheels or the one `expected`,
    a step ahead, tells nothing: odometry that leaps is not late. Nor do scans that are `APART`.
    """
    keep, share = math.exp(-dt / MEMORY), 1.0 - math.exp(-dt / RATE)
    change, speed = told[0] - read.ahead, max(abs(wheels[0].rate), abs(expected) / dt)
    if dt > APART or abs(change) > LONGEST * speed:
        return
    read.ragged = max(keep * read.ragged - change * read.change - slips, 0.0)
    read.speeds = keep * read.speeds + speed * speed
    for i in range(len(wheels)):
        wheels[i].rate += share * (told[i] / dt - wheels[i].rate)
    read.ahead, read.change = told[0], change


@njit(inner=True, borrows=True)
def lateness(
    wheels: Records, read: Any, expected: Records, dt: float
) -> tuple[float, float, float]:
    """Variances of a step ahead, aside and of its turn for a reading that may be late. ours."""
    if read.ragged == 0.0:
        return 0.0, 0.0, 0.0
    time = min(read.ragged / read.speeds, LATEST * LATEST)
    ahead = max(wheels[0].rate ** 2, (expected[0].step / dt) ** 2)
    aside = max(wheels[1].rate ** 2, (expected[1].step / dt) ** 2)
    turn = max(wheels[2].rate ** 2, (expected[2].step / dt) ** 2)
    return time * ahead, time * aside, time * turn


@njit(inner=True, borrows=True)
def alike(number: Any, dt: float) -> float:
    """Variance of what a reading is late, times the number of those that are late alike. ours."""
    return number.late * RATE / dt if dt > 0.0 else 0.0


@njit(inner=True, borrows=True)
def settle(wheels: Records, step: Any, dt: float) -> None:
    """Keep the robot where a step has brought it, as far as the last reading was late. ours.

    step: ahead, aside and turn, as of `Chord`. What it differs from what the wheels say of it is
    shared between lateness and slip by their variances.
    """
    ahead, aside, turn = wheels[0], wheels[1], wheels[2]
    scale = 1.0 / (1.0 + ahead.wrong)  # as the wheels count, without what was learned of them
    x, y = scale * step[0], scale * step[1]
    turned = step[2] - turn.wrong * x
    c, s = math.cos(turn.at + 0.5 * turned), math.sin(turn.at + 0.5 * turned)
    dx, dy = ahead.at + c * x - s * y - ahead.now, aside.at + s * x + c * y - aside.now
    off, beside = share(ahead, dt) * (c * dx + s * dy), share(aside, dt) * (c * dy - s * dx)
    ahead.at, aside.at = ahead.now + c * off - s * beside, aside.now + s * off + c * beside
    turn.at = turn.now + share(turn, dt) * wrap_angle(turn.at + turned - turn.now)


@njit(inner=True, borrows=True)
def share(number: Any, dt: float) -> float:
    """Share of a difference that is for lateness, not for slip. ours."""
    late = alike(number, dt)
    return late / (late + number.own - number.late) if late > 0.0 else 0.0
