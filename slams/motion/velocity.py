"""The motion so far: a Kalman filter whose velocity changes by accelerations that last a while."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.motion.chord import FLOOR

SHORT = 0.01  # share of an acceleration's time below which the series is more exact
PLAIN = 9.0  # a squared, normalized surprise that is no chance when it comes twice
SURPRISE = 50.0  # most that one squared, normalized surprise counts when accelerations are learned
LEAST, MOST = 0.1, 1e5  # bounds of the learned variance, times the one to begin with


class Interval(NamedTuple):
    """What an interval of `dt` [s] does to a motion with accelerations of variance 1.

    The model is Singer's (1970): x' = v, v' = a, a' = -a / time + white noise. `xa`, `va`, `aa`
    are what an acceleration at the start does to x, v and itself, `q..` the noise it adds.
    """

    dt: float
    xa: float
    va: float
    aa: float
    qxx: float
    qxv: float
    qxa: float
    qvv: float
    qva: float
    qaa: float


def interval(dt: float, time: float) -> Interval:
    """Singer's transition and noise in closed form, for accelerations that last `time` [s]."""
    b = dt / time
    e = math.exp(-b)
    xa, va = time * time * (b - 1.0 + e), time * (1.0 - e)
    if b < SHORT:
        q = (b**5 / 10, b**4 / 4, b**3 / 3, b**3 * 2 / 3, b**2, 2 * b)
    else:
        q = (
            1 - e * e + 2 * b + 2 * b**3 / 3 - 2 * b * b - 4 * b * e,
            e * e + 1 - 2 * e + 2 * b * e - 2 * b + b * b,
            1 - e * e - 2 * b * e,
            4 * e - 3 - e * e + 2 * b,
            e * e + 1 - 2 * e,
            1 - e * e,
        )
    scale = (time**4, time**3, time**2, time**2, time, 1.0)
    return Interval(dt, xa, va, e, *(one * by for one, by in zip(q, scale, strict=True)))


class Velocity:
    """Velocity along one axis (ahead, aside or turn), from the steps that were found.

    The state is (x, v, a): x is how far the robot truly is from the pose last reported, so that
    the error of one match is not taken for motion by the next. `noise` is the variance of the
    acceleration, learned: it grows when steps surprise more than they should, and shrinks when
    less.
    """

    def __init__(self, acceleration: float, unknown: float, learn_time: float) -> None:
        self.noise = acceleration * acceleration
        self._first = self.noise
        self._unknown = unknown * unknown
        self._learn_time = learn_time
        self._missed_by = 0.0
        self.forget()

    def forget(self) -> None:
        """Begin anew: nothing is known but that robots are not fast."""
        self.x = self.v = self.a = 0.0
        self.xx = self.xv = self.xa = self.va = 0.0
        self.vv, self.aa = self._unknown, self.noise

    def step(self, over: Interval) -> tuple[float, float]:
        """Step to be expected over an interval, and its variance."""
        dt, c = over.dt, over.xa
        variance = dt * dt * self.vv + 2.0 * dt * c * self.va + c * c * self.aa
        return dt * self.v + c * self.a, variance + self.noise * over.qxx + FLOOR

    def pass_over(self, over: Interval) -> None:
        """Let the interval pass: x' = F x, P' = F P F^T + Q."""
        dt, c, d, e = over.dt, over.xa, over.va, over.aa
        x, v, a, q = self.x, self.v, self.a, self.noise
        self.x, self.v, self.a = x + dt * v + c * a, v + d * a, e * a
        xv = self.xv + dt * self.vv + c * self.va
        xa = self.xa + dt * self.va + c * self.aa
        va, aa = self.va + d * self.aa, self.aa
        self.xx += dt * (self.xv + xv) + c * (self.xa + xa) + q * over.qxx
        self.xv = xv + d * xa + q * over.qxv
        self.vv += d * (self.va + va) + q * over.qvv
        self.xa, self.va = e * xa + q * over.qxa, e * va + q * over.qva
        self.aa = e * e * aa + q * over.qaa

    def contradict(self, variance: float, dt: float) -> None:
        """Wheels spoke against the step of the last `dt` [s]: it may have been as wrong as they."""
        self.xx += variance
        self.xv += variance / dt
        self.vv += variance / (dt * dt)

    def correct(self, found: float, variance: float, dt: float) -> None:
        """The robot was found `found` from the pose last reported, with a variance."""
        s, y = self.xx + variance, found - self.x
        self._learn(y, y * y / s, self.xx / s, dt)
        self._update(y, s, self.xx, self.xv, self.xa)

    def correct_velocity(self, velocity: float, variance: float, dt: float) -> None:
        """The mean velocity of the last `dt` [s], with a variance, by wheels or gyro."""
        lag = 0.25 * dt * dt * self.noise  # an acceleration's share since half way
        s = self.vv + variance + lag
        self._update(velocity - self.v, s, self.xv, self.vv, self.va)

    def _learn(self, y: float, surprise: float, own: float, dt: float) -> None:
        """Learn the accelerations from a surprise y; `own`: what share of it is not the match's."""
        lags = surprise > PLAIN and y * self._missed_by > 0.0  # the second time to this side
        self._missed_by = y if surprise > PLAIN else 0.0
        growth = own * min(dt / self._learn_time, 1.0 / SURPRISE)
        growth = (1.0 / SURPRISE if lags else growth) * (min(surprise, SURPRISE) - 1.0)
        noise = self.noise * math.exp(growth)
        self.noise = min(max(noise, LEAST * self._first), MOST * self._first)

    def _update(self, y: float, s: float, px: float, pv: float, pa: float) -> None:
        """Kalman update with a surprise `y` of variance `s`; p. its covariance with the state."""
        kx, kv, ka = px / s, pv / s, pa / s
        self.x, self.v, self.a = self.x + kx * y, self.v + kv * y, self.a + ka * y
        self.xx, self.xv, self.xa = self.xx - kx * px, self.xv - kx * pv, self.xa - kx * pa
        self.vv, self.va, self.aa = self.vv - kv * pv, self.va - kv * pa, self.aa - ka * pa

    def report(self, step: float) -> None:
        """The pose is now reported `step` further."""
        self.x -= step

    def fade(self, keep: float) -> None:
        """Nothing confirmed the velocity: it means less."""
        self.v *= keep
        self.a *= keep
