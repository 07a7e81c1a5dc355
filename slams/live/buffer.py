"""The sensor buffer: stores odometry, IMU and tf, and interpolates them at a scan's stamp."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

import numpy as np

from slams.formats.frames import Transforms, attitudes_of, planar, without_slash
from slams.formats.sweep import LaserMount
from slams.live.series import IntegralSeries, PoseSeries, Series
from slams.ros import messages as ros
from slams.ros.attitude import ImuAttitude, headings
from slams.time_series import MAX_ATTITUDE_GAP
from slams.types import IDENTITY, Attitude, Pose2

MAX_EARLY_IMU_READINGS = 4000  # kept until the base is known: 20 s at 200 Hz
MIN_KEPT_TRANSFORMS = 20  # samples kept of a moving transform: enough to detect that it moves


class SensorBuffer:
    """Stores messages; once the laser's mount is known, gives the measurements at a stamp.

    The history of tf is kept for the odometry's frame and for frames below a level parent only.

    Args:
        base: the robot's frame, whose poses are computed; None: chosen by odometry and tf.
        odom: the odometry's frame.
        odometry: "auto" (tf where it has the odometry's frame, else the topic), "tf", "topic" or
            "none" ("none" still reads tf, because map -> odom has to match it).
    """

    def __init__(self, base: str | None, odom: str, odometry: str = "auto") -> None:
        self.base = None if base is None else without_slash(base)
        self.tree, self.unreadable = Transforms(), 0
        self.notes: list[str] = []
        self.source: str | None = None  # of the odometry, "tf" or "topic", once chosen
        self.lacks_odometry = False  # whether it has to come from tf, which has none
        self._odom, self._odometry_choice = without_slash(odom), odometry
        self._odometry: PoseSeries | None = None
        self._topic_odometry = PoseSeries()
        self._tf_odometry: dict[str, PoseSeries] = {}  # by child frame
        self._tf_attitudes: dict[str, Series] = {}  # by child frame
        self._topic_child: str | None = None  # child frame of the odometry topic
        self._to_base: Pose2 | None = None  # the base in the odometry's child frame
        self._gyro = IntegralSeries()
        self._early_imu = list[tuple[str, ros.ImuReading]]()  # frame and reading
        self._imu: ImuAttitude | None = None
        self._attitude = Series(MAX_ATTITUDE_GAP)
        self._is_configured = False
        self._changed = threading.Condition()

    def put(self, record: ros.Record) -> None:
        """Store odometry, an IMU reading or transforms; the topic's name marks static ones."""
        try:
            message = ros.typestore().deserialize_cdr(record.data, record.msgtype)
        except Exception:  # the library's parsers raise errors of any class
            self.unreadable += 1
            return
        with self._changed:
            if record.msgtype == ros.TF_TYPE:
                self._put_tf(message, record.topic.endswith("static"))
            elif record.msgtype == ros.ODOMETRY_TYPE:
                child, pose = ros.READERS[ros.ODOMETRY_TYPE](message)
                self._topic_child = child or self._topic_child
                self._topic_odometry.push(ros.seconds(message.header.stamp), *pose)
            else:
                self._early_imu.append(ros.READERS[ros.IMU_TYPE](message))
                self._add_imu_readings()
            self._changed.notify_all()

    def mount_of(self, laser: str) -> LaserMount | None:
        """A laser's mount, None while unknown; the first one found selects odometry's source."""
        with self._changed:
            source, moving, series = self._select_odometry(laser)
            base = self.base or self.tree.base_of(laser, moving)
            matrix = self.tree.fixed_transform(base, laser)
            self.lacks_odometry = source is None and self._odometry_choice == "tf"
            if base is None or matrix is None or (self.lacks_odometry and not self._is_configured):
                return None
            self.base = base
            if not self._is_configured:
                self.source, self._odometry = source, series
                self._configure(moving)
            if base == laser:
                return LaserMount(IDENTITY)
            return planar(matrix, "the laser", self.notes)

    def at(
        self, t: float, until: float = -math.inf
    ) -> tuple[Pose2 | None, float | None, Attitude | None]:
        """The base in the odometry's frame, the gyro's heading [rad] and the attitude at a stamp.

        Each is None where it was not measured. Waits for samples up to the time `until` [s,
        monotonic]. The attitude comes from the IMU, or else from tf.
        """
        with self._changed:
            sources = [self._gyro, self._attitude, self._odometry or self._gyro]
            timeout = max(0.0, until - time.monotonic())
            self._changed.wait_for(lambda: not any(one.is_behind(t) for one in sources), timeout)
            pose = None if self._odometry is None else self._odometry.pose_at(t)
            yaw, tilt = self._gyro.at(t), self._attitude.at(t)
        if pose is not None and self._to_base is not None:
            pose = pose @ self._to_base
        return pose, None if yaw is None else yaw[0], None if tilt is None else Attitude(*tilt)

    @property
    def has_odometry(self) -> bool:
        """Whether any odometry was received."""
        return self._odometry is not None and bool(self._odometry.t)

    @property
    def frames(self) -> list[str]:
        """Names of all frames in tf."""
        with self._changed:
            return self.tree.frames

    @property
    def is_moved_by_tf(self) -> bool:
        """Whether tf has the base in the odometry's frame, also if it began too late."""
        with self._changed:
            return any(self._moves_with(child, self.base or "") for child in self._tf_odometry)

    def _put_tf(self, message: Any, static: bool) -> None:
        for edge, rows in self.tree.add(message, static).items():
            child, kept = edge[1], self.tree.samples[edge]
            del kept[: -1 if edge in self.tree.static else -max(MIN_KEPT_TRANSFORMS, len(rows))]
            if edge[0] == self._odom:
                series = self._tf_odometry.setdefault(child, PoseSeries())
                for row, theta in zip(rows, headings(np.array(rows)[:, 4:]).tolist(), strict=True):
                    series.push(*row[:3], theta)
            is_new = child not in self._tf_attitudes
            if edge == self.tree.level_edge(child) and not (is_new and self.tree.is_fixed(edge)):
                rows = kept if is_new else rows
                tilts = self._tf_attitudes.setdefault(child, Series(MAX_ATTITUDE_GAP))
                for row, attitude in zip(rows, attitudes_of(rows).tolist(), strict=True):
                    tilts.push(row[0], *attitude)

    def _select_odometry(self, laser: str) -> tuple[str | None, str | None, PoseSeries | None]:
        """Source, child frame and poses of the odometry: tf if it moves the laser, else topic."""
        if self._odometry_choice != "topic":
            for child, series in self._tf_odometry.items():
                if self._moves_with(child, laser):
                    return "tf", child, series
        if self._odometry_choice in ("auto", "topic"):
            return "topic", self._topic_child, self._topic_odometry
        return None, None, None

    def _moves_with(self, frame: str, laser: str) -> bool:
        """Whether the laser is fixed to a frame, or to a base that tilts below it."""
        if self.tree.fixed_transform(frame, laser) is not None:
            return True
        edge = self.tree.level_edge(self.tree.ancestors(laser)[-1])
        return edge is not None and frame in self.tree.ancestors(edge[0])

    def _configure(self, moving: str | None) -> None:
        """Fix the sources of odometry and attitude: a later change would be a jump."""
        matrix = self.tree.fixed_transform(moving, self.base)
        if matrix is not None and moving != self.base:
            self._to_base = planar(matrix, "the base", self.notes).pose
        if not self._early_imu and self.base is not None:  # else the IMU gives the attitude
            self._attitude = self._tf_attitudes.setdefault(self.base, self._attitude)
        self._is_configured = True
        self._add_imu_readings()

    def _add_imu_readings(self) -> None:
        """Add the IMU's readings, rotated to the base's axes, once the base is known."""
        del self._early_imu[:-MAX_EARLY_IMU_READINGS]
        if not self._is_configured:
            return
        for frame, measured in self._early_imu:
            if self._imu is None:
                self._imu = ImuAttitude(self.tree.imu_axes(self.base, frame, self.notes))
            t, rate, roll, pitch = self._imu.push(measured)
            self._gyro.push(t, rate)
            self._attitude.push(t, roll, pitch)
        self._early_imu.clear()
