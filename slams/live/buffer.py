"""The sensor buffer: odometry, IMU and tf as they come from other threads, for a scan's stamp."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

import numpy as np

from slams.formats.frames import Transforms, attitudes_of, bare, planar
from slams.formats.sweep import Mounted
from slams.live.series import IntegralSeries, PoseSeries, Series
from slams.ros.attitude import ImuAttitude, headings
from slams.ros.messages import IMU, ODOMETRY, READ, TF, Inertial, Record, seconds, store
from slams.time_series import MAX_ATTITUDE_GAP
from slams.types import IDENTITY, Attitude, Pose2

MAX_EARLY_READINGS = 4000  # of the gyro, kept until the base is known: 20 s at 200 Hz
FEW = 20  # transforms kept of each that moves: enough to see that it does


class SensorBuffer:
    """Takes messages; once the laser's mount is known, gives what was measured at a stamp.

    Of the past of tf only the base's poses in the odometry's frame are kept, and the attitudes of
    frames that tilt against a level one right above.

    Args:
        base: the frame that poses are of; None leaves it to odometry and tf.
        odom: the odometry's frame.
        odometry: "auto", tf where it has the odometry's frame and else the topic; "tf"; "topic";
            "none", which reads tf all the same: map -> odom has to fit it.
    """

    def __init__(self, base: str | None, odom: str, odometry: str = "auto") -> None:
        self.base = None if base is None else bare(base)
        self.tree, self.unreadable = Transforms(), 0
        self.notes: list[str] = []
        self.source: str | None = None  # of the odometry: "tf" or "topic", when chosen
        self._odom, self._wanted = bare(odom), odometry
        self._odometry: PoseSeries | None = None
        self._of_topic = PoseSeries()
        self._moving: dict[str, PoseSeries] = {}  # by frames
        self._tilting: dict[str, Series] = {}  # by frames
        self._child: str | None = None  # frame of the topic's poses
        self._to_base: Pose2 | None = None  # from the frame of the odometry to the base
        self._gyro = IntegralSeries()
        self._early = list[tuple[str, Inertial]]()  # with their frames
        self._imu: ImuAttitude | None = None
        self._attitude = Series(MAX_ATTITUDE_GAP)
        self._settled = False
        self._changed = threading.Condition()

    def take(self, record: Record) -> None:
        """Take odometry, a message of an IMU, or transforms; static ones by their topic's name."""
        try:
            message = store().deserialize_cdr(record.data, record.msgtype)
        except Exception:  # the library's parsers raise what they stumble over
            self.unreadable += 1
            return
        with self._changed:
            if record.msgtype == TF:
                self._take_tf(message, record.topic.endswith("static"))
            elif record.msgtype == ODOMETRY:
                child, pose = READ[ODOMETRY](message)
                self._child = child or self._child
                self._of_topic.push(seconds(message.header.stamp), *pose)
            else:
                self._early.append(READ[IMU](message))
                self._integrate()
            self._changed.notify_all()

    def mounted(self, laser: str) -> Mounted | None:
        """Where a laser sits, or None while that is open; with the first one odometry is chosen."""
        with self._changed:
            source, moving, series = self._odometry_for(laser)
            base = self.base or self.tree.base_of(laser, moving)
            matrix = self.tree.fixed(base, laser)
            if base is None or matrix is None:
                return None
            self.base = base
            if not self._settled:
                self.source, self._odometry = source, series
                self._settle(moving)
            return Mounted(IDENTITY) if base == laser else planar(matrix, "the laser", self.notes)

    def at(
        self, t: float, until: float = -math.inf
    ) -> tuple[Pose2 | None, float | None, Attitude | None]:
        """The base in the odometry's frame, the heading by the gyro, the attitude at a stamp.

        None is what was not measured. All may catch up with the stamp until a time of
        `time.monotonic`. The attitude is by the IMU, or by tf.
        """
        with self._changed:
            sources = [self._gyro, self._attitude, self._odometry or self._gyro]
            left = max(0.0, until - time.monotonic())
            self._changed.wait_for(lambda: not any(one.holds_up(t) for one in sources), left)
            pose = None if self._odometry is None else self._odometry.pose_at(t)
            yaw, tilt = self._gyro.at(t), self._attitude.at(t)
        if pose is not None and self._to_base is not None:
            pose = pose @ self._to_base
        return pose, None if yaw is None else yaw[0], None if tilt is None else Attitude(*tilt)

    @property
    def has_odometry(self) -> bool:
        """Whether any came."""
        return self._odometry is not None and bool(self._odometry.t)

    def _take_tf(self, message: Any, static: bool) -> None:
        for edge, rows in self.tree.add(message, static).items():
            child, known = edge[1], self.tree.samples[edge]
            del known[: -1 if edge in self.tree.static else -max(FEW, len(rows))]
            if edge[0] == self._odom:
                series = self._moving.setdefault(child, PoseSeries())
                for row, theta in zip(rows, headings(np.array(rows)[:, 4:]).tolist(), strict=True):
                    series.push(*row[:3], theta)
            is_new = child not in self._tilting
            if edge == self.tree.leveled(child) and not (is_new and self.tree.is_fixed(edge)):
                rows = known if is_new else rows
                tilts = self._tilting.setdefault(child, Series(MAX_ATTITUDE_GAP))
                for row, attitude in zip(rows, attitudes_of(rows).tolist(), strict=True):
                    tilts.push(row[0], *attitude)

    def _odometry_for(self, laser: str) -> tuple[str | None, str | None, PoseSeries | None]:
        """Odometry's source, frame and poses: tf's where the laser sits on it, else the topic's."""
        if self._wanted != "topic":
            for child, series in self._moving.items():
                if self._carries(child, laser):
                    return "tf", child, series
        if self._wanted in ("auto", "topic"):
            return "topic", self._child, self._of_topic
        return None, None, None

    def _carries(self, frame: str, laser: str) -> bool:
        """Whether the laser is fixed to a frame, or tilts with a base above it."""
        if self.tree.fixed(frame, laser) is not None:
            return True
        edge = self.tree.leveled(self.tree.ancestors(laser)[-1])
        return edge is not None and frame in self.tree.ancestors(edge[0])

    def _settle(self, moving: str | None) -> None:
        """Stay with one odometry and attitude, as another one later would be a jump."""
        matrix = self.tree.fixed(moving, self.base)
        if matrix is not None and moving != self.base:
            self._to_base = planar(matrix, "the base", self.notes).mount
        if not self._early and self.base is not None:  # else the IMU has the attitude
            self._attitude = self._tilting.setdefault(self.base, self._attitude)
        self._settled = True
        self._integrate()

    def _integrate(self) -> None:
        """Take the IMU's readings about the base's axes, once the base is known."""
        del self._early[:-MAX_EARLY_READINGS]
        if not self._settled:
            return
        for frame, measured in self._early:
            if self._imu is None:
                self._imu = ImuAttitude(self.tree.imu_axes(self.base, frame, self.notes))
            t, rate, roll, pitch = self._imu.push(measured)
            self._gyro.push(t, rate)
            self._attitude.push(t, roll, pitch)
        self._early.clear()
