"""An IMU's attitude message by message, as `slams.formats.attitude` has it of a recording."""

from __future__ import annotations

import math

import numpy as np

from slams.formats.attitude import (
    GravityFilter,
    Inertial,
    roll_and_pitch,
    rotated,
    up_of,
    vertical_rates,
)
from slams.types import Floats

UNDECIDED = 0.5  # [s] in which an orientation changes, if it is measured: there is noise in it


class ImuAttitude:
    """Attitude and turn rate of the base from its IMU: by orientation, else gyro and accelerometer.

    An orientation that has not changed yet may be a placeholder: messages wait until it does, for a
    while; from then on those after it go by gyro and accelerometer, until it changes.

    Args:
        turned: (3, 3), from the IMU's axes to the base's.
    """

    def __init__(self, turned: Floats) -> None:
        self._turned, self._gravity = turned, GravityFilter()
        self._waiting: list[Inertial] = []
        self._first: Inertial | None = None
        self._oriented = False

    def push(self, measured: Inertial) -> list[tuple[float, float, float, float]]:
        """Take a message.

        Gives stamp [s], turn rate about the vertical [rad/s], roll and pitch [rad], nan where
        unknown, of the messages that wait no longer.
        """
        self._waiting.append(measured)
        first = self._first = self._first or measured
        if not self._oriented and math.isfinite(measured.orientation[0]):
            self._oriented = measured.orientation != first.orientation
            if not self._oriented and 0.0 <= measured.sent - first.sent < UNDECIDED:
                return []
        waiting, self._waiting = self._waiting, []
        return [self._taken(one) for one in waiting]

    def _taken(self, measured: Inertial) -> tuple[float, float, float, float]:
        if self._oriented:
            up = up_of(np.array([measured.orientation]))
        else:
            up = self._gravity.push(measured.sent, measured)[None]
        attitude = roll_and_pitch(rotated(up, self._turned))
        if np.isfinite(attitude).all():
            rate = vertical_rates(rotated(np.array([measured.rates]), self._turned), attitude)[0]
        else:
            rate = sum(map(float.__mul__, measured.rates, self._turned[2].tolist()))
        roll, pitch = attitude[0].tolist()
        return measured.sent, float(rate), roll, pitch
