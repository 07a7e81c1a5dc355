"""A log as a robot would publish it: each message when it was measured, in ROS's words."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from slams.formats.bag import ODOMETRY
from slams.formats.mcap import LAST_STAMP, frames_of
from slams.formats.ros_maker import Maker
from slams.formats.ros_store import store
from slams.live.options import KINDS, SCANS, Quality, Topics
from slams.scanlog import ScanLog
from slams.types import Pose2

if TYPE_CHECKING:
    from slams.live.transport import Publisher, Transport

ODOM = "odom"
TICK = 0.05  # [s] between looks at whether somebody listens
LINGER = 0.5  # [s] for the last messages to arrive


class Moment(NamedTuple):
    """A message and when it is due, in seconds from the log's first."""

    t: float
    send: Callable[[], None]
    is_scan: bool


class Robot:
    """Publishes a log's scans, and its odometry (also as tf), gyro and mount.

    Args:
        log: what is published.
        transport: the network.
        topics: their names.
    """

    def __init__(self, log: ScanLog, transport: Transport, topics: Topics) -> None:
        self._log, self._make, self._topics = log, Maker(), topics
        self._scan, self._period = topics.scans[0], log.scan_period
        kinds = {topics.tf_static: KINDS["tf_static"], self._scan: SCANS}
        if log.odom is not None:
            kinds |= {topics.odom: (ODOMETRY, Quality.RELIABLE), topics.tf: KINDS["tf"]}
        if log.yaw_rate is not None:
            kinds[topics.imu] = KINDS["imu"]
        self._base, self._laser = frames_of(log.meta)
        self._publishers: dict[str, Publisher] = {
            topic: transport.advertise(topic, *kind) for topic, kind in kinds.items()
        }
        fits = log.t.min() >= 0.0 and log.t.max() < LAST_STAMP
        self._zero = 0.0 if fits else float(log.t.min())
        self._due = self._all_due()
        self.length = len(self._due)

    def introduce(self) -> None:
        """Publish where the laser sits; it stays for who listens later."""
        stamp = self._stamp(float(self._log.t[0]))
        mount = [(self._base, self._laser, self._log.laser.mount)]
        self._send(self._topics.tf_static, self._make.transforms(stamp, mount))

    def await_reader(self, patience: float, ending: threading.Event) -> bool:
        """Wait for somebody who takes scans and mount; whether there is one in time [s]."""
        needed = [self._publishers[self._scan], self._publishers[self._topics.tf_static]]
        for _ in range(round(patience / TICK)):
            if all(one.subscribers for one in needed):
                ending.wait(LINGER)  # the other topics find each other meanwhile
                return True
            if ending.wait(TICK):
                break
        return False

    def moments(self) -> Iterator[Moment]:
        """All messages in the order they are due."""
        for due, kind, row in self._due:
            yield Moment(due, partial(self._publish, kind, row), kind == self._scan)

    def _all_due(self) -> list[tuple[float, str, int]]:
        """When, on which topic, which row: odometry before the scan of the same moment.

        A scan is due when its last beam is measured. Where stamps jump back the log's order rules.
        """
        log = self._log
        self._tracks = {self._topics.odom: log.odom, self._topics.imu: log.yaw_rate}
        stamps = {name: track.t for name, track in self._tracks.items() if track is not None}
        stamps[self._scan] = log.t + log.laser.time_increment * (log.laser.n_beams - 1)
        due = [
            (float(t), name, row)
            for name, all_t in stamps.items()
            for row, t in enumerate(np.maximum.accumulate(all_t))
        ]
        due.sort(key=lambda one: one[0])
        return [(t - due[0][0], name, row) for t, name, row in due]

    def _publish(self, topic: str, row: int) -> None:
        track, log, make = self._tracks.get(topic), self._log, self._make
        stamp = self._stamp(float((track or log).t[row]))
        if track is None:
            ranges = log.ranges[row]
            self._send(topic, make.scan(stamp, self._laser, log.laser, ranges, self._period))
        elif topic == self._topics.imu:
            self._send(topic, make.imu(stamp, float(track.values[row]), self._base))
        else:
            pose = Pose2(*track.values[row].tolist())
            self._send(topic, make.odometry(stamp, pose, ODOM, self._base))
            self._send(self._topics.tf, make.transforms(stamp, [(ODOM, self._base, pose)]))

    def _stamp(self, t: float) -> int:
        return max(0, round(1e9 * (t - self._zero)))

    def _send(self, topic: str, message: Any) -> None:
        data = store().serialize_cdr(message, message.__msgtype__)
        self._publishers[topic].publish(bytes(data))
