"""The class of a degradation: name, levels, meaning and function."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slams.scanlog import ScanLog

if TYPE_CHECKING:
    from numpy.random import Generator

NEED_WORDS = {"truth": "truth at any scan", "odometry": "odometry", "gyro": "gyro"}


@dataclass(frozen=True)
class Degradation:
    """A degradation, called with a log, a level and, if it is random, a generator.

    Attributes:
        apply: pure function of log, level and, if it is random, a new generator.
        unit: of the level, "1" for a count.
        levels: from mild to severe, in the order of a sweep.
        low: minimum level.
        high: maximum level.
        whole: whether the level is a whole number.
        needs: required data of the log, of "truth", "odometry", "gyro".
    """

    apply: Callable[..., ScanLog]
    unit: str
    levels: tuple[float, ...]
    low: float
    high: float
    whole: bool = False
    needs: tuple[str, ...] = ()

    def __call__(self, log: ScanLog, level: float, rng: Generator | None = None) -> ScanLog:
        """The degraded log."""
        return self.apply(log, level, rng) if self.random else self.apply(log, level)

    @property
    def name(self) -> str:
        """The name on the command line: that of the function."""
        return self.apply.__name__.rstrip("_")

    @property
    def meaning(self) -> str:
        """The meaning of the level: the first line of the function's docstring."""
        line = (inspect.getdoc(self.apply) or "").partition("\n")[0]
        return line[:1].lower() + line[1:].rstrip(".")

    @property
    def random(self) -> bool:
        """Whether the seed affects the result."""
        return "rng" in inspect.signature(self.apply).parameters

    def checked(self, level: float | str) -> float:
        """The level as a number.

        Raises:
            ValueError: it is not a number, or out of bounds.
        """
        try:
            number = float(level)
        except ValueError:
            number = math.nan
        if not self.low <= number <= self.high or (self.whole and number % 1.0):
            unit = "" if self.unit == "1" else f" {self.unit}"
            kind = "a whole number from " if self.whole else ""
            bounds = f"{self.low:g} to {self.high:g}" if self.low < self.high else f"{self.low:g}"
            known = ", ".join(f"{one:g}" for one in self.levels)
            raise ValueError(
                f"{self.name}: got {level}, expected {kind}{bounds}{unit} ({self.meaning}),"
                f" for instance {known}"
            )
        return number

    def ordered(self, levels: Iterable[float]) -> tuple[float, ...]:
        """The different levels from mild to severe."""
        return tuple(sorted(set(levels), key=abs, reverse=self.levels[-1] < self.levels[0]))

    def lacks(self, log: ScanLog) -> str:
        """The missing data that this degradation needs, in words; empty if none."""
        return next((NEED_WORDS[need] for need in self.needs if not _has(log, need)), "")


def degradation(
    unit: str,
    levels: tuple[float, ...],
    low: float,
    high: float,
    *,
    whole: bool = False,
    needs: tuple[str, ...] = (),
) -> Callable[[Callable[..., ScanLog]], Degradation]:
    """Decorator that makes a function a `Degradation` with these attributes."""
    return lambda apply: Degradation(apply, unit, levels, low, high, whole, needs)


def _has(log: ScanLog, need: str) -> bool:
    if need == "truth":
        truth = log.truth_at(log.t)
        return truth is not None and bool(np.isfinite(truth).any())
    return (log.odom if need == "odometry" else log.yaw_rate) is not None
