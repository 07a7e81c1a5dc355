"""What goes wrong on a robot while it drives, told in a sentence as it begins and as it ends."""

from __future__ import annotations

import time
from collections.abc import Callable

from slams.live.inbox import Inbox
from slams.live.slam import LiveSlam
from slams.live.wire import Wire

SILENT = 2.0  # [s] without a scan that are told
AGAIN = 10.0  # [s] until the same is told again
JUMP = 5.0  # [s] that stamps may run ahead of this machine's clock between two scans

Say = Callable[[str], None]


class Watch:
    """Looks at laser, queue, clock and publishers.

    Args:
        topic: of the scans.
        say: what tells the user a sentence.
    """

    def __init__(self, topic: str, inbox: Inbox, live: LiveSlam, wire: Wire, say: Say) -> None:
        self._topic, self._inbox, self._live, self._wire = topic, inbox, live, wire
        self._say = say
        self._silent_since: float | None = None
        self._told: dict[str, tuple[float, int]] = {}
        self._clock: tuple[float, float] | None = None
        self._several = False

    def look(self) -> None:
        """Tell what has changed; to be called about once a second."""
        self._silence()
        self._several_lasers()
        self._more(
            "dropped",
            self._inbox.dropped,
            "scans left out so far: the algorithm is slower than the laser; the newest are used",
        )
        report = self._live.report()
        self._more("back", report["clock_set_back"], "times the clock was set back; it is followed")
        self._more(
            "repeated",
            report["repeated"],
            "scans have the stamp of the one before and are left out: does the driver stamp them?",
        )
        self._more("late", report["late"], "scans came late, after newer ones, and are left out")

    def count(self, kind: str, number: int, sentence: str) -> None:
        """Tell how often something happened, when it is more often than told before."""
        self._more(kind, number, sentence)

    def stamped(self, t: float) -> None:
        """Notice a scan's stamp that has jumped ahead of the time that has passed."""
        now = time.monotonic()
        if self._clock is not None:
            ahead = (t - self._clock[0]) - (now - self._clock[1])
            if ahead > JUMP:
                self._say(f"the clock of {self._topic} jumped ahead by {ahead:.1f} s")
        self._clock = (t, now)

    def _silence(self) -> None:
        heard = self._inbox.heard
        if heard is None:
            return
        silent = time.monotonic() - heard > SILENT
        if silent and self._silent_since is None:
            self._silent_since = heard
            self._say(f"no scan on {self._topic} for {SILENT:g} s: is the laser unplugged?")
        elif not silent and self._silent_since is not None:
            away = heard - self._silent_since
            self._silent_since = None
            self._say(f"scans on {self._topic} are back after about {away:.0f} s")

    def _several_lasers(self) -> None:
        several = self._wire.writers(self._topic) > 1
        if several and not self._several:
            self._say(
                f"{self._wire.writers(self._topic)} publishers on {self._topic}: one map is made "
                "of what is one laser's; --scan-topic takes another topic"
            )
        self._several = several

    def _more(self, kind: str, number: int, sentence: str) -> None:
        at, told = self._told.get(kind, (-AGAIN, 0))
        if number > told and time.monotonic() - at >= AGAIN:
            self._told[kind] = (time.monotonic(), number)
            self._say(f"{number} {sentence}")
