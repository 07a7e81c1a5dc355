"""Kernels of what wheels and gyro say of a step, and how far they are still believed.

Records of `SOURCE` have a row for each number that a source tells: ahead, aside, turn of the
wheels, the gyro's turn. `laws` is one row of `LAW`, `slams.motion.params.MotionParams` by name.
"""

from __future__ import annotations

import math
from typing import Any

from slams.geometry import wrap_angle
from slams.jit import njit
from slams.motion.reading_kernels import begin, lateness, learn_lateness
from slams.motion.velocity_kernels import FLOOR, TURN
from slams.types import Records

STANDING = 0.005  # m/s, rad/s: wheels below this count nothing
USUAL = 0.455  # median of a squared error in units of its variance
LEAST, WIDEST = 0.5, 1e4  # times the variance that is said
CAREFUL = 0.3  # of what was learned counts: up to three times may be chance
NONE, LEAP, CONTRADICTED, GOOD = range(4)  # a source's word

# The last word `said` and the `variance` it was given in the end (inf: none, or a leap); its `own`
# before any doubt; `doubted`, the variance that the velocity has from a contradiction; learned:
# `doubt`, the variance of a velocity that the source does not see, at `most` so great, and `scale`,
# times the variance of its own. Of wheels also their pose `now` (x, y, heading), where the robot is
# `at` in that frame, the mean `rate` a second, what of the own variance is for being `late`, the
# last step as `told`. Of what of every way or second is `wrong` (`scale_kernels`): how `unsure` it
# is, the `way` told since a match of variance `start`, what was `gone` and, of a veer, told to have
# `turned` on it, and the way that was `blind`
SOURCE = (
    "said variance own doubted doubt most scale now at rate late told wrong unsure way gone turned "
    "start blind"
)
LAW = (
    "way_scale turn_scale veer way_slip way_slip_turning turn_slip turn_slip_way side_slip stall "
    "gyro_noise gyro_bias gyro_scale witness_time top_speed top_turn_rate top_acceleration "
    "top_turn_acceleration leap doubt doubt_time scale_time"
)


@njit(borrows=True)
def allow(laws: Records, ahead: float, aside: float, turn: float, seconds: float) -> bool:
    """Whether a robot can go that far [m, rad] in so many seconds; if they are known. ours."""
    law = laws[0]
    if seconds <= 0.0:
        return True
    far = math.hypot(ahead, aside) > law.top_speed * seconds + law.leap
    return not far and abs(turn) <= law.top_turn_rate * seconds + law.leap


@njit(borrows=True)
def change(laws: Records, seconds: float) -> float:
    """How far [m] accelerations take a robot off its motion in so many seconds. ours."""
    far: float = laws[0].top_acceleration * seconds * seconds + laws[0].leap
    return far


@njit(inner=True, borrows=True)
def allow_turn(laws: Records, turn: float, expected: Any, late: float, reach: float) -> bool:
    """Whether a robot that was expected to turn otherwise can turn so in `reach` [s]. ours."""
    law = laws[0]
    possible = law.top_turn_acceleration * reach * reach + law.leap
    if abs(turn - expected.step) > possible + law.doubt * math.sqrt(expected.variance + late):
        return False
    return allow(laws, 0.0, 0.0, turn, reach)


@njit(inner=True, borrows=True)
def allow_step(laws: Records, step: Any, expected: Records, late: Any, reach: float) -> bool:
    """Whether a robot that was expected elsewhere can have made this step in `reach` [s]. ours.

    late: variances of the step ahead, aside and of its turn for readings that are late.
    """
    law, x, y, turn = laws[0], expected[0], expected[1], expected[TURN]
    off = math.hypot(step[0] - x.step, step[1] - y.step)
    doubt = law.doubt * math.sqrt(x.variance + late[0] + y.variance + late[1])
    if off > change(laws, reach) + doubt:
        return False
    if not allow(laws, step[0], step[1], step[2], reach):
        return False
    return allow_turn(laws, step[2], turn, late[2], reach)


@njit(inner=True, borrows=True)
def learn_doubt(source: Any, law: Any, error: float, variance: float, dt: float) -> bool:
    """Compare with what a match found; whether the two contradict each other. ours.

    A stalled wheel errs by the robot's velocity, whatever it counts: so does this. Only what
    contradicts a match by more than `doubt` deviations counts. It fades: no source is thrown away
    for good.
    """
    if error * error <= law.doubt**2 * variance:
        source.doubt *= math.exp(-2.0 * dt / law.doubt_time)
        return False
    speed = min(error * error / (dt * dt), source.most)
    source.doubt += (1.0 - math.exp(-dt / law.doubt_time)) * (speed - source.doubt)
    return True


@njit(inner=True, borrows=True)
def learn_scale(source: Any, law: Any, error: float, match: float, dt: float) -> None:
    """Compare with a match of variance `match`. ours.

    The scale's logarithm moves up where an error is beyond what is usual and down where it is not,
    each time by the same, so a fault of a second does not spoil it: like a median, not a mean.
    """
    change = math.exp(min(dt, 1.0) / law.scale_time)
    source.scale *= change if error * error > USUAL * (source.own + match) else 1.0 / change
    source.scale = min(max(source.scale, LEAST), WIDEST)


@njit(inner=True, borrows=True)
def compare(sources: Records, laws: Records, found: Any, variance: Any, dt: float) -> bool:
    """Learn from the step that a match found, of whose three numbers a source tells the last. ours.

    variance: the match's, inf: not known. Whether one number was contradicted.
    """
    wrong, first = False, len(found) - len(sources)
    for i in range(len(sources)):
        source, match = sources[i], variance[first + i]
        if match < math.inf:
            error = source.said - found[first + i]
            wrong |= learn_doubt(source, laws[0], error, source.own + match, dt)
            learn_scale(source, laws[0], error, match, dt)
    return wrong


@njit(inner=True, borrows=True)
def wheel_variance(
    laws: Records, step: Any, dt: float, unsure: float, veer: float
) -> tuple[float, float, float]:
    """Variances of a step by odometry; `unsure`, `veer`: of its scale and veer as learned.

    [Thrun05] 5.4: noise grows with the way and the turn. ours: scales on top, which are wrong for
    a whole drive. Aside there is only what the other two make of it: a heading that walks at
    random (variance q) while the robot goes s ends q s^2 / 12 beside its chord, a slip along the
    way (variance q) while it turns by w ends q w^2 / 12 beside. Wheels that stand still may be
    stalled.
    """
    law, (ahead, aside, turn) = laws[0], step
    way, turned = math.hypot(ahead, aside), abs(turn)
    rest = (law.stall * dt) ** 2 if way + turned < STANDING * dt else FLOOR
    slip = law.way_slip**2 * way + law.way_slip_turning**2 * turned
    walk = law.turn_slip**2 * turned + law.turn_slip_way**2 * way
    scale, veer = min(law.way_scale**2, unsure), min(law.veer**2, veer)
    beside = (walk * way * way + slip * turn * turn) / 12.0 + law.side_slip**2 * way
    return (
        scale * way * way + slip + rest,
        (law.turn_scale * aside) ** 2 + beside + rest,
        (law.turn_scale * turn) ** 2 + veer * way * way + walk + rest,
    )


@njit(inner=True, borrows=True)
def weigh(source: Any, expected: Any, limit: float, sure: bool) -> float:
    """Weigh a source's word against what is expected by their information, into both. ours.

    Where they contradict each other, by more than the root of `limit` in deviations, the gap
    counts as the source's error: it is returned, squared, else 0. Unless what is expected is `sure`
    it may be the wrong one as well: the result then lies midway, and its deviation covers both.
    """
    gap, gap2, var = source.said - expected.step, 0.0, expected.variance
    source.doubted = 0.0
    if gap * gap > limit * (source.variance + var):
        gap2 = gap * gap
        source.doubted = 0.0 if sure else gap2
        source.variance, var = source.variance + gap2, var + source.doubted
    share = var / (source.variance + var)
    expected.step, expected.variance = expected.step + share * gap, share * source.variance
    return gap2


@njit(inner=True, borrows=True)
def chord(last: Any, now: Any) -> tuple[float, float, float]:
    """The step from one pose to the next, seen from the heading half way: `chord_of`. ours."""
    c, s = math.cos(last[2]), math.sin(last[2])
    x, y, turn = now[0] - last[0], now[1] - last[1], wrap_angle(now[2] - last[2])
    x, y = c * x + s * y, c * y - s * x
    c, s = math.cos(0.5 * turn), math.sin(0.5 * turn)
    return c * x + s * y, c * y - s * x, turn


@njit(inner=True, borrows=True)
def corrected(wheels: Records, step: Any) -> tuple[float, float, float]:
    """A step without what was learned that wheels count wrongly of every way. ours."""
    scale = 1.0 + wheels[0].wrong
    return scale * step[0], scale * step[1], step[2] + wheels[TURN].wrong * step[0]


@njit(inner=True, borrows=True)
def silence(sources: Records) -> None:
    """The source says nothing. ours."""
    for i in range(len(sources)):
        sources[i].variance, sources[i].doubted = math.inf, 0.0


@njit(borrows=True)
def hear_wheels(
    wheels: Records,
    reads: Records,
    laws: Records,
    expected: Records,
    last: Any,
    now: Any,
    dt: float,
    reach: float,
) -> int:
    """Weigh the step between two poses of the odometry into what is expected. ours.

    Whether it is none (not finite), a leap, contradicted by all else, or good. A velocity bears
    witness against the wheels over a short interval, not over a long one. Where the wheels were
    caught of late by the match, what is expected is sure.
    """
    law, read, told = laws[0], reads[0], chord(last, now)
    silence(wheels)
    if not math.isfinite(told[0] + told[1] + told[2]):
        read.known = 0.0
        return NONE
    if read.known == 0.0:
        begin(wheels, reads, last)
    for i in range(len(wheels)):
        wheels[i].now, wheels[i].told, wheels[i].late = now[i], told[i], 0.0
    step = corrected(wheels, chord((wheels[0].at, wheels[1].at, wheels[2].at), now))
    own, short, late = (
        wheel_variance(laws, step, dt, wheels[0].unsure, wheels[TURN].unsure),
        0.0 < dt <= law.witness_time,
        (0.0, 0.0, 0.0),
    )
    if short:
        learn_lateness(wheels, read, told, expected[0].step, own[0], dt)
        late = lateness(wheels, read, expected, dt)
    if not allow_step(laws, step, expected, late, reach):
        return LEAP
    limit, gaps = (law.doubt**2 if short else math.inf), 0.0
    for i in range(len(wheels)):
        number, doubt = wheels[i], wheels[i].doubt * dt * dt
        number.own = own[i] * max(CAREFUL * number.scale, 1.0) + late[i]
        number.said, number.variance = step[i], number.own + doubt
        sure = doubt > number.own or (i == TURN and expected[i].measured > 0.0)
        gap = weigh(number, expected[i], limit, sure)
        number.late = late[i] if gap == 0.0 else 0.0
        gaps += gap
    return CONTRADICTED if gaps > 0.0 else GOOD


@njit(borrows=True)
def hear_gyro(
    gyro: Records, laws: Records, expected: Records, turn: float, dt: float, reach: float
) -> int:
    """Weigh a turn by the gyro into what is expected; whether it is a leap or good. ours."""
    number, law = gyro[0], laws[0]
    silence(gyro)
    number.told = turn
    turn += number.wrong * dt
    if not allow_turn(laws, turn, expected[TURN], 0.0, reach):
        return LEAP
    bias, scale = min(law.gyro_bias**2, number.unsure), law.gyro_scale * turn
    number.own = law.gyro_noise**2 * dt + bias * dt * dt + scale**2 + FLOOR
    number.said, number.variance = turn, number.own + number.doubt * dt**2
    weigh(number, expected[TURN], math.inf, True)
    expected[TURN].known, expected[TURN].measured = expected[TURN].step, 1.0
    return GOOD
