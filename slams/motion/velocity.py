"""The motion so far: a Kalman filter whose velocity changes by accelerations that last a while."""

from __future__ import annotations

import math

import numpy as np

from slams.jit import records
from slams.motion import velocity_kernels as kernels
from slams.motion.chord import Chord
from slams.motion.params import MotionParams
from slams.motion.trust import Expected
from slams.motion.wheels import Gyro, Wheels
from slams.types import Records

SHORT = 0.01  # share of an acceleration's time below which the series is more exact
TICK = 1e-7  # s; stamps of an even rate differ by rounding


class Velocity:
    """Velocity ahead, aside and of the turn, from the steps that were found.

    The state of each is (x, v, a): x is how far the robot truly is from the pose last reported, so
    that the error of one match is not taken for motion by the next. `axes` (3,) are records of
    `velocity_kernels.AXIS`.
    """

    def __init__(self, params: MotionParams) -> None:
        p = self._p = params
        self.axes = records(3, kernels.AXIS)
        accelerations = np.array((p.acceleration, p.acceleration_aside, p.turn_acceleration))
        self.axes["noise"] = self.axes["first"] = accelerations**2
        tops = np.array((p.top_speed, p.top_speed, p.top_turn_rate))
        self.axes["unknown"] = (0.5 * tops) ** 2
        self.axes["learn_time"] = p.learn_time
        self._over = interval(0.0, p.acceleration_time)
        self._dt = 0.0
        kernels.forget(self.axes)

    def going_on(self, dt: float, expected: Expected) -> None:
        """Set the step if the motion so far goes on; one from before a long break means nothing."""
        if abs(dt - self._dt) > TICK:
            self._over, self._dt = interval(dt, self._p.acceleration_time), dt
        if dt > self._p.velocity_time:
            kernels.forget(self.axes)
        if dt > 0.0:
            kernels.going_on(self.axes, self._over, expected.rows)
        else:  # no time is known: neither is a velocity
            expected.set((0.0, 0.0, 0.0), self.axes["unknown"])

    def learn(self, step: Chord, match: Chord, wheels: Wheels, gyro: Gyro, dt: float) -> None:
        """Learn from a step in `dt` [s], found with the variances of a match; inf: it tells none.

        There wheels and gyro tell the velocity.
        """
        if dt > 0.0:
            args = (wheels.numbers, gyro.numbers, self._p.doubt, step, match, dt)
            kernels.learn_step(self.axes, self._over, *args)

    def fade(self, dt: float) -> None:
        """Nothing confirmed the velocity: it means less."""
        kernels.fade(self.axes, math.exp(-dt / self._p.velocity_time))


def interval(dt: float, time: float) -> Records:
    """Singer's transition and noise in closed form, for accelerations that last `time` [s].

    One row of `velocity_kernels.INTERVAL`.
    """
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
    over = records(1, kernels.INTERVAL)
    over[0] = (dt, xa, va, e, *(one * by for one, by in zip(q, scale, strict=True)))
    return over
