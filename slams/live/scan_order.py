"""Scans of several lasers in the order of their stamps."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import NamedTuple

from slams.live.scans import Message

MAX_SILENCE = 2.0  # [s] without a scan of a laser; then no other laser's scan waits for one
EARLIEST = 0.75  # of its shortest interval: scans of a laser come by no more too early
SLOWER = 1.1  # by how much the shortest interval follows a longer one: scans can be lost


class Arrived(NamedTuple):
    """A scan, its topic, when its message came and when it was put in order [s, monotonic]."""

    message: Message
    topic: str
    at: float
    put_at: float


class ScanOrder:
    """Gives scans out by their stamps; those of a single laser as they come.

    A scan waits while another laser can still send an older one, by the stamp and the interval of
    that laser's last scans.

    Args:
        topics: of the lasers; of scans with one stamp the first topic's goes first.
        wait: for an older scan at most [s].
    """

    def __init__(self, topics: Sequence[str], wait: float) -> None:
        self._topics, self._wait = tuple(topics), wait
        self._waiting: list[Arrived] = []
        self._last: dict[str, Arrived] = {}
        self._interval = dict.fromkeys(topics, math.inf)

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, message: Message, topic: str, at: float) -> None:
        """Take a scan that came at a time [s] on a topic."""
        scan, last = Arrived(message, topic, at, time.monotonic()), self._last.get(topic)
        if last is not None and 0.0 < (step := message.t - last.message.t) < MAX_SILENCE:
            self._interval[topic] = min(step, SLOWER * self._interval[topic])
        self._last[topic] = scan
        self._waiting.append(scan)
        if len(self._topics) > 1:
            self._waiting.sort(key=lambda one: (one.message.t, self._topics.index(one.topic)))

    def take(self, now: float) -> Arrived | None:
        """The next scan; None while there is none, or while it has to wait."""
        if not self._waiting:
            return None
        first = self._waiting[0]
        if now - first.put_at < self._wait and any(
            self._next_stamp(topic) < first.message.t
            for topic, last in self._last.items()
            if topic != first.topic and now - last.put_at < MAX_SILENCE
        ):
            return None
        return self._waiting.pop(0)

    def rest(self) -> list[Arrived]:
        """The scans that still wait, in order."""
        left, self._waiting = self._waiting, []
        return left

    def _next_stamp(self, topic: str) -> float:
        """The least stamp [s] of the next scan of a laser; of its last one after a first scan."""
        interval = self._interval[topic]
        early = 0.0 if math.isinf(interval) else EARLIEST * interval
        return self._last[topic].message.t + early
