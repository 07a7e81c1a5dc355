"""What one degradation is: its name, what its level means, and what it does to a log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slams.scanlog import ScanLog

if TYPE_CHECKING:
    from numpy.random import Generator

Apply = Callable[[ScanLog, float, "Generator"], ScanLog]

SAID = 3  # levels that a refusal names
LACKS = {
    "truth": "truth at any scan",
    "odometry": "odometry",
    "gyro": "gyro",
}


@dataclass(frozen=True)
class Degradation:
    """One way to degrade a log.

    Attributes:
        name: as on the command line, `noise=0.05`.
        unit: of the level, "1" for a count.
        meaning: what the level says, one line.
        levels: from mild to deadly, in the order in which a sweep raises them.
        apply: pure function of log, level and a fresh generator; `degrade` calls it.
        low: least level allowed.
        high: greatest level allowed.
        whole: the level is a whole number.
        needs: of "truth", "odometry", "gyro": a log without has nothing to degrade.
        random: the seed plays a part; without, two seeds give the same log.
    """

    name: str
    unit: str
    meaning: str
    levels: tuple[float, ...]
    apply: Apply
    low: float
    high: float
    whole: bool = False
    needs: tuple[str, ...] = ()
    random: bool = True

    def checked(self, level: float | str) -> float:
        """The level as a number.

        Raises:
            ValueError: it is none, or out of bounds; the sentence says what would be right.
        """
        try:
            number = float(level)
        except (TypeError, ValueError):
            raise ValueError(self._refusal(level, self.levels)) from None
        fits = self.low <= number <= self.high and not (self.whole and number % 1.0)
        if not fits:
            nearest = sorted(self.levels, key=lambda known: abs(known - number))[:SAID]
            raise ValueError(self._refusal(level, tuple(sorted(nearest))))
        return number

    def lacks(self, log: ScanLog) -> str:
        """What the log would need for this and does not have, in words; empty if nothing."""
        return next((LACKS[need] for need in self.needs if not _has(log, need)), "")

    def _refusal(self, level: object, nearest: tuple[float, ...]) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        kind = "a whole number from " if self.whole else ""
        bounds = f"{self.low:g} to {self.high:g}" if self.low < self.high else f"{self.low:g}"
        known = ", ".join(f"{one:g}" for one in nearest)
        return (
            f"{self.name}: got {level}, expected {kind}{bounds}{unit} ({self.meaning}),"
            f" for instance {known}"
        )


def _has(log: ScanLog, need: str) -> bool:
    if need == "truth":
        truth = log.truth_at(log.t)
        return truth is not None and bool(np.isfinite(truth).any())
    return (log.odom if need == "odometry" else log.yaw_rate) is not None
