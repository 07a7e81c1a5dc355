"""The sensor buffer: odometry, gyro and tf as they come from other threads, for a scan's stamp."""

from __future__ import annotations

import threading
import time
from typing import Any, NamedTuple

from slams.formats.bag import IMU, ODOMETRY, Record
from slams.formats.frames import planar
from slams.formats.ros_messages import READ
from slams.formats.ros_store import store
from slams.live.frames import Mounted, RobotFrames
from slams.live.series import PoseSeries, RateSeries, Series, all_cover
from slams.ros.stamps import seconds
from slams.types import Floats, Pose2

MAX_EARLY_READINGS = 4000  # of the gyro, kept until the base is known: 20 s at 200 Hz


class GyroReading(NamedTuple):
    """Stamp [s], the frame of the gyro, rates about its axes [rad/s]."""

    t: float
    frame: str
    rates: tuple[float, float, float]


class SensorBuffer:
    """Takes messages; once the laser's mount is known, gives what was measured at a stamp.

    Args:
        frames: the robot's frames.
        odometry: "auto", tf where it has the odometry's frame and else the topic; "tf"; "topic";
            "none", which reads tf all the same: map -> odom has to fit it.
    """

    def __init__(self, frames: RobotFrames, odometry: str = "auto") -> None:
        self.frames, self.unreadable = frames, 0
        self.source: str | None = None  # of the odometry: "tf" or "topic", when chosen
        self._wanted = odometry
        self._odometry: PoseSeries | None = None
        self._of_topic, self._of_tf = PoseSeries(), dict[str, PoseSeries]()
        self._child: str | None = None  # frame of the topic's poses
        self._to_base: Pose2 | None = None  # from the frame of the odometry to the base
        self._gyro, self._early = RateSeries(), list[GyroReading]()
        self._upright: dict[str, Floats | None] = {}
        self._settled = False
        self._changed = threading.Condition()

    def take_odometry(self, record: Record) -> None:
        """Take a nav_msgs/Odometry."""
        message = self._decoded(record)
        if message is not None:
            child, pose = READ[ODOMETRY](message)
            with self._changed:
                self._child = child or self._child
                self._of_topic.push(seconds(message.header.stamp), Pose2(*pose))
                self._changed.notify_all()

    def take_imu(self, record: Record) -> None:
        """Take a sensor_msgs/Imu."""
        message = self._decoded(record)
        if message is not None:
            frame, rates = READ[IMU](message)
            with self._changed:
                self._early.append(GyroReading(seconds(message.header.stamp), frame, tuple(rates)))
                self._integrate()
                self._changed.notify_all()

    def take_tf(self, record: Record) -> None:
        """Take transforms; static ones by their topic's name."""
        message = self._decoded(record)
        if message is not None:
            with self._changed:
                for t, child, pose in self.frames.add(message, record.topic.endswith("static")):
                    self._of_tf.setdefault(child, PoseSeries()).push(t, pose)
                self._changed.notify_all()

    def has_tf_odometry(self, laser: str) -> bool:
        """Whether tf gives the odometry of the laser's base: no better source will come."""
        with self._changed:
            return self._wanted != "topic" and self._moving(laser) in self._of_tf

    def settle(self, laser: str) -> Mounted | None:
        """Where the laser sits, or None while that is open; the odometry is chosen with it."""
        with self._changed:
            moving = self._moving(laser)
            mounted = self.frames.mounted(laser, moving)
            if mounted is not None:
                self._choose(moving)
            return mounted

    def mounted(self, laser: str) -> Mounted | None:
        """Where a further laser sits on the base that is settled; None while tf leaves it open."""
        with self._changed:
            return self.frames.mounted(laser, None)

    def settle_without_tf(self, laser: str) -> None:
        """Take the laser as the base, and odometry as the laser's."""
        with self._changed:
            self.frames.base = laser
            self._choose(None)

    def wait_for(self, t: float, until: float) -> None:
        """Let odometry and gyro catch up with a stamp, until a time of `time.monotonic` at most."""
        with self._changed:
            series: list[Series] = [self._gyro]
            series += [self._odometry] if self._odometry is not None else []
            left = max(0.0, until - time.monotonic())
            self._changed.wait_for(lambda: all_cover(series, t), left)

    def odometry_at(self, t: float) -> Pose2 | None:
        """The base in the odometry's frame at a stamp; None where it was not measured."""
        with self._changed:
            pose = None if self._odometry is None else self._odometry.pose_at(t)
        return pose if pose is None or self._to_base is None else pose @ self._to_base

    def yaw_at(self, t: float) -> float | None:
        """The heading by the gyro at a stamp; None where it was not measured."""
        with self._changed:
            return self._gyro.integral_at(t)

    @property
    def has_odometry(self) -> bool:
        """Whether any came."""
        return self._odometry is not None and bool(self._odometry.t)

    @property
    def late(self) -> int:
        """How many samples came after newer ones."""
        return sum(one.late for one in (self._of_topic, self._gyro, *self._of_tf.values()))

    def _moving(self, laser: str) -> str | None:
        """The frame that the odometry is of: tf's, where the laser sits on it, else the topic's."""
        if self._wanted != "topic":
            carrying = [child for child in self._of_tf if self.frames.carries(child, laser)]
            if carrying:
                return carrying[0]
        return self._child if self._wanted in ("auto", "topic") else None

    def _choose(self, moving: str | None) -> None:
        """Settle on one odometry, as another one later would be a jump, and on the gyro's axis."""
        if self._wanted != "topic" and moving in self._of_tf:
            self.source, self._odometry = "tf", self._of_tf[moving]
        elif self._wanted in ("auto", "topic"):
            self.source, self._odometry = "topic", self._of_topic
        if moving is not None and moving != self.frames.base:
            matrix = self.frames.base_in(moving)
            notes = self.frames.notes
            self._to_base = None if matrix is None else planar(matrix, "the base", notes)[0]
        self._settled = True
        self._integrate()

    def _integrate(self) -> None:
        """Integrate the gyro's readings about the base's upright axis, once the base is known."""
        del self._early[:-MAX_EARLY_READINGS]
        if not self._settled:
            return
        for t, frame, rates in self._early:
            if frame not in self._upright:
                self._upright[frame] = self._axis(frame)
            axis = self._upright[frame]
            rate = rates[2] if axis is None else sum(map(float.__mul__, rates, axis.tolist()))
            self._gyro.push(t, rate)
        self._early.clear()

    def _axis(self, frame: str) -> Floats | None:
        """The base's upright axis in the gyro's frame (3,); None, noted, where tf lacks it."""
        matrix = self.frames.in_base(frame)
        if matrix is None:
            self.frames.notes.append(
                f"no transform to the gyro's frame '{frame}'; it is taken as upright"
            )
        return None if matrix is None else matrix[2, :3]

    def _decoded(self, record: Record) -> Any:
        """The message; None, counted, where it cannot be read."""
        try:
            return store().deserialize_cdr(record.data, record.msgtype)
        except Exception:  # the library's parsers raise what they stumble over
            self.unreadable += 1
            return None
