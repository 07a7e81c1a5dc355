"""Exponential backoff: how often a search that found nothing is repeated."""

from __future__ import annotations


class Backoff:
    """A pause after each failed try, twice as long every time, in seconds of the scans' stamps.

    Tries of c [s] of CPU come to cost at most the share c / longest of a core at any scan rate.

    Args:
        first: the shortest pause [s].
        longest: the longest pause [s].
    """

    def __init__(self, first: float, longest: float) -> None:
        self._first, self._longest = first, longest
        self._pause = self._rest = 0.0

    def wait(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self._rest -= dt

    @property
    def over(self) -> bool:
        """Whether the pause has ended."""
        return self._rest <= 0.0

    def tried(self) -> None:
        """Record a failed try: the next pause is twice as long as the last one."""
        self._pause = min(max(2.0 * self._pause, self._first), self._longest)
        self._rest = self._pause

    def forget(self) -> None:
        """Start again: something was found, or no search is needed."""
        self._pause = self._rest = 0.0
