"""The time between scans, where stamps are not always to be trusted."""

from __future__ import annotations

import math

from slams.motion.chord import Chord

SHORTEST = 1e-6  # s; a shorter interval is none
BREAK = 3600.0  # s; after a longer one no more is unknown, and sums of variances stay exact
LONGEST = 10.0  # usual intervals; a longer one is a break, however ragged the stamps
BETTER = 0.8  # times the error by stamps, below which the usual interval predicts better
MEMORY = 5.0  # s, of both errors
USUAL = 30.0  # s, of the usual interval


class Clock:
    """Interval between scans [s]: the stamps', or the usual one where that predicts better.

    Recorders stamp scans when they get round to it (in Intel's log stamps even go backwards 265
    times): then a step as long as the last one predicts better than a velocity. Which of the two
    did better of late decides.
    """

    def __init__(self) -> None:
        self.usual = 0.0
        self._scans = 0
        self._last: Chord | None = None
        self._last_stamped = self._stamped = 0.0
        self._error_by_stamps = self._error_by_count = 0.0

    @property
    def ragged(self) -> bool:
        """Whether the stamps predict worse than none."""
        return self._error_by_count < BETTER * self._error_by_stamps

    def elapsed(self, stamped: float) -> float:
        """Time to reckon with, for an interval by the stamps; never negative."""
        if not math.isfinite(stamped) or abs(stamped) < SHORTEST:
            stamped = 0.0
        stamped = min(stamped, BREAK)
        self._scans += 1
        share = max(1.0 / self._scans, 1.0 - math.exp(-self.usual / USUAL))
        usual = self.usual = max(self.usual + share * (stamped - self.usual), 0.0)
        self._stamped = stamped if stamped > 0.0 else usual
        if self.ragged and self._stamped < LONGEST * usual:
            return usual
        return self._stamped

    def found(self, step: Chord) -> None:
        """Compare both predictions with the step that was found."""
        last, before = self._last, self._last_stamped
        if last is not None and before > 0.0:
            ratio, share = min(self._stamped / before, LONGEST), self._share()
            by_stamps = math.hypot(step.ahead - ratio * last.ahead, step.aside - ratio * last.aside)
            by_count = math.hypot(step.ahead - last.ahead, step.aside - last.aside)
            self._error_by_stamps += share * (by_stamps - self._error_by_stamps)
            self._error_by_count += share * (by_count - self._error_by_count)
        self._last, self._last_stamped = step, self._stamped

    def _share(self) -> float:
        return 1.0 - math.exp(-self.usual / MEMORY)
