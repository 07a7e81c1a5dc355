"""Sentences about a node for its user, and a status line on a terminal."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slams.live.node import Node

MAX_SILENCE = 2.0  # [s] without a scan that are reported
PERIOD = 10.0  # [s] until the same is reported again
CLEAR = "\r\x1b[K"
COUNTERS = {  # of `Node.report`: reported when there are more than before
    "dropped": "scans left out so far: the algorithm is slower than the laser; the newest are used",
    "clock_set_back": "times the clock was set back; it is followed",
    "repeated": "scans have the stamp of the one before and are left out: does the driver stamp "
    "them?",
    "late": "scans came late, after newer ones, and are left out",
    "no_odometry": "scans so far without odometry in time (--wait is how long)",
    "other_frame": "scans of another frame than the first are left out: two lasers on one topic",
    "unplaced": "scans of a further laser are left out: tf has no fixed way from the base to it",
    "unsent": "messages were not taken by the network in time",
}

Say = Callable[[str], None]


class Diagnostics:
    """Reports what goes wrong, when it begins and ends, or once in a while.

    Args:
        say: what tells the user a sentence.
    """

    def __init__(self, say: Say) -> None:
        self._say = say
        self._silent_since: dict[str, float] = {}  # by topics
        self._reported: dict[str, tuple[float, int]] = {}
        self._notes: set[str] = set()

    def check(self, report: Mapping[str, Any], last_scans: Mapping[str, float]) -> None:
        """Report what has changed; to be called about once a second.

        Args:
            report: the node's counts.
            last_scans: when each laser's last one came [s], on this machine's clock, by topics.
        """
        for topic, last_scan in last_scans.items():
            silent = time.monotonic() - last_scan > MAX_SILENCE
            if silent and topic not in self._silent_since:
                self._silent_since[topic] = last_scan
                self._say(f"no scan on {topic} for {MAX_SILENCE:g} s: is the laser unplugged?")
            elif not silent and topic in self._silent_since:
                away = last_scan - self._silent_since.pop(topic)
                self._say(f"scans on {topic} are back after about {away:.0f} s")
        for name, sentence in COUNTERS.items():
            self.count(name, report[name], sentence)

    def count(self, name: str, number: int, sentence: str) -> None:
        """Report how often something happened, when it is more often than reported before."""
        at, before = self._reported.get(name, (-math.inf, 0))
        if number > before and time.monotonic() - at >= PERIOD:
            self._reported[name] = (time.monotonic(), number)
            self._say(f"{number} {sentence}")

    def note(self, sentence: str) -> None:
        """Report an assumption, once."""
        if sentence not in self._notes:
            self._notes.add(sentence)
            self._say(sentence)


class Terminal:
    """Notes on stderr; on a terminal a status line, too, unless `quiet`."""

    def __init__(self, program: str, quiet: bool) -> None:
        self._program, self._quiet = program, quiet
        self._line = sys.stderr.isatty() and not quiet
        self._before = (time.monotonic(), 0)

    def say(self, sentence: str) -> None:
        """Show a sentence."""
        if not self._quiet:
            clear = CLEAR if self._line else ""
            sys.stderr.write(f"{clear}{self._program}: note: {sentence}\n")
            sys.stderr.flush()

    def show_status(self, node: Node) -> None:
        """Show where the robot is."""
        if self._line:
            sys.stderr.write(f"{CLEAR}{self._text(node)}")
            sys.stderr.flush()

    def end(self) -> None:
        """Leave the status line."""
        if self._line:
            sys.stderr.write("\n")

    def _text(self, node: Node) -> str:
        now, scans = time.monotonic(), len(node.drive.t)
        rate = (scans - self._before[1]) / max(now - self._before[0], 1e-3)
        self._before = (now, scans)
        estimate = node.drive.estimate
        if estimate is None:
            return "waiting for scans"
        x, y, theta = estimate.pose
        dropped = node.scans.counts["dropped"]
        where = f"x {x:.2f} y {y:.2f} m, {math.degrees(theta):.0f} deg"
        explained = "" if math.isnan(estimate.explained) else f", map {estimate.explained:.0%}"
        if not estimate.found:
            return f"{node.drive.sought} scans, sought in the map; {where}?{explained}"
        return (
            f"{scans} scans, {rate:.1f}/s, {dropped} left out, {len(node.scans)} wait; "
            f"{where}; {estimate.state} {estimate.quality:.2f}{explained}; "
            f"{1e3 * node.drive.delays[-1] if node.drive.delays else math.nan:.1f} ms"
        )
