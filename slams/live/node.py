"""The live node: scans in; poses, transforms and maps out, until it is asked to end."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from slams.formats.topics import shortened
from slams.live.buffer import SensorBuffer
from slams.live.diagnostics import REPORT_PERIOD, Diagnostics, Notify
from slams.live.options import NODE_TOPICS, NODE_TYPES, Callback, NodeOptions
from slams.live.publisher import NodePublisher
from slams.live.recorder import Recorder
from slams.live.scans import ReceivedScan, ScanQueue
from slams.live.slam import LiveSlam
from slams.ros.messages import SCAN_TYPE, Record, typestore
from slams.types import Pose2, Scan

if TYPE_CHECKING:
    from slams.live.transport import Transport

TF_SETTLING_TIME = 0.5  # s after the first scan in which odometry and tf may start
MAX_TF_WAIT = 2.0  # s after the first scan; if there is no tf by then, the laser is the base
POLL_PERIOD = 0.02  # s between checks of tf, and of whether to end
DIAGNOSTICS_PERIOD = 1.0  # s between two diagnostics
MAX_QUEUED_SCANS = 20  # when the algorithm is slower than the laser
MAX_EARLY_SCANS = 1000  # queued until the frames are known


@dataclass
class Drive:
    """The trajectory: stamps [s], poses, and delays from receiving a scan to its pose [s].

    Scans that were received before the frames were known have no delay.
    """

    t: list[float] = field(default_factory=list)
    poses: list[Pose2] = field(default_factory=list)
    delays: list[float] = field(default_factory=list)

    def delay_ms(self) -> dict[str, float]:
        """Median, 99th percentile and maximum of the delays [ms]."""
        if not self.delays:
            return {}
        shares = {"p50": 50, "p99": 99, "max": 100}
        return {k: round(1e3 * float(np.percentile(self.delays, p)), 3) for k, p in shares.items()}


class Node:
    """One algorithm on a robot.

    Args:
        live: the algorithm.
        transport: the network.
        options: topics, frames, times.
        notify: shows a sentence to the user.

    If `recorder` is set before `start`, it records all messages.
    """

    def __init__(
        self, live: LiveSlam, transport: Transport, options: NodeOptions, notify: Notify
    ) -> None:
        for msgtype in NODE_TYPES:  # make the (de)serializers now: each takes 20 ms on first use
            typestore().get_msgdef(msgtype)
        self.live, self.transport, self.options = live, transport, options
        self.drive = Drive()
        self.buffer = SensorBuffer(options.base_frame, options.odom_frame, options.odometry)
        self.recorder: Recorder | None = None
        self._notify = notify
        self._diagnostics = Diagnostics(notify)
        self._publisher = NodePublisher(transport, options, self._record)
        self._map_stamp = -1  # [ns] of the last scan in the map
        self._map_failures: set[str] = set()
        self._closing = threading.Event()
        self._map_thread = threading.Thread(target=self._publish_maps, name="maps", daemon=True)
        if options.map_every and live.given is None:
            self._map_thread.start()
        self._topics = options.scans
        self.scans = ScanQueue(self._topics, self.buffer.mount_of, MAX_EARLY_SCANS, options.wait)
        self._ready_at = math.inf
        for topic in self._topics:
            self._subscribe(topic, "/scan", self.scans.put)
        for name in ("/tf", "/tf_static", "/odom", *(["/imu"] if options.imu else [])):
            self._subscribe(options.names[name], name, self.buffer.put)

    def start(self, ending: threading.Event) -> None:
        """Wait for the first scan and for the frames, without a time limit."""
        self.transport.listen()
        if self.live.given is not None:
            self._publisher.publish_map(0, self.live.given)  # without a stamp: it does not change
        self._notify(f"ready for scans on {', '.join(self._topics)}")
        reported_at = time.monotonic()
        while not ending.is_set():
            first = self.scans.first()
            if first is not None and self._has_mount(first):
                self._ready_at = time.monotonic()
                return
            if time.monotonic() - reported_at >= REPORT_PERIOD:
                reported_at = time.monotonic()
                self._notify(self._waiting_message(first))
            ending.wait(POLL_PERIOD)

    def run(self, ending: threading.Event, show_status: Callable[[], None]) -> None:
        """Process scans until the end; calls `show_status` about once a second."""
        checked_at = -math.inf
        while not ending.is_set():
            scan = self.scans.take(POLL_PERIOD)
            if scan is not None:
                self._push(scan)
            if len(self.scans) <= MAX_QUEUED_SCANS:  # the early scans have been processed
                self.scans.size = MAX_QUEUED_SCANS
            if time.monotonic() - checked_at >= DIAGNOSTICS_PERIOD:
                checked_at = time.monotonic()
                self.check()
                show_status()
        self.scans.wait = 0.0  # at the end no scan waits for another laser
        while (scan := self.scans.take(0.0)) is not None:
            self._push(scan)

    def close(self) -> None:
        """Publish the last map and leave the network; without a pose the recording is discarded.

        Raises:
            OSError: a message could not be recorded; then there is no file.
        """
        self._closing.set()
        if self._map_thread.is_alive():
            self._map_thread.join()
        self.transport.close()
        if self.recorder is not None:
            self.recorder.close(keep=bool(self.drive.t))

    def report(self) -> dict[str, Any]:
        """Counts of scans and messages, and the choices of odometry and base frame."""
        buffer = self.buffer
        return self.live.report() | {
            **self.scans.counts,
            "unsent": self._publisher.unsent,
            "unreadable_others": buffer.unreadable,
            "odometry": buffer.source,
            "base_frame": buffer.base,
        }

    def check(self) -> None:
        """Report problems, and the assumptions about frames and lasers."""
        diagnostics, topics = self._diagnostics, self._topics
        scan_times = {topic: self.scans.received_at.get(topic, self._ready_at) for topic in topics}
        diagnostics.check(self.report(), scan_times)
        if self.live.candidates:
            searched, candidates = self.scans.counts["sought"], self.live.candidates
            text = f"scans so far, not localized in the map yet ({candidates}); drive on"
            diagnostics.count("sought", searched, text)
        is_unused = self.options.odometry != "topic" and self.buffer.source != "tf"
        if is_unused and self.buffer.is_moved_by_tf:
            diagnostics.note("odometry in tf began too late and is not used: start the node again")
        for note in (*self._map_failures, *self.live.notes, *self.buffer.notes, *self.scans.notes):
            diagnostics.note(note)

    # network

    def _subscribe(self, topic: str, default_name: str, callback: Callback) -> None:
        """Subscribe to a topic; its messages go to the callback and to the recorder."""

        def receive(record: Record) -> None:
            callback(record)
            self._record(topic, record.received, record.data)

        self.transport.subscribe(topic, *NODE_TOPICS[default_name], receive)

    def _record(self, topic: str, received: int, data: bytes) -> None:
        if self.recorder is not None:
            self.recorder.put(topic, received, data)

    def _publish_maps(self) -> None:
        """Publish the map every `map_every` seconds and at the end, if it has a new scan."""
        ended, published = False, self._map_stamp
        while not ended:
            ended, stamp = self._closing.wait(self.options.map_every), self._map_stamp
            if stamp != published:
                try:
                    self._publish_map(stamp)
                except Exception as error:  # reported by `check`; scans are still processed
                    self._map_failures.add(f"the map is not published: {error}")
                published = stamp

    def _publish_map(self, stamp: int) -> None:
        """Publish the map, and the corrected path if the algorithm closes loops."""
        self._publisher.publish_map(stamp, self.live.map())
        poses = self.live.corrected()
        if poses is not None:
            t = self.drive.t[: len(poses)]  # another thread may be adding a scan
            self._publisher.publish_path([round(1e9 * s) for s in t], poses[: len(t)])

    # start

    def _waiting_message(self, first: ReceivedScan | None) -> str:
        """The message about a missing scan or transform, with the topics or frames that exist."""
        if first is not None:
            laser, parent = first.frame, f"fixed transform from {self.buffer.base or 'a base'}"
            remedy, known = f"--base-frame {laser} takes it as the base", self.buffer.frames
            if self.buffer.lacks_odometry:
                parent, remedy = f"odometry from {self.options.odom_frame}", "or use --odom auto"
            text = f"waiting for tf: no {parent} to the laser's frame {laser}"
            return f"{text}; frames: {shortened(known)} ({remedy})"
        text = (
            f"waiting for scans on {', '.join(self._topics)}; topics with a publisher of "
            f"{SCAN_TYPE}: {shortened(self.transport.published(SCAN_TYPE))} "
            "(--scan-topic takes another)"
        )
        return "; ".join([text, *self.scans.notes])

    def _has_mount(self, first: ReceivedScan) -> bool:
        """Whether the laser's mount is known: from tf, or after a wait at the base without tf."""
        waited, buffer = time.monotonic() - first.received, self.buffer
        if waited >= TF_SETTLING_TIME and self.scans.has_mount(first.topic):
            return True
        frames = buffer.frames
        is_free = buffer.base is None and self.options.odometry != "tf"
        if waited > MAX_TF_WAIT and is_free and (not frames or first.frame in frames):
            buffer.base = first.frame
            self._notify(
                f"no transform to the laser's frame {first.frame}: it is taken as the base (if tf "
                "starts later, start the node again)"
            )
        return False

    # scans

    def _push(self, scan: ReceivedScan) -> None:
        """Process a scan and publish its pose and state."""
        laser, t = self.scans.laser(scan), scan.sweep.t
        until = scan.received + self.options.wait
        middle = self.buffer.at(t + 0.5 * laser.sweep_time, until)[:2] if laser.sweep_time else ()
        odometry, yaw, attitude = self.buffer.at(t, until)
        self.scans.counts["no_odometry"] += odometry is None and self.buffer.has_odometry
        used = None if self.options.odometry == "none" else odometry
        try:
            sensors = used, yaw, attitude, *middle
            estimate = self.live.push_scan(Scan(t, scan.sweep.ranges, laser, *sensors))
        except ValueError as error:
            self.scans.reject(error)
            return
        if not estimate.used:
            return
        if estimate.found:
            edge = self._map_transform(estimate.pose, odometry)
            self._publisher.publish_pose(scan.stamp, estimate, edge)
            if scan.received >= self._ready_at:
                self.drive.delays.append(time.monotonic() - scan.received)
            self.drive.t.append(t)
            self.drive.poses.append(estimate.pose)
            self._map_stamp = scan.stamp
        else:
            self.scans.counts["sought"] += 1
        counts = {"scans": len(self.drive.t), "dropped": self.scans.counts["dropped"]}
        self._publisher.publish_state(scan.stamp, estimate, counts)

    def _map_transform(self, pose: Pose2, odometry: Pose2 | None) -> tuple[str, Pose2] | None:
        """The child frame and transform below the map: of the odometry, or else of the base."""
        if odometry is not None:
            return self.options.odom_frame, pose @ odometry.inverse()
        base, has_parent = self.buffer.base, self.buffer.has_odometry or self.buffer.is_moved_by_tf
        return None if has_parent or base is None else (base, pose)
