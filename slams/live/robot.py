"""A log as a robot would publish it: each message when it was measured, in ROS's words."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from slams.formats.bag import IMU, ODOMETRY, SCAN, TF
from slams.formats.mcap import LAST_STAMP, frames_of
from slams.formats.ros_maker import Maker
from slams.formats.ros_store import store
from slams.live.options import Quality, Topics
from slams.scanlog import ScanLog, Track
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
        names: other names for topics.
    """

    def __init__(self, log: ScanLog, transport: Transport, names: Mapping[str, str]) -> None:
        topics = Topics()
        types = {topics.tf_static: (TF, Quality.LATCHED), topics.scans[0]: (SCAN, Quality.SENSOR)}
        if log.odom is not None:
            types |= {topics.odom: (ODOMETRY, Quality.RELIABLE), topics.tf: (TF, Quality.RELIABLE)}
        if log.yaw_rate is not None:
            types[topics.imu] = (IMU, Quality.SENSOR)
        unknown = [name for name in names if name not in types]
        if unknown:
            raise ValueError(
                f"--remap: {unknown[0]} is not published; there are {', '.join(types)}"
            )
        self._log, self._make, self._topics = log, Maker(), topics
        self._base, self._laser = frames_of(log.meta)
        self._kinds = {topic: kind for topic, (kind, _) in types.items()}
        self._publishers: dict[str, Publisher] = {
            topic: transport.advertise(names.get(topic, topic), *kind)
            for topic, kind in types.items()
        }
        fits = log.t.min() >= 0.0 and log.t.max() < LAST_STAMP
        self._zero = 0.0 if fits else float(log.t.min())
        self._due = self._all_due()
        self.length = len(self._due)

    def introduce(self) -> None:
        """Publish where the laser sits; it stays for who listens later."""
        stamp = self._stamp(float(self._log.t[0]), 0.0)
        mount = [(self._base, self._laser, self._log.laser.mount)]
        self._send(self._topics.tf_static, self._make.transforms(stamp, mount))

    def await_reader(self, patience: float, ending: threading.Event) -> bool:
        """Wait for somebody who takes scans and mount; whether there is one in time [s]."""
        needed = [self._publishers[self._topics.scans[0]], self._publishers[self._topics.tf_static]]
        for _ in range(round(patience / TICK)):
            if all(one.subscribers for one in needed):
                ending.wait(LINGER)  # the other topics find each other meanwhile
                return True
            if ending.wait(TICK):
                break
        return False

    def moments(self, turn: int = 0) -> Iterator[Moment]:
        """All messages in the order they are due; each turn of a loop begins where one ended."""
        later = turn * (self._due[-1][0] + self._log.scan_period)
        for due, kind, row in self._due:
            send = partial(self._publish, kind, row, later)
            yield Moment(due + later, send, kind == self._topics.scans[0])

    def _all_due(self) -> list[tuple[float, str, int]]:
        """When, on which topic, which row: odometry before the scan of the same moment.

        A scan is due when its last beam is measured. Where stamps jump back the log's order rules.
        """
        log, topics = self._log, self._topics
        sweep = log.laser.time_increment * (log.laser.n_beams - 1)
        tracks = {topics.odom: log.odom, topics.imu: log.yaw_rate}
        stamps = {name: track.t for name, track in tracks.items() if track is not None}
        stamps[topics.scans[0]] = log.t + sweep
        due = [
            (float(t), name, row)
            for name, all_t in stamps.items()
            for row, t in enumerate(np.maximum.accumulate(all_t))
        ]
        due.sort(key=lambda one: one[0])
        return [(t - due[0][0], name, row) for t, name, row in due]

    def _publish(self, kind: str, row: int, later: float) -> None:
        log, topics = self._log, self._topics
        if kind == topics.scans[0]:
            stamp = self._stamp(float(log.t[row]), later)
            ranges, period = log.ranges[row], log.scan_period
            self._send(kind, self._make.scan(stamp, self._laser, log.laser, ranges, period))
        elif kind == topics.odom and log.odom is not None:
            self._publish_odometry(log.odom, row, later)
        elif log.yaw_rate is not None:
            stamp = self._stamp(float(log.yaw_rate.t[row]), later)
            self._send(kind, self._make.imu(stamp, float(log.yaw_rate.values[row]), self._base))

    def _publish_odometry(self, track: Track, row: int, later: float) -> None:
        stamp, pose = self._stamp(float(track.t[row]), later), Pose2(*track.values[row].tolist())
        said = self._make.odometry(stamp, pose, ODOM, self._base)
        self._send(self._topics.odom, said)
        self._send(self._topics.tf, self._make.transforms(stamp, [(ODOM, self._base, pose)]))

    def _stamp(self, t: float, later: float) -> int:
        return max(0, round(1e9 * (t - self._zero + later)))

    def _send(self, topic: str, message: Any) -> None:
        self._publishers[topic].publish(bytes(store().serialize_cdr(message, self._kinds[topic])))
