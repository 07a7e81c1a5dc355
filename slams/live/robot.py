"""A log as a robot would publish it: each message when it was measured, in ROS's words."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from slams.formats.mcap import LAST_STAMP, frames_of
from slams.live.options import TOPICS, Quality
from slams.ros.maker import Maker
from slams.ros.messages import store
from slams.scanlog import ScanLog
from slams.types import Pose2

if TYPE_CHECKING:
    from slams.live.transport import Transport

ODOM = "odom"
TICK = 0.05  # [s] between looks at whether somebody listens
LINGER = 0.5  # [s] for the last messages to arrive


class Moment(NamedTuple):
    """When a message is due, in seconds from the log's first, its topic's usual name, its row."""

    t: float
    topic: str
    row: int


class Robot:
    """Publishes a log's scans, and its odometry (also as tf), gyro and mount.

    The mount is published at once and stays; `moments` are the other messages in the order they
    are due, for `send`.

    Args:
        log: what is published.
        transport: the network.
        names: of the topics, by their usual ones.
    """

    def __init__(self, log: ScanLog, transport: Transport, names: Mapping[str, str]) -> None:
        self._log, self._make = log, Maker()
        self._base, self._laser = frames_of(log.meta)
        tracks = {"/odom": log.odom, "/imu": log.yaw_rate}
        self._tracks = {name: track for name, track in tracks.items() if track is not None}
        kinds = {name: TOPICS[name] for name in ("/scan", "/tf_static", *self._tracks)}
        if "/odom" in kinds:
            kinds |= {"/tf": TOPICS["/tf"], "/odom": (TOPICS["/odom"][0], Quality.RELIABLE)}
        self._publishers = {
            name: transport.advertise(names[name], *kind) for name, kind in kinds.items()
        }
        fits = log.t.min() >= 0.0 and log.t.max() < LAST_STAMP
        self._zero = 0.0 if fits else float(log.t.min())
        self.moments = self._moments()
        mount = [(self._base, self._laser, log.laser.mount)]
        self._send("/tf_static", self._make.transforms(self._stamp(float(log.t[0])), mount))

    def await_reader(self, patience: float, ending: threading.Event) -> bool:
        """Wait for somebody who takes scans and mount; whether there is one in time [s]."""
        needed = [self._publishers["/scan"], self._publishers["/tf_static"]]
        for _ in range(round(patience / TICK)):
            if all(one.subscribers for one in needed):
                ending.wait(LINGER)  # the other topics find each other meanwhile
                return True
            if ending.wait(TICK):
                break
        return False

    def send(self, moment: Moment) -> None:
        """Publish a message."""
        _, topic, row = moment
        log, make, track = self._log, self._make, self._tracks.get(topic)
        if track is None:
            stamp = self._stamp(float(log.t[row]))
            scan = make.scan(stamp, self._laser, log.laser, log.ranges[row], log.scan_period)
            self._send(topic, scan)
            return
        stamp, value = self._stamp(float(track.t[row])), track.values[row].tolist()
        if topic == "/imu":
            self._send(topic, make.imu(stamp, value, self._base))
        else:
            self._send(topic, make.odometry(stamp, Pose2(*value), ODOM, self._base))
            self._send("/tf", make.transforms(stamp, [(ODOM, self._base, Pose2(*value))]))

    def _moments(self) -> list[Moment]:
        """All that is due: odometry before the scan of the same moment.

        A scan is due when its last beam is measured. Where stamps jump back the log's order rules.
        """
        stamps = {topic: track.t for topic, track in self._tracks.items()}
        stamps["/scan"] = self._log.t + self._log.laser.sweep_time
        due = [
            Moment(float(t), topic, row)
            for topic, all_t in stamps.items()
            for row, t in enumerate(np.maximum.accumulate(all_t))
        ]
        due.sort(key=lambda moment: moment.t)
        return [moment._replace(t=moment.t - due[0].t) for moment in due]

    def _stamp(self, t: float) -> int:
        return max(0, round(1e9 * (t - self._zero)))

    def _send(self, topic: str, message: Any) -> None:
        data = store().serialize_cdr(message, message.__msgtype__)
        self._publishers[topic].publish(bytes(data))
