"""The live node: scans in, poses, transforms and maps out, until its end is asked for."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from slams.formats.topics import some
from slams.live.buffer import SensorBuffer
from slams.live.diagnostics import PERIOD, Diagnostics, Say
from slams.live.options import TOPICS, TYPES, Callback, NodeOptions
from slams.live.publisher import NodePublisher
from slams.live.recorder import Recorder
from slams.live.scans import Arrived, Scans
from slams.live.slam import LiveSlam
from slams.ros.messages import SCAN, Record, store
from slams.types import Pose2, Scan

if TYPE_CHECKING:
    from slams.live.transport import Transport

SETTLING_TIME = 0.5  # [s] after the first scan, in which odometry and tf may begin
MAX_WAIT_FOR_TF = 2.0  # [s] after the first scan; without any tf the laser is the base then
POLL_PERIOD = 0.02  # [s] between looks at what tf has, and at whether to end
CHECK_PERIOD = 1.0  # [s] between diagnostics
MAX_WAITING = 20  # scans, when the algorithm is slower than the laser
MAX_EARLY_SCANS = 1000  # that wait until the frames are known


@dataclass
class Drive:
    """What was driven: stamps [s], poses, and time from a scan's coming to its pose [s].

    The delays are of scans that came since the frames were known; others waited for those.
    """

    t: list[float] = field(default_factory=list)
    poses: list[Pose2] = field(default_factory=list)
    delays: list[float] = field(default_factory=list)

    def delay_ms(self) -> dict[str, float]:
        """The delays' median, 99 % and longest [ms]."""
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
        say: what tells the user a sentence.

    A `recorder`, where it is set before `start`, gets all messages.
    """

    def __init__(
        self, live: LiveSlam, transport: Transport, options: NodeOptions, say: Say
    ) -> None:
        for msgtype in TYPES:  # what packs and unpacks it is made when first used: 20 ms each
            store().get_msgdef(msgtype)
        self.live, self.transport, self.options = live, transport, options
        self.drive = Drive()
        self.buffer = SensorBuffer(options.base_frame, options.odom_frame, options.odometry)
        self.recorder: Recorder | None = None
        self._say = say
        self._diagnostics = Diagnostics(say)
        self._publisher = NodePublisher(transport, options, self._record)
        self._map_stamp = -1  # [ns] of the last scan in the map
        self._map_failures: set[str] = set()
        self._closing = threading.Event()
        self._maps = threading.Thread(target=self._draw_maps, name="maps", daemon=True)
        if options.map_every and live.given is None:
            self._maps.start()
        self._topics = options.scans
        self.scans = Scans(self._topics, self.buffer.mounted, MAX_EARLY_SCANS, options.wait)
        self._ready_at = math.inf
        for topic in self._topics:
            self._subscribe(topic, "/scan", self.scans.put)
        for name in ("/tf", "/tf_static", "/odom", *(["/imu"] if options.imu else [])):
            self._subscribe(options.names[name], name, self.buffer.take)

    def start(self, ending: threading.Event) -> None:
        """Wait for the first scan and for the frames, as long as it takes."""
        self.transport.listen()
        if self.live.given is not None:
            self._publisher.publish_map(0, self.live.given)  # of no time: it stays
        self._say(f"ready for scans on {', '.join(self._topics)}")
        said_at = time.monotonic()
        while not ending.is_set():
            first = self.scans.first()
            if first is not None and self._is_placed(first):
                self._ready_at = time.monotonic()
                return
            if time.monotonic() - said_at >= PERIOD:
                said_at = time.monotonic()
                self._say(self._awaited(first))
            ending.wait(POLL_PERIOD)

    def run(self, ending: threading.Event, show_status: Callable[[], None]) -> None:
        """Take scans until the end; `show_status` is called about once a second."""
        checked_at = -math.inf
        while not ending.is_set():
            scan = self.scans.take(POLL_PERIOD)
            if scan is not None:
                self._push(scan)
            if len(self.scans) <= MAX_WAITING:  # what came before `start` ended is done
                self.scans.size = MAX_WAITING
            if time.monotonic() - checked_at >= CHECK_PERIOD:
                checked_at = time.monotonic()
                self.check()
                show_status()
        self.scans.wait = 0.0  # for another laser
        while (scan := self.scans.take(0.0)) is not None:
            self._push(scan)

    def close(self) -> None:
        """Publish the last map and leave the network; no pose, no recording.

        Raises:
            OSError: some of it could not be recorded; then there is no file.
        """
        self._closing.set()
        if self._maps.is_alive():
            self._maps.join()
        self.transport.close()
        if self.recorder is not None:
            self.recorder.close(keep=bool(self.drive.t))

    def report(self) -> dict[str, Any]:
        """Counts of what happened to scans and maps."""
        buffer = self.buffer
        return self.live.report() | {
            **self.scans.counts,
            "unsent": self._publisher.unsent,
            "unreadable_others": buffer.unreadable,
            "odometry": buffer.source,
            "base_frame": buffer.base,
        }

    def check(self) -> None:
        """Report what goes wrong, and what is assumed of frames and laser."""
        diagnostics, topics = self._diagnostics, self._topics
        scan_times = {topic: self.scans.came_at.get(topic, self._ready_at) for topic in topics}
        diagnostics.check(self.report(), scan_times)
        if self.live.candidates:
            place = f"the place in the map is not sure ({self.live.candidates})"
            sought = self.scans.counts["sought"]
            diagnostics.count("sought", sought, f"scans so far, and {place}; drive on")
        for note in (*self._map_failures, *self.live.notes, *self.buffer.notes, *self.scans.notes):
            diagnostics.note(note)

    # network

    def _subscribe(self, topic: str, usual: str, callback: Callback) -> None:
        """Have messages of a topic taken and recorded."""

        def both(record: Record) -> None:
            callback(record)
            self._record(topic, record.received, record.data)

        self.transport.subscribe(topic, *TOPICS[usual], both)

    def _record(self, topic: str, received: int, data: bytes) -> None:
        if self.recorder is not None:
            self.recorder.put(topic, received, data)

    def _draw_maps(self) -> None:
        """Publish a map every so often if there was a scan since, and once more at the end."""
        ended, published = False, self._map_stamp
        while not ended:
            ended, stamp = self._closing.wait(self.options.map_every), self._map_stamp
            if stamp != published:
                try:
                    self._publish_map(stamp)
                except Exception as error:  # is reported: scans go on
                    self._map_failures.add(f"the map is not published: {error}")
                published = stamp

    def _publish_map(self, stamp: int) -> None:
        """Publish the map, and of an algorithm that closes loops the path so far."""
        self._publisher.publish_map(stamp, self.live.map())
        poses = self.live.corrected()
        if poses is not None:
            t = self.drive.t[: len(poses)]  # a push may be under way
            self._publisher.publish_path([round(1e9 * s) for s in t], poses[: len(t)])

    # start

    def _awaited(self, first: Arrived | None) -> str:
        """What is waited for: a scan, or tf for the first; and the topics or frames there are."""
        if first is not None:
            base, laser = self.buffer.base or "a base", first.frame
            return (
                f"waiting for tf: no fixed way from {base} to the laser's frame {laser}; frames: "
                f"{some(self.buffer.tree.frames)} (--base-frame {laser} takes it as the base)"
            )
        text = (
            f"waiting for scans on {', '.join(self._topics)}; topics with a publisher of {SCAN}: "
            f"{some(self.transport.published(SCAN))} (--scan-topic takes another)"
        )
        return "; ".join([text, *self.scans.notes])

    def _is_placed(self, first: Arrived) -> bool:
        """Whether it is known where the laser sits: as tf says, or at the base where there is none.

        Odometry and tf have some time to begin.
        """
        waited, buffer = time.monotonic() - first.at, self.buffer
        if waited >= SETTLING_TIME and self.scans.is_placed(first.topic):
            return True
        known = buffer.tree.frames
        if waited > MAX_WAIT_FOR_TF and buffer.base is None and (not known or first.frame in known):
            buffer.base = first.frame
            self._say(
                f"no transform to the laser's frame {first.frame}: it is the base (if tf comes "
                "later, start again)"
            )
        return False

    # scans

    def _push(self, scan: Arrived) -> None:
        """From a scan to its pose, out on the network."""
        laser, t = self.scans.laser(scan), scan.sweep.t
        odometry, yaw, attitude = self.buffer.at(t, scan.at + self.options.wait)
        self.scans.counts["no_odometry"] += odometry is None and self.buffer.has_odometry
        used = None if self.options.odometry == "none" else odometry
        try:
            estimate = self.live.push_scan(Scan(t, scan.sweep.ranges, laser, used, yaw, attitude))
        except ValueError as error:
            self.scans.leave_out(error)
            return
        if not estimate.used:
            return
        if estimate.found:
            edge = self._edge(estimate.pose, odometry)
            self._publisher.publish_pose(scan.stamp, estimate, edge)
            if scan.at >= self._ready_at:
                self.drive.delays.append(time.monotonic() - scan.at)
            self.drive.t.append(t)
            self.drive.poses.append(estimate.pose)
            self._map_stamp = scan.stamp
        else:
            self.scans.counts["sought"] += 1
        counts = {"scans": len(self.drive.t), "dropped": self.scans.counts["dropped"]}
        self._publisher.publish_state(scan.stamp, estimate, counts)

    def _edge(self, pose: Pose2, odometry: Pose2 | None) -> tuple[str, Pose2] | None:
        """The frame to place in the map: the odometry's, or the base where nothing places that."""
        if odometry is not None:
            return self.options.odom_frame, pose @ odometry.inverse()
        base = self.buffer.base
        return None if self.buffer.has_odometry or base is None else (base, pose)
