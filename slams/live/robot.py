"""Publishes a log as a robot would: each message at the time of its measurement."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from slams.formats.mcap import MAX_ROS_STAMP, frames_of
from slams.live.options import NODE_TOPICS, Quality
from slams.ros.maker import Maker
from slams.ros.messages import typestore
from slams.scanlog import ScanLog
from slams.types import Pose2

if TYPE_CHECKING:
    from slams.live.transport import Transport

ODOM_FRAME = "odom"
DISCOVERY_PERIOD = 0.05  # s between checks for a subscriber
DELIVERY_TIME = 0.5  # s for the last messages to arrive


class DueMessage(NamedTuple):
    """When a message is due [s after the first], its topic's default name, its row in the log."""

    t: float
    topic: str
    row: int


class Robot:
    """Publishes a log's scans, odometry (also as tf), gyro and laser mount.

    The mount is published at once and is latched. `schedule` lists the other messages in the order
    in which they are due, for `send`.

    Args:
        log: the log to publish.
        transport: the network.
        names: of the topics, by their default names.
    """

    def __init__(self, log: ScanLog, transport: Transport, names: Mapping[str, str]) -> None:
        self._log, self._make = log, Maker()
        self._base, self._laser = frames_of(log.meta)
        tracks = {"/odom": log.odom, "/imu": log.yaw_rate}
        self._series = {name: track for name, track in tracks.items() if track is not None}
        kinds = {name: NODE_TOPICS[name] for name in ("/scan", "/tf_static", *self._series)}
        if "/odom" in kinds:
            kinds["/tf"] = NODE_TOPICS["/tf"]
            kinds["/odom"] = NODE_TOPICS["/odom"][0], Quality.RELIABLE
        self._publishers = {
            name: transport.advertise(names[name], *kind) for name, kind in kinds.items()
        }
        fits = log.t.min() >= 0.0 and log.t.max() < MAX_ROS_STAMP
        self._zero = 0.0 if fits else float(log.t.min())
        self.schedule = self._schedule_of()
        mount = [(self._base, self._laser, log.laser.mount)]
        self._send("/tf_static", self._make.transforms(self._stamp(float(log.t[0])), mount))

    def await_subscriber(self, timeout: float, ending: threading.Event) -> bool:
        """Wait at most `timeout` [s] for a subscriber to scans and mount; whether there is one."""
        needed = [self._publishers["/scan"], self._publishers["/tf_static"]]
        for _ in range(round(timeout / DISCOVERY_PERIOD)):
            if all(one.subscribers for one in needed):
                ending.wait(DELIVERY_TIME)  # DDS connects the other topics meanwhile
                return True
            if ending.wait(DISCOVERY_PERIOD):
                break
        return False

    def send(self, due: DueMessage) -> None:
        """Publish a message."""
        _, topic, row = due
        log, make, track = self._log, self._make, self._series.get(topic)
        if track is None:
            stamp = self._stamp(float(log.t[row]))
            scan = make.scan(stamp, self._laser, log.laser, log.ranges[row], log.scan_period)
            self._send(topic, scan)
            return
        stamp, value = self._stamp(float(track.t[row])), track.values[row].tolist()
        if topic == "/imu":
            self._send(topic, make.imu(stamp, value, self._base))
        else:
            self._send(topic, make.odometry(stamp, Pose2(*value), ODOM_FRAME, self._base))
            self._send("/tf", make.transforms(stamp, [(ODOM_FRAME, self._base, Pose2(*value))]))

    def _schedule_of(self) -> list[DueMessage]:
        """All messages by time; odometry comes before a scan of the same time.

        A scan is due when its last beam is measured. Where stamps jump back, the log's order holds.
        """
        stamps = {topic: track.t for topic, track in self._series.items()}
        stamps["/scan"] = self._log.t + self._log.laser.sweep_time
        due = [
            DueMessage(float(t), topic, row)
            for topic, all_t in stamps.items()
            for row, t in enumerate(np.maximum.accumulate(all_t))
        ]
        due.sort(key=lambda one: one.t)
        return [one._replace(t=one.t - due[0].t) for one in due]

    def _stamp(self, t: float) -> int:
        return max(0, round(1e9 * (t - self._zero)))

    def _send(self, topic: str, message: Any) -> None:
        data = typestore().serialize_cdr(message, message.__msgtype__)
        self._publishers[topic].publish(bytes(data))
