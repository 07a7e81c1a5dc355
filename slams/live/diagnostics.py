"""Sentences about a node for its user, and a status line on a terminal."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from slams import cli

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
    """Reports what goes wrong, at most every `PERIOD`, and what is assumed, once.

    Args:
        say: what tells the user a sentence.
    """

    def __init__(self, say: Say) -> None:
        self._say = say
        self._said: dict[str, float] = {}  # [s] when, by what it is about
        self._numbers: dict[str, int] = {}

    def check(self, report: Mapping[str, Any], last_scans: Mapping[str, float]) -> None:
        """Report what has changed; to be called about once a second.

        Args:
            report: the node's counts.
            last_scans: when each laser's last one came [s], on this machine's clock, by topics.
        """
        for topic, last_scan in last_scans.items():
            silent = time.monotonic() - last_scan
            if silent > MAX_SILENCE:
                text = f"no scan on {topic} for {silent:.0f} s: is the laser unplugged?"
                self._tell(topic, text, PERIOD)
        for name, sentence in COUNTERS.items():
            self.count(name, report[name], sentence)

    def count(self, name: str, number: int, sentence: str) -> None:
        """Report how often something happened, when it is more often than reported before."""
        is_more = number > self._numbers.get(name, 0)
        if is_more and self._tell(name, f"{number} {sentence}", PERIOD):
            self._numbers[name] = number

    def note(self, sentence: str) -> None:
        """Report an assumption, once."""
        self._tell(sentence, sentence, math.inf)

    def _tell(self, about: str, sentence: str, period: float) -> bool:
        """Say a sentence, unless something about the same was said in the last `period` [s]."""
        now = time.monotonic()
        is_due = now - self._said.get(about, -math.inf) >= period
        if is_due:
            self._said[about] = now
            self._say(sentence)
        return is_due


class Terminal:
    """Notes on stderr; on a terminal a status line, too, unless the arguments say `quiet`."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self._arguments = arguments
        self._line = sys.stderr.isatty() and not arguments.quiet

    def say(self, sentence: str) -> None:
        """Show a sentence."""
        if self._line:
            sys.stderr.write(CLEAR)
        cli.show_notes(self._arguments, [sentence])

    def show_status(self, node: Node) -> None:
        """Show how many scans came, and where the robot is."""
        if not self._line:
            return
        text, estimate = "waiting for scans", node.live.last
        if estimate is not None:
            x, y, theta = estimate.pose
            explained = "" if math.isnan(estimate.explained) else f", map {estimate.explained:.0%}"
            text = (
                f"{len(node.drive.t)} scans, {node.scans.counts['dropped']} left out; "
                f"x {x:.2f} y {y:.2f} m, {math.degrees(theta):.0f} deg; "
                f"{estimate.state} {estimate.quality:.2f}{explained}"
            )
        sys.stderr.write(f"{CLEAR}{text}")
        sys.stderr.flush()

    def end(self) -> None:
        """Leave the status line."""
        if self._line:
            sys.stderr.write("\n")
