"""The motion so far: a Kalman filter whose velocity changes by accelerations that last a while."""

from __future__ import annotations

import math

import numpy as np

from slams.jit import records
from slams.motion import model_kernels
from slams.motion import velocity_kernels as kernels
from slams.motion.chord import UNKNOWN, Chord
from slams.motion.params import MotionParams
from slams.motion.trust import Expected, laws
from slams.motion.wheels import Gyro, Wheels


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
        self._over, self._laws = records(1, kernels.INTERVAL), laws(p)
        self.forget()

    def going_on(self, dt: float, expected: Expected) -> None:
        """Set the step if the motion so far goes on; one from before a long break means nothing."""
        if dt > self._p.velocity_time:
            self.forget()
        if dt > 0.0:
            time = self._p.acceleration_time
            kernels.going_on(self.axes, self._over, expected.rows, dt, time)
        else:  # no time is known: neither is a velocity
            self._over["dt"] = 0.0
            expected.set((0.0, 0.0, 0.0), self.axes["unknown"])

    def learn(self, step: Chord, match: Chord, last: Chord, wheels: Wheels, gyro: Gyro) -> None:
        """Learn from a step that was found, with the variances of the matches at both its ends.

        So do wheels and gyro; where the matches tell nothing (inf) those tell the velocity.
        """
        by = (self.axes, self._over, wheels.numbers, gyro.numbers, self._laws)
        wheels.faults += model_kernels.learn(*by, tuple(step), tuple(match), tuple(last))

    def believe(self, step: Chord, wheels: Wheels, gyro: Gyro) -> None:
        """The step was as expected, for all that is known; wheels and gyro tell the velocity."""
        self.learn(step, UNKNOWN, UNKNOWN, wheels, gyro)

    def fade(self, dt: float) -> None:
        """Nothing confirmed the velocity: it means less."""
        keep = math.exp(-dt / self._p.velocity_time)
        self.axes["v"] *= keep
        self.axes["a"] *= keep

    def forget(self) -> None:
        """Begin anew: nothing is known but that robots are not fast."""
        for name in ("x", "v", "a", "xx", "xv", "xa", "va"):
            self.axes[name] = 0.0
        self.axes["vv"], self.axes["aa"] = self.axes["unknown"], self.axes["noise"]
