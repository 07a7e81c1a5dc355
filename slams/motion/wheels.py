"""What wheels and gyro say of a step, and how sure they are."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.motion.chord import FLOOR, NOTHING, UNKNOWN, Chord, chord_of
from slams.motion.params import MotionParams
from slams.motion.trust import Doubt, Expected, Limits, Scale
from slams.types import Pose2, Scan

STANDING = 0.005  # m/s, rad/s: wheels below this count nothing


class Wheels:
    """Odometry: the whole step.

    `step` and `variance` are its last word (None and inf: none, or a leap), `contradicts` whether
    all else spoke against it, `doubted` the variances that the velocity has from that. `used` and
    `faults` count scans.
    """

    def __init__(self, params: MotionParams) -> None:
        self.used = self.faults = 0
        self.step: Chord | None = None
        self.variance = self._own = UNKNOWN
        self.contradicts = False
        self.doubted = NOTHING
        self._p, self._limits = params, Limits(params)
        tops = (params.top_speed, params.top_speed, params.top_turn_rate)
        self._doubts = [Doubt(params, top) for top in tops]
        self._scales = [Scale(params) for _ in tops]

    def add(self, before: Scan, scan: Scan, known: Expected) -> Expected:
        """What is known of the step with the wheels heard; a leap is not."""
        step = wheel_step(before, scan) if self._p.wheels else None
        self.contradicts = step is not None and not self._limits.allow_step(step, known)
        self.faults += self.contradicts
        self.step, self.variance = None if self.contradicts else step, UNKNOWN
        self.doubted = NOTHING
        if self.step is None:
            return known
        self.used += 1
        own = wheel_variance(self._p, self.step, known.dt)
        ahead, aside, turn = self._scales
        self._own = Chord(
            own.ahead * ahead.variance, own.aside * aside.variance, own.turn * turn.variance
        )
        return self._fused(self.step, known)

    def compare(self, found: Chord, variance: Chord, dt: float) -> None:
        """Learn from the step that a match found, with its variances (inf: not known)."""
        if self.step is None or dt <= 0.0:
            return
        wrong = False
        for i, doubt in enumerate(self._doubts):
            if variance[i] < math.inf:
                error = self.step[i] - found[i]
                wrong |= doubt.learn(error, self._own[i] + variance[i], dt)
                self._scales[i].learn(error, self._own[i], variance[i], dt)
        self.faults += wrong

    def fade(self, dt: float) -> None:
        """There was no match to compare with."""
        for doubt in self._doubts:
            doubt.fade(dt)

    def _fused(self, step: Chord, known: Expected) -> Expected:
        """Weigh the three numbers of a step.

        A velocity bears witness against the wheels over a short interval, not over a long one.
        """
        p, dt, own, was, spread = self._p, known.dt, self._own, known.step, known.variance
        limit = p.doubt**2 if 0.0 < dt <= p.witness_time else math.inf
        ahead, aside, turn = (doubt.variance * dt * dt for doubt in self._doubts)
        sure = known.turn_measured or turn > own.turn  # caught of late, by the match
        t = _weighed(step.turn, own.turn + turn, was.turn, spread.turn, limit, sure)
        sure = ahead > own.ahead
        a = _weighed(step.ahead, own.ahead + ahead, was.ahead, spread.ahead, limit, sure)
        sure = aside > own.aside
        b = _weighed(step.aside, own.aside + aside, was.aside, spread.aside, limit, sure)
        self.variance = Chord(a.said, b.said, t.said)
        self.contradicts = a.gap2 + b.gap2 + t.gap2 > 0.0
        self.doubted = Chord(a.doubted, b.doubted, t.doubted)
        mean, variance = Chord(a.mean, b.mean, t.mean), Chord(a.var, b.var, t.var)
        return Expected(mean, variance, known.dt, known.reach, True)


class Gyro:
    """The turn by the gyro; `used` counts scans. `turn`, `variance`: its last word."""

    def __init__(self, params: MotionParams) -> None:
        self.used = 0
        self.turn: float | None = None
        self.variance = math.inf
        self._own = math.inf
        self._p, self._limits = params, Limits(params)
        self._doubt = Doubt(params, params.top_turn_rate)

    def add(self, before: Scan, scan: Scan, known: Expected) -> Expected:
        """What is known of the step with the gyro heard; a leap is not."""
        turn = gyro_turn(before, scan) if self._p.gyro else None
        self.turn, self.variance = None, math.inf
        if turn is None or not self._limits.allow_turn(turn, known):
            return known
        self.used += 1
        self._own = gyro_variance(self._p, turn, known.dt)
        self.turn, self.variance = turn, self._own + self._doubt.variance * known.dt**2
        t = _weighed(turn, self.variance, known.step.turn, known.variance.turn, math.inf, True)
        step = Chord(known.step.ahead, known.step.aside, t.mean)
        variance = Chord(known.variance.ahead, known.variance.aside, t.var)
        return Expected(step, variance, known.dt, known.reach, True)

    def compare(self, found: Chord, variance: Chord, dt: float) -> None:
        """Learn from the step that a match found, with its variances (inf: not known)."""
        if self.turn is not None and dt > 0.0 and variance.turn < math.inf:
            self._doubt.learn(self.turn - found.turn, self._own + variance.turn, dt)

    def fade(self, dt: float) -> None:
        """There was no match to compare with."""
        self._doubt.fade(dt)


def wheel_step(before: Scan, scan: Scan) -> Chord | None:
    """The step by odometry; None where a scan has none or it is not finite."""
    last, now = before.odometry, scan.odometry
    if last is None or now is None:
        return None
    if not math.isfinite(sum(last) + sum(now)):
        return None
    return chord_of(Pose2(*last).between(now))


def gyro_turn(before: Scan, scan: Scan) -> float | None:
    """The turn [rad] by the gyro; None where a scan has none or it is not finite."""
    if before.yaw is None or scan.yaw is None or not math.isfinite(scan.yaw - before.yaw):
        return None
    return math.remainder(scan.yaw - before.yaw, 2.0 * math.pi)


def wheel_variance(p: MotionParams, step: Chord, dt: float) -> Chord:
    """Variances of a step by odometry.

    [Thrun05] 5.4: noise grows with the way and the turn. ours: scales on top, which are wrong for
    a whole drive. Aside there is only what the other two make of it: a heading that walks at
    random (variance q) while the robot goes s ends q s^2 / 12 beside its chord, a slip along the
    way (variance q) while it turns by w ends q w^2 / 12 beside. Wheels that stand still may be
    stalled.
    """
    ahead, aside, turn = step
    way, turned = math.hypot(ahead, aside), abs(turn)
    rest = (p.stall * dt) ** 2 if way + turned < STANDING * dt else FLOOR
    slip = p.way_slip**2 * way + p.way_slip_turning**2 * turned
    walk = p.turn_slip**2 * turned + p.turn_slip_way**2 * way
    beside = (walk * way * way + slip * turn * turn) / 12.0 + p.side_slip**2 * way
    return Chord(
        (p.way_scale * way) ** 2 + slip + rest,
        (p.turn_scale * aside) ** 2 + beside + rest,
        (p.turn_scale * turn) ** 2 + (p.veer * way) ** 2 + walk + rest,
    )


def gyro_variance(p: MotionParams, turn: float, dt: float) -> float:
    """Variance of a turn by the gyro: white noise, bias, scale. ours."""
    return p.gyro_noise**2 * dt + (p.gyro_bias * dt) ** 2 + (p.gyro_scale * turn) ** 2 + FLOOR


class Weighed(NamedTuple):
    """Two opinions on one number, as one: its mean and variance.

    `said` is the variance that the new opinion was given in the end, `gap2` the squared gap
    between the two where they contradict each other, else 0; `doubted` what of it the other was
    given, too.
    """

    mean: float
    var: float
    said: float
    gap2: float
    doubted: float


def _weighed(
    value: float, said: float, known: float, var: float, limit: float, sure: bool
) -> Weighed:
    """Weigh a new opinion (variance `said`) against what is known (`var`) by their information.

    Where they contradict each other, by more than the root of `limit` in deviations, the gap
    counts as the new one's error. Unless the other is `sure` it may be the wrong one as well: the
    result then lies midway, and its deviation covers both.
    """
    gap, gap2, doubted = value - known, 0.0, 0.0
    if gap * gap > limit * (said + var):
        gap2 = gap * gap
        doubted = 0.0 if sure else gap2
        said, var = said + gap2, var + doubted
    share = var / (said + var)
    return Weighed(known + share * gap, share * said, said, gap2, doubted)
