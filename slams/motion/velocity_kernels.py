"""Kernels of the motion so far: a Kalman filter for each axis (ahead, aside, turn).

The model is Singer's (1970): x' = v, v' = a, a' = -a / time + white noise. Records of
`AXIS` have a row for each axis; of all steps and velocities the units are [m], [rad], [s].
"""

from __future__ import annotations

import math
from typing import Any

from slams.jit import njit
from slams.types import Records

FLOOR = 2.5e-13  # m^2, rad^2: half a micrometer, rounding of what is logged; no variance is less
PLAIN = 9.0  # a squared, normalized surprise that is no chance when it comes twice
SURPRISE = 50.0  # most that one squared, normalized surprise counts when accelerations are learned
SHORT = 0.01  # share of an acceleration's time below which the series is more exact
LEAST, MOST = 0.1, 1e5  # bounds of the learned variance, times the one to begin with
TURN = 2  # row of the turn, after ahead and aside

# The state (x, v, a), where x is how far the robot truly is from the pose last reported, and its
# covariance; `noise`, the variance of the acceleration, and the `first` one; `unknown`, that of a
# velocity of which nothing is known; `learn_time` [s] of the noise; `missed_by`, the last great
# surprise
AXIS = "x v a xx xv xa vv va aa noise first unknown learn_time missed_by"
# What an interval of `dt` [s] does to a motion with accelerations of variance 1: `xa`, `va`, `aa`
# are what an acceleration at the start does to x, v and itself, `q..` the noise it adds
INTERVAL = "dt xa va aa qxx qxv qxa qvv qva qaa"
# A step as far as it is known, a row for each axis: its mean and variance; what is `known` without
# the wheels, and whether it was `measured` (1) by the gyro
EXPECTED = "step variance known measured"


@njit(inner=True, borrows=True)
def interval(overs: Records, dt: float, time: float) -> None:
    """Singer's transition and noise in closed form over `dt` [s], if accelerations last `time` [s].

    ours: below a hundredth of that time the first term of the series is more exact.
    """
    over, b = overs[0], dt / time
    e, bb, bbb = math.exp(-b), b * b, b * b * b
    over.dt, over.aa = dt, e
    over.xa, over.va = time * time * (b - 1.0 + e), time * (1.0 - e)
    if b < SHORT:
        over.qxx, over.qxv, over.qxa = bbb * bb / 10.0, bb * bb / 4.0, bbb / 3.0
        over.qvv, over.qva, over.qaa = bbb * 2.0 / 3.0, bb, 2.0 * b
    else:
        over.qxx = 1.0 - e * e + 2.0 * b + 2.0 * bbb / 3.0 - 2.0 * bb - 4.0 * b * e
        over.qxv = e * e + 1.0 - 2.0 * e + 2.0 * b * e - 2.0 * b + bb
        over.qxa = 1.0 - e * e - 2.0 * b * e
        over.qvv = 4.0 * e - 3.0 - e * e + 2.0 * b
        over.qva = e * e + 1.0 - 2.0 * e
        over.qaa = 1.0 - e * e
    over.qxx *= time**4
    over.qxv *= time**3
    over.qxa *= time**2
    over.qvv *= time**2
    over.qva *= time


@njit(inner=True, borrows=True)
def step(axis: Any, over: Any) -> tuple[float, float]:
    """Step to be expected over an interval, and its variance: the first row of F and of Q. ours."""
    dt, c = over.dt, over.xa
    variance = dt * dt * axis.vv + 2.0 * dt * c * axis.va + c * c * axis.aa
    return dt * axis.v + c * axis.a, variance + axis.noise * over.qxx + FLOOR


@njit(borrows=True)
def going_on(axes: Records, overs: Records, expected: Records, dt: float, time: float) -> None:
    """Into `expected` the step in `dt` [s] if the motion so far goes on. ours.

    `time` [s] is how long accelerations last; `overs` is set.

    There is no arc where speed or turn change on the way: white accelerations bend it by 1 / 40 of
    their variance, which is half of what the step has; the rest is the rate's.
    """
    interval(overs, dt, time)
    for i in range(len(axes)):
        expected[i].step, expected[i].variance = step(axes[i], overs[0])
    ahead, aside, turn = expected[0], expected[1], expected[TURN]
    bent = ahead.step**2 * turn.variance + turn.step**2 * ahead.variance
    bent += ahead.variance * turn.variance
    aside.variance += bent / 80.0
    for i in range(len(axes)):
        expected[i].known, expected[i].measured = expected[i].step, 0.0


@njit(inner=True, borrows=True)
def pass_over(axis: Any, over: Any) -> None:
    """Let the interval pass: x' = F x, P' = F P F^T + Q. ours."""
    dt, c, d, e = over.dt, over.xa, over.va, over.aa
    x, v, a, q = axis.x, axis.v, axis.a, axis.noise
    axis.x, axis.v, axis.a = x + dt * v + c * a, v + d * a, e * a
    xv = axis.xv + dt * axis.vv + c * axis.va
    xa = axis.xa + dt * axis.va + c * axis.aa
    va, aa = axis.va + d * axis.aa, axis.aa
    axis.xx += dt * (axis.xv + xv) + c * (axis.xa + xa) + q * over.qxx
    axis.xv = xv + d * xa + q * over.qxv
    axis.vv += d * (axis.va + va) + q * over.qvv
    axis.xa, axis.va = e * xa + q * over.qxa, e * va + q * over.qva
    axis.aa = e * e * aa + q * over.qaa


@njit(inner=True, borrows=True)
def contradict(axis: Any, variance: float, dt: float) -> None:
    """Wheels spoke against the last `dt` [s]: the step may have been as wrong as they. ours."""
    axis.xx += variance
    axis.xv += variance / dt
    axis.vv += variance / (dt * dt)


@njit(inner=True, borrows=True)
def correct(axis: Any, found: float, variance: float, dt: float) -> None:
    """The robot was found `found` from the pose last reported, with a variance. ours."""
    s, y = axis.xx + variance, found - axis.x
    learn(axis, y, y * y / s, axis.xx / s, min(dt / axis.learn_time, 1.0 / SURPRISE))
    update(axis, y, s, axis.xx, axis.xv, axis.xa)


@njit(inner=True, borrows=True)
def correct_velocity(axis: Any, velocity: float, variance: float, dt: float) -> None:
    """The mean velocity of the last `dt` [s], with a variance, by wheels or gyro. ours."""
    lag = 0.25 * dt * dt * axis.noise  # an acceleration's share since half way
    s = axis.vv + variance + lag
    update(axis, velocity - axis.v, s, axis.xv, axis.vv, axis.va)


@njit(inner=True, borrows=True)
def learn(axis: Any, y: float, surprise: float, own: float, share: float) -> None:
    """Learn the accelerations from a surprise y; `own`: what share of it is not the match's. ours.

    The noise grows when steps surprise more than they should, and shrinks when less.
    """
    lags = surprise > PLAIN and y * axis.missed_by > 0.0  # the second time to this side
    axis.missed_by = y if surprise > PLAIN else 0.0
    growth = own * share
    growth = (1.0 / SURPRISE if lags else growth) * (min(surprise, SURPRISE) - 1.0)
    noise = axis.noise * math.exp(growth)
    axis.noise = min(max(noise, LEAST * axis.first), MOST * axis.first)


@njit(inner=True, borrows=True)
def update(axis: Any, y: float, s: float, px: float, pv: float, pa: float) -> None:
    """Kalman update with a surprise `y` of variance `s`; p. its covariance with the state. ours."""
    kx, kv, ka = px / s, pv / s, pa / s
    axis.x, axis.v, axis.a = axis.x + kx * y, axis.v + kv * y, axis.a + ka * y
    axis.xx, axis.xv, axis.xa = axis.xx - kx * px, axis.xv - kx * pv, axis.xa - kx * pa
    axis.vv, axis.va, axis.aa = axis.vv - kv * pv, axis.va - kv * pa, axis.aa - ka * pa
