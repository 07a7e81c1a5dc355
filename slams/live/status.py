"""What the terminal shows of a live run: one line that is written over, sentences above it."""

from __future__ import annotations

import math
import sys
import time

from slams.live.node import Node

CLEAR = "\r\x1b[K"


class Terminal:
    """Notes on stderr; on a terminal a status line, too, unless `quiet`."""

    def __init__(self, program: str, quiet: bool) -> None:
        self._program, self._quiet = program, quiet
        self._line = sys.stderr.isatty() and not quiet
        self._before = (time.monotonic(), 0)

    def say(self, sentence: str) -> None:
        """Tell something the user should know."""
        if not self._quiet:
            clear = CLEAR if self._line else ""
            sys.stderr.write(f"{clear}{self._program}: note: {sentence}\n")
            sys.stderr.flush()

    def status(self, node: Node) -> None:
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
        where = f"x {x:.2f} y {y:.2f} m, {math.degrees(theta):.0f} deg"
        explained = "" if math.isnan(estimate.explained) else f", map {estimate.explained:.0%}"
        if not estimate.found:
            return f"{node.drive.counts['sought']} scans, sought in the map; {where}?{explained}"
        return (
            f"{scans} scans, {rate:.1f}/s, {node.inbox.dropped} left out, {len(node.inbox)} wait; "
            f"{where}; {estimate.state} {estimate.quality:.2f}{explained}; "
            f"{1e3 * node.drive.delays[-1] if node.drive.delays else math.nan:.1f} ms"
        )
