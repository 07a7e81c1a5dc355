"""Patience: how often a search that found nothing is repeated."""

from __future__ import annotations

import math


class Patience:
    """A pause after each try that came to nothing, twice as long every time.

    It is told in seconds, not in scans: whatever their rate and however long it lasts, tries of c
    [s] of CPU come to cost no more than the share c / longest of a core.

    Args:
        first: the shortest pause [s].
        longest: the longest [s].
    """

    def __init__(self, first: float, longest: float) -> None:
        self._first, self._longest = first, longest
        self._pause = self._rest = 0.0

    def wait(self, dt: float, quiet: bool = False) -> None:
        """Let `dt` [s] pass; in a `quiet` scan nothing had to be tried, and pauses get shorter."""
        self._rest -= dt
        if quiet:
            shorter = self._pause * math.exp(-dt / self._longest)
            self._rest, self._pause = self._rest - self._pause + shorter, shorter

    @property
    def over(self) -> bool:
        """Whether it is time to try."""
        return self._rest <= 0.0

    def tried(self) -> None:
        """In vain: pause, twice as long as the last time."""
        self._pause = min(max(2.0 * self._pause, self._first), self._longest)
        self._rest = self._pause

    def again(self, seconds: float) -> None:
        """A try is not at its end: it goes on after some seconds."""
        self._rest = seconds

    def forget(self) -> None:
        """Begin anew: something was found, or nothing has to be."""
        self._pause = self._rest = 0.0
