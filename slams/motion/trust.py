"""What no robot can do, and how far a source of motion is still believed."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.motion.chord import Chord
from slams.motion.params import MotionParams

USUAL = 0.455  # median of a squared error in units of its variance
LEAST, WIDEST = 0.5, 1e4  # times the variance that is said
CAREFUL = 0.3  # of what was learned counts: up to three times may be chance


class Expected(NamedTuple):
    """A step as far as it is known: its means and variances.

    `dt` [s] is the interval, `reach` [s] the time in which to judge what is possible (longer
    where stamps are too close together). `turn_measured`: a gyro tells the turn.
    """

    step: Chord
    variance: Chord
    dt: float
    reach: float
    turn_measured: bool = False


class Limits:
    """Speeds and accelerations that no robot has."""

    def __init__(self, params: MotionParams) -> None:
        self._p = params

    def allow(self, ahead: float, aside: float, turn: float, seconds: float) -> bool:
        """Whether a robot can go that far [m, rad] in so many seconds; if they are known."""
        p = self._p
        if seconds <= 0.0:
            return True
        far = math.hypot(ahead, aside) > p.top_speed * seconds + p.leap
        return not far and abs(turn) <= p.top_turn_rate * seconds + p.leap

    def allow_turn(self, turn: float, expected: Expected) -> bool:
        """Whether a robot that was expected to turn otherwise can turn so."""
        p, seconds = self._p, expected.reach
        change = abs(turn - expected.step.turn)
        doubt = p.doubt * math.sqrt(expected.variance.turn)
        possible = p.top_turn_acceleration * seconds * seconds + p.leap
        return change <= possible + doubt and self.allow(0.0, 0.0, turn, seconds)

    def allow_step(self, step: Chord, expected: Expected) -> bool:
        """Whether a robot that was expected elsewhere can have made this step."""
        p, seconds = self._p, expected.reach
        change = math.hypot(step.ahead - expected.step.ahead, step.aside - expected.step.aside)
        doubt = p.doubt * math.sqrt(expected.variance.ahead + expected.variance.aside)
        if change > p.top_acceleration * seconds * seconds + p.leap + doubt:
            return False
        return self.allow(*step, seconds) and self.allow_turn(step.turn, expected)


class Doubt:
    """How wrong a source was of late, as the variance of a velocity that it does not see.

    A stalled wheel errs by the robot's velocity, whatever it counts: so does this. Only what
    contradicts a match by more than `doubt` deviations counts. It fades: no source is thrown away
    for good.
    """

    def __init__(self, params: MotionParams, most: float) -> None:
        self.variance = 0.0
        self._contradiction = params.doubt**2
        self._time = params.doubt_time
        self._most = most * most

    def learn(self, error: float, variance: float, dt: float) -> bool:
        """Compare with what a match found; whether the two contradict each other."""
        if error * error <= self._contradiction * variance:
            self.fade(dt)
            return False
        speed = min(error * error / (dt * dt), self._most)
        self.variance += (1.0 - math.exp(-dt / self._time)) * (speed - self.variance)
        return True

    def fade(self, dt: float) -> None:
        """The source agreed, or there was nothing to compare with."""
        self.variance *= math.exp(-2.0 * dt / self._time)


class Scale:
    """How many times the variance of a source is what is said of it, as matches find it; 1 or more.

    Its logarithm moves up where an error is beyond what is usual and down where it is not, each
    time by the same, so a fault of a second does not spoil it: like a median, not a mean.
    """

    def __init__(self, params: MotionParams) -> None:
        self._learned = LEAST
        self._time = params.scale_time

    @property
    def variance(self) -> float:
        """Times the variance that is said."""
        return max(CAREFUL * self._learned, 1.0)

    def learn(self, error: float, own: float, match: float, dt: float) -> None:
        """Compare with a match of variance `match`; `own` is the source's, scaled by `variance`."""
        beyond = error * error > USUAL * (own + match)
        change = math.exp(min(dt, 1.0) / self._time)
        self._learned *= change if beyond else 1.0 / change
        self._learned = min(max(self._learned, LEAST), WIDEST)
