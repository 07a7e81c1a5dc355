"""What wheels and gyro say of a step, and how sure they are."""

from __future__ import annotations

import math

from slams.jit import records
from slams.motion import source_kernels as kernels
from slams.motion.params import MotionParams
from slams.motion.reading_kernels import READING
from slams.motion.scale_kernels import BIAS, PRIOR, VEER
from slams.motion.trust import Expected, laws
from slams.types import Records, Scan

HEARD = (kernels.GOOD, kernels.CONTRADICTED)  # words that tell of the step


class Wheels:
    """Odometry: the whole step.

    `heard` tells whether they had a last word (not none, and no leap), `contradicts` whether all
    else spoke against it; `numbers` (3,), ahead, aside and turn, are records of
    `source_kernels.SOURCE`. `used` and `faults` count scans.
    """

    def __init__(self, params: MotionParams) -> None:
        self.used = self.faults = 0
        self.heard = self.contradicts = False
        self.numbers = records(3, kernels.SOURCE)
        self.numbers["variance"], self.numbers["scale"] = math.inf, kernels.LEAST
        self.numbers["unsure"] = PRIOR**2, 0.0, VEER**2
        self.numbers["most"] = params.top_speed**2
        self.numbers["most"][-1] = params.top_turn_rate**2
        self._reads = records(1, READING)
        self._listens, self._laws, self._time = params.wheels, laws(params), params.doubt_time

    def add(self, before: Scan, scan: Scan, known: Expected) -> None:
        """Add to what is known of the step what the wheels say; a leap is not heard."""
        last, now, word = before.odometry, scan.odometry, kernels.NONE
        if self._listens and last is not None and now is not None:
            row, dt, reach = known.rows, known.dt, known.reach
            by = (self.numbers, self._reads, self._laws)
            word = kernels.hear_wheels(*by, row, last, now, dt, reach)
        elif self.heard:
            silence(self.numbers)
            self._reads["known"] = 0.0
        self.heard = word in HEARD
        self.contradicts = word in (kernels.LEAP, kernels.CONTRADICTED)
        self.used += self.heard
        self.faults += word == kernels.LEAP

    def fade(self, dt: float) -> None:
        """There was no match to compare with."""
        fade(self.numbers, self._time, dt)


class Gyro:
    """The turn by the gyro; `used` counts scans.

    `heard` tells whether it had a last word; `numbers` (1,) is a record of `source_kernels.SOURCE`.
    """

    def __init__(self, params: MotionParams) -> None:
        self.used = 0
        self.heard = False
        self.numbers = records(1, kernels.SOURCE)
        self.numbers["variance"], self.numbers["most"] = math.inf, params.top_turn_rate**2
        self.numbers["unsure"] = BIAS**2
        self._listens, self._laws, self._time = params.gyro, laws(params), params.doubt_time

    def add(self, before: Scan, scan: Scan, known: Expected) -> None:
        """Add to what is known of the step what the gyro says; a leap is not heard."""
        turn, word = gyro_turn(before, scan) if self._listens else None, kernels.NONE
        if turn is not None:
            row, dt, reach = known.rows, known.dt, known.reach
            word = kernels.hear_gyro(self.numbers, self._laws, row, turn, dt, reach)
        elif self.heard:
            silence(self.numbers)
        self.heard = word == kernels.GOOD
        self.used += self.heard

    def fade(self, dt: float) -> None:
        """There was no match to compare with."""
        fade(self.numbers, self._time, dt)


def silence(numbers: Records) -> None:
    """The source says nothing."""
    numbers["variance"], numbers["doubted"] = math.inf, 0.0


def fade(numbers: Records, time: float, dt: float) -> None:
    """Nothing contradicted the source for `dt` [s]: its doubt fades in `time` [s]."""
    numbers["doubt"] *= math.exp(-2.0 * dt / time)


def gyro_turn(before: Scan, scan: Scan) -> float | None:
    """The turn [rad] by the gyro; None where a scan has none or it is not finite."""
    if before.yaw is None or scan.yaw is None or not math.isfinite(scan.yaw - before.yaw):
        return None
    return math.remainder(scan.yaw - before.yaw, 2.0 * math.pi)
