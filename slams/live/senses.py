"""What a robot knows beside its scans: odometry, gyro and tf, as they come from other threads."""

from __future__ import annotations

import threading
import time
from typing import Any, NamedTuple

from slams.formats.bag import IMU, ODOMETRY, Record
from slams.formats.frames import planar
from slams.formats.ros_messages import READ
from slams.formats.ros_store import store
from slams.live.frames import Mounted, RobotFrames
from slams.live.timelines import PoseTimeline, RateTimeline, Timeline, all_cover
from slams.ros.stamps import seconds
from slams.types import Floats, Pose2

MOST_EARLY = 4000  # readings of the gyro kept until the base is known


class Turn(NamedTuple):
    """A gyro's reading: stamp [s], the frame it is in, rates about its axes [rad/s]."""

    t: float
    frame: str
    rates: tuple[float, float, float]


class Senses:
    """Takes messages and tells, once the laser's mount is known, what held at a scan's stamp.

    Args:
        frames: the robot's frames.
        odometry: "auto", tf where it has the odometry's frame and else the topic; "tf"; "topic";
            "none", which is tf all the same: map -> odom has to fit it.
        gyro: its integral so far, which goes on.
    """

    def __init__(
        self, frames: RobotFrames, odometry: str = "auto", gyro: RateTimeline | None = None
    ) -> None:
        self.frames, self.unreadable = frames, 0
        self.source: str | None = None  # of the odometry: "tf" or "topic", when chosen
        self._wanted = odometry
        self._odometry: PoseTimeline | None = None
        self._of_topic, self._of_tf = PoseTimeline(), dict[str, PoseTimeline]()
        self._child: str | None = None  # frame the topic's poses are of
        self._step: Pose2 | None = None  # from the frame that the odometry is of to the base
        self._gyro, self._early = gyro or RateTimeline(), list[Turn]()
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
                self._early.append(Turn(seconds(message.header.stamp), frame, tuple(rates)))
                self._turn()
                self._changed.notify_all()

    def take_tf(self, record: Record) -> None:
        """Take transforms that move, or such that do not by the topic's name."""
        message = self._decoded(record)
        if message is not None:
            with self._changed:
                for t, child, pose in self.frames.add(message, record.topic.endswith("static")):
                    self._of_tf.setdefault(child, PoseTimeline()).push(t, pose)
                self._changed.notify_all()

    def moves(self, laser: str) -> bool:
        """Whether tf tells how the laser's base moves: then nothing better will come."""
        with self._changed:
            return self._wanted != "topic" and self._moving(laser) in self._of_tf

    def settle(self, laser: str) -> Mounted | None:
        """Where the laser sits, or None while that is open; the odometry is chosen with it."""
        with self._changed:
            moving = self._moving(laser)
            mounted = self.frames.mounted(laser, moving)
            if mounted is not None:
                self._choose(moving)
                self._settled = True
                self._turn()
            return mounted

    def settle_alone(self, laser: str) -> None:
        """Go on without tf: the laser is the base, and odometry is taken as the laser's."""
        with self._changed:
            self.frames.base = laser
            self._choose(None)
            self._settled = True
            self._turn()

    def wait_for(self, t: float, until: float) -> None:
        """Let odometry and gyro catch up with a stamp, until a time of `time.monotonic` at most."""
        with self._changed:
            lines: list[Timeline] = [self._gyro]
            lines += [self._odometry] if self._odometry is not None else []
            self._changed.wait_for(lambda: all_cover(lines, t), max(0.0, until - time.monotonic()))

    def odometry_at(self, t: float) -> Pose2 | None:
        """The base in the odometry's frame at a stamp; None where it was not measured."""
        with self._changed:
            pose = None if self._odometry is None else self._odometry.pose_at(t)
        return pose if pose is None or self._step is None else pose @ self._step

    def yaw_at(self, t: float) -> float | None:
        """The heading by the gyro at a stamp; None where it was not measured."""
        with self._changed:
            return self._gyro.integral_at(t)

    @property
    def gyro_kept(self) -> list[float]:
        """What the gyro's integral can go on from."""
        with self._changed:
            return list(self._gyro.kept)

    @property
    def has_odometry(self) -> bool:
        """Whether any came."""
        return self._odometry is not None and bool(self._odometry.t)

    @property
    def late(self) -> int:
        """How many samples came after newer ones."""
        lines = [self._of_topic, self._gyro, *self._of_tf.values()]
        return sum(line.late for line in lines)

    def _moving(self, laser: str) -> str | None:
        """The frame that the odometry is of: tf's, where the laser sits on it, else the topic's."""
        if self._wanted != "topic":
            carrying = [child for child in self._of_tf if self.frames.carries(child, laser)]
            if carrying:
                return carrying[0]
        return self._child if self._wanted in ("auto", "topic") else None

    def _choose(self, moving: str | None) -> None:
        """Settle on one odometry; another one later would be a jump."""
        if self._wanted != "topic" and moving in self._of_tf:
            self.source, self._odometry = "tf", self._of_tf[moving]
        elif self._wanted in ("auto", "topic"):
            self.source, self._odometry = "topic", self._of_topic
        base = self.frames.base
        if moving is not None and moving != base:
            matrix = self.frames.base_in(moving)
            self._step = (
                None if matrix is None else planar(matrix, "the base", self.frames.notes)[0]
            )

    def _turn(self) -> None:
        """Integrate the gyro's readings about the base's upright axis, once the base is known."""
        del self._early[:-MOST_EARLY]
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
