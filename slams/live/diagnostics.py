"""Diagnostics of a node for its user, and a status line on a terminal."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from slams import cli
from slams.live.scans import SCAN_TIMEOUT

if TYPE_CHECKING:
    from slams.live.node import Node

REPORT_PERIOD = 10.0  # s before the same is reported again
CLEAR_LINE = "\r\x1b[K"
COUNT_MESSAGES = {  # by key of `Node.report`: reported when the count has grown
    "dropped": "scans left out so far: the algorithm is slower than the laser; the newest are used",
    "clock_set_back": "times the clock was set back; the node follows it",
    "repeated": "scans have the stamp of the previous scan and are left out: does the driver stamp "
    "them?",
    "late": "scans arrived after newer ones and are left out",
    "no_odometry": "scans so far had no odometry in time (--wait sets how long they wait)",
    "other_frame": "scans of another frame than the first are left out: two lasers on one topic",
    "unplaced": "scans of a further laser are left out: tf has no fixed transform to its frame",
    "unsent": "messages were not accepted by the network in time",
}

Notify = Callable[[str], None]


class Diagnostics:
    """Reports a problem at most once per `REPORT_PERIOD`, and an assumption once.

    Args:
        notify: shows a sentence to the user.
    """

    def __init__(self, notify: Notify) -> None:
        self._notify = notify
        self._reported_at: dict[str, float] = {}  # s, by subject
        self._reported_counts: dict[str, int] = {}

    def check(self, report: Mapping[str, Any], last_scans: Mapping[str, float]) -> None:
        """Report missing scans and counts that have grown; to be called about once a second.

        Args:
            report: the node's counts.
            last_scans: by topic, when the last scan was received [s, monotonic].
        """
        for topic, last_scan in last_scans.items():
            since = time.monotonic() - last_scan
            if since > SCAN_TIMEOUT:
                text = f"no scan on {topic} for {since:.0f} s: is the laser unplugged?"
                self._report(topic, text, REPORT_PERIOD)
        for name, sentence in COUNT_MESSAGES.items():
            self.count(name, report[name], sentence)

    def count(self, name: str, number: int, sentence: str) -> None:
        """Report a count that is larger than the one reported before."""
        is_more = number > self._reported_counts.get(name, 0)
        if is_more and self._report(name, f"{number} {sentence}", REPORT_PERIOD):
            self._reported_counts[name] = number

    def note(self, sentence: str) -> None:
        """Report an assumption, once."""
        self._report(sentence, sentence, math.inf)

    def _report(self, subject: str, sentence: str, period: float) -> bool:
        """Report a sentence, unless its subject was reported in the last `period` [s]."""
        now = time.monotonic()
        is_due = now - self._reported_at.get(subject, -math.inf) >= period
        if is_due:
            self._reported_at[subject] = now
            self._notify(sentence)
        return is_due


class Terminal:
    """Notes on stderr, which may be closed, and on a terminal a status line, unless quiet."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self._arguments = arguments
        self._line = sys.stderr.isatty() and not arguments.quiet

    def notify(self, sentence: str) -> None:
        """Show a sentence."""
        with suppress(OSError):
            sys.stderr.write(CLEAR_LINE if self._line else "")
            cli.show_notes(self._arguments, [sentence])

    def show_status(self, node: Node) -> None:
        """Show the number of scans, the pose and the state."""
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
        with suppress(OSError):
            sys.stderr.write(f"{CLEAR_LINE}{text}")
            sys.stderr.flush()

    def end(self) -> None:
        """Finish the status line."""
        with suppress(OSError):
            sys.stderr.write("\n" if self._line else "")
