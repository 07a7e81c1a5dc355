"""The live node: scans in, poses, transforms and maps out, until it is told to end."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from slams.formats.bag import IMU, ODOMETRY, SCAN, TF, Record
from slams.formats.ros_store import prepare
from slams.live.estimate import Estimate
from slams.live.frames import Mounted, RobotFrames
from slams.live.inbox import Inbox, Waiting
from slams.live.maps import MapThread
from slams.live.options import NodeOptions
from slams.live.publisher import Publisher
from slams.live.recorder import Recorder
from slams.live.scans import Message, ScanCleaner, message_of
from slams.live.senses import Senses
from slams.live.slam import LiveSlam
from slams.live.timelines import RateTimeline
from slams.live.watch import Say, Watch
from slams.live.wire import TYPES, Quality, Taker, Wire
from slams.types import IDENTITY, Pose2, Scan

SETTLING = 0.5  # [s] after the first scan, in which odometry and tf speak up
WITHOUT_TF = 2.0  # [s] after the first scan, in which tf may come late
SOON = 0.02  # [s] between looks at what tf tells
TICK = 0.1  # [s] between looks at whether to end
SOUGHT_LONG = 20  # scans without a sure place in a given map: that is told
COUNTED = ("unreadable", "other_frame", "no_odometry", "sought")  # scans, why they are told
EARLY = 1000  # scans that may wait until the frames are known


@dataclass
class Drive:
    """What was driven: stamps [s], poses, and time from a scan's coming to its pose [s].

    The delays are of scans that came since the frames were known; others waited for those.
    """

    t: list[float] = field(default_factory=list)
    poses: list[Pose2] = field(default_factory=list)
    delays: list[float] = field(default_factory=list)
    estimate: Estimate | None = None
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(COUNTED, 0))


class Node:
    """One algorithm on a robot.

    Args:
        live: the algorithm.
        wire: the network.
        options: topics, frames, times.
        say: what tells the user a sentence.

    A `recorder`, where it is set before `start`, gets all messages.
    """

    def __init__(self, live: LiveSlam, wire: Wire, options: NodeOptions, say: Say) -> None:
        prepare(TYPES)
        self.live, self.wire, self.options = live, wire, options
        self.drive, self.inbox = Drive(), Inbox(EARLY)
        frames, gyro = RobotFrames(options.base_frame, options.odom_frame), live.seam.gyro
        self.senses = Senses(frames, options.odometry, RateTimeline(gyro))
        self.recorder: Recorder | None = None
        self._say, self._noted = say, set[str]()
        self._watch = Watch(options.topics.scan, self.inbox, live, wire, say)
        self._publisher = Publisher(wire, options, self._keep)
        every = options.map_every if live.given is None else 0.0
        self._maps = MapThread(live, self._publisher.show, every)
        self._cleaner: ScanCleaner | None = None
        self._frame, self._alone = "", False
        self._looked, self._ready = -1.0, math.inf
        self._subscribe()

    def start(self, ending: threading.Event) -> None:
        """Wait for the first scan and for the frames.

        Raises:
            ValueError: there are no scans, or a frame is not in tf; the sentence says what is.
        """
        self.wire.listen()
        if self.live.given is not None:
            self._publisher.show(0, self.live.given)  # of no time: it stays
        self._say(f"ready for scans on {self.options.topics.scan}")
        since = self._first_scan(ending)
        mounted = None if since is None else self._mounted(since, ending)
        if mounted is not None:
            self._cleaner = ScanCleaner(mounted)
            self._ready = time.monotonic()

    def run(self, ending: threading.Event, status: Callable[[], None]) -> None:
        """Take scans until the end; `status` is called about once a second."""
        while not ending.is_set():
            waiting = self.inbox.take(TICK)
            if waiting is not None:
                self._take(waiting)
            if len(self.inbox) <= self.options.queue:  # what came while frames were sought is done
                self.inbox.most = self.options.queue
            if time.monotonic() - self._looked >= 1.0:
                self._looked = time.monotonic()
                self._look()
                status()

    def close(self) -> None:
        """Publish the last map and leave the network."""
        self._maps.close()
        self.wire.close()

    def report(self) -> dict[str, Any]:
        """Counts of what happened to scans and maps."""
        maps = {"maps": self._maps.drawn, "longest_hold_s": self._maps.longest}
        came = {"came": self.inbox.came, "dropped": self.inbox.dropped}
        late = {"late_odometry": self.senses.late, "unreadable_others": self.senses.unreadable}
        source = {"odometry": self.senses.source, "base_frame": self.senses.frames.base}
        came["unsent"] = self._publisher.unsent
        return came | self.drive.counts | late | source | maps | self.live.report()

    # network

    def _subscribe(self) -> None:
        topics, take = self.options.topics, self.senses
        self._hear(topics.scan, SCAN, Quality.SENSOR, self.inbox.put)
        if self.options.odometry in ("auto", "topic"):
            self._hear(topics.odom, ODOMETRY, Quality.SENSOR, take.take_odometry)
        if self.options.imu:
            self._hear(topics.imu, IMU, Quality.SENSOR, take.take_imu)
        self._hear(topics.tf, TF, Quality.RELIABLE, take.take_tf)
        self._hear(topics.tf_static, TF, Quality.LATCHED, take.take_tf)

    def _hear(self, topic: str, msgtype: str, quality: Quality, take: Taker) -> None:
        def both(record: Record) -> None:
            """Take a message and keep it."""
            take(record)
            self._keep(topic, record.received, record.data)

        self.wire.subscribe(topic, msgtype, quality, both)

    def _keep(self, topic: str, received: int, data: bytes) -> None:
        """Record a message, if that was asked for."""
        if self.recorder is not None:
            self.recorder.put(topic, received, data)

    # start

    def _first_scan(self, ending: threading.Event) -> float | None:
        """When the first scan came; it is left where it waits. None if it ended before."""
        until = time.monotonic() + self.options.patience
        while not ending.is_set():
            first = self.inbox.first(TICK)
            if first is not None:
                try:
                    self._frame = message_of(first.record).frame
                    return first.since
                except ValueError as error:
                    self.inbox.take(0.0)
                    self._leave_out(error)
            elif time.monotonic() > until:
                raise ValueError(self._no_scan())
        return None

    def _no_scan(self) -> str:
        """Why there is no scan, as far as the network tells."""
        topic, there = self.options.topics.scan, self.wire.topics()
        others = ", ".join(
            sorted(name for name, kind in there.items() if kind == SCAN and name != topic)
        )
        if there.get(topic, SCAN) != SCAN:
            what = f"{topic} carries {there[topic]}, expected {SCAN}"
        elif topic in there:
            what = f"{topic} is published, but no scan came within {self.options.patience:g} s"
        else:
            what = f"no scan on {topic} within {self.options.patience:g} s: nobody publishes it"
        return f"{what}; topics with scans: {others or 'none'} (--scan-topic takes another)"

    def _mounted(self, since: float, ending: threading.Event) -> Mounted | None:
        """Where the laser sits: as tf says, or at the base where there is no tf; None if ended."""
        asked = self.options.base_frame is not None
        patience = self.options.patience if asked else WITHOUT_TF
        while not ending.is_set():
            now = time.monotonic()
            if now >= since + SETTLING or self.senses.moves(self._frame):
                mounted = self.senses.settle(self._frame)
                if mounted is not None:
                    return mounted
            if now > since + patience:
                return self._without_tf()
            ending.wait(SOON)
        return None

    def _without_tf(self) -> Mounted:
        complaint = self.senses.frames.complaint(self._frame)
        if complaint is not None:
            raise ValueError(complaint)
        self._say(f"no transform to the laser's frame {self._frame}: it is taken as the base")
        self.senses.settle_alone(self._frame)
        self._alone = True
        return Mounted(self._frame, IDENTITY, False)

    # scans

    def _take(self, waiting: Waiting) -> None:
        assert self._cleaner is not None
        try:
            message = message_of(waiting.record)
            if message.frame != self._frame:
                self.drive.counts["other_frame"] += 1
                return
            self._pose(message, waiting.since)
        except ValueError as error:
            self._leave_out(error)

    def _leave_out(self, error: ValueError) -> None:
        self.drive.counts["unreadable"] += 1
        if self.drive.counts["unreadable"] == 1:
            self._say(f"{error}; such scans are left out")

    def _pose(self, message: Message, since: float) -> None:
        """From a scan to its pose, out on the network."""
        assert self._cleaner is not None
        cleaned, t = self._cleaner.clean(message), message.t
        self.senses.wait_for(t, since + self.options.wait)
        odometry = self.senses.odometry_at(t)
        self.drive.counts["no_odometry"] += odometry is None and self.senses.has_odometry
        given = None if self.options.odometry == "none" else odometry
        scan = Scan(t, cleaned.ranges, cleaned.laser, given, self.senses.yaw_at(t))
        estimate = self.live.push_scan(scan)
        if not estimate.used:
            return
        self.drive.estimate = estimate
        if not estimate.found:
            self._publisher.tell_state(message.stamp, estimate, self._counts(0))
            self.drive.counts["sought"] += 1
            return
        self._publisher.tell(
            message.stamp, estimate, self._edge(estimate.pose, odometry), self._counts(1)
        )
        if since >= self._ready:
            self.drive.delays.append(time.monotonic() - since)
        self.drive.t.append(t)
        self.drive.poses.append(estimate.pose)
        self._maps.seen(message.stamp)
        self._watch.stamped(t)

    def _counts(self, more: int) -> dict[str, int]:
        """What the state tells beside: scans with a pose, and `more`; scans left out."""
        return {"scans": len(self.drive.t) + more, "dropped": self.inbox.dropped}

    def _edge(self, pose: Pose2, odometry: Pose2 | None) -> tuple[str, Pose2] | None:
        """What to place in the map: the odometry's frame, or the base where nobody places that."""
        if odometry is not None:
            return self.options.odom_frame, pose @ odometry.inverse()
        base = self.senses.frames.base
        return None if self.senses.has_odometry or base is None else (base, pose)

    def _look(self) -> None:
        """Tell what goes wrong."""
        self._watch.look()
        self._tell_notes()
        counts = self.drive.counts
        self._watch.count(
            "odometry",
            counts["no_odometry"],
            f"scans so far without odometry within {self.options.wait:g} s (--wait is how long)",
        )
        self._watch.count(
            "frame",
            counts["other_frame"],
            f"scans of other frames than {self._frame} are left out: two lasers on one topic",
        )
        self._watch.count(
            "unsent", self._publisher.unsent, "messages were not taken by the network in time"
        )
        self._watch.count(
            "sought",
            counts["sought"] if self.live.doubt and counts["sought"] > SOUGHT_LONG else 0,
            f"scans so far, and the place in the map is not sure ({self.live.doubt}); drive on",
        )
        if self._maps.failed is not None:
            self._say(f"the map is not published: {self._maps.failed}")
            self._maps.failed = None

    def _tell_notes(self) -> None:
        """Tell what is assumed of frames and laser, once each."""
        frames = self.senses.frames
        notes = [*self.live.notes, *frames.notes, *(self._cleaner.notes if self._cleaner else ())]
        if self._alone and frames.knows(self._frame):
            notes.append(f"tf has {self._frame} now, too late: start again to have it used")
        for note in notes:
            if note not in self._noted:
                self._noted.add(note)
                self._say(note)
