"""Patience: how often a search that found nothing is repeated."""

from __future__ import annotations

import math


class Patience:
    """A pause after each try, longer every time, so that no place costs many times the usual.

    `first` and `longest` [s] bound the pause; quiet scans shorten it.
    """

    def __init__(self, first: float, longest: float) -> None:
        self._first, self._longest = first, longest
        self._pause = self._waited = 0.0

    def wait(self, dt: float, quiet: bool = False) -> None:
        """Let `dt` [s] pass; in a quiet scan nothing had to be tried."""
        self._waited += dt
        if quiet:
            self._pause *= math.exp(-dt / self._longest)

    @property
    def over(self) -> bool:
        """Whether it is time to try."""
        return self._waited >= self._pause

    def tried(self) -> None:
        """Rest, twice as long as the last time."""
        self._pause = min(max(2.0 * self._pause, self._first), self._longest)
        self._waited = 0.0
