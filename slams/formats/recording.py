"""Reads a log or a trajectory from a bag: topics, messages, frames, then time series."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TypeVar

import numpy as np

from slams.formats.bag import Bag, Topic, joined_bags, open_bag
from slams.formats.frames import Transforms, composed, planar, without_slash
from slams.formats.kind import kind_of
from slams.formats.messages import Messages, imu_series
from slams.formats.options import DamagedError, SourceOptions, name_in_errors
from slams.formats.packed import name_of
from slams.formats.sweep import LaserMount, LaserScans, Sweep, has_directions, merged, resampled
from slams.formats.topics import Roles, shortened, topic_list
from slams.ros.messages import IMU_TYPE, ODOMETRY_TYPE, POSE_TYPES, SCAN_TYPES
from slams.scanlog import ScanLog, TimeSeries
from slams.types import IDENTITY
from slams.validation import expect

Result = TypeVar("Result")

KIND_NAMES = {"bag": "ROS 1 bag", "mcap": "ROS 2 mcap", "db3": "ROS 2 db3", "folder": "ROS 2 bag"}


def read(
    paths: Sequence[Path], options: SourceOptions, work: Callable[[Recording], Result]
) -> Result:
    """The result of `work` on a bag of one or several files, or on its undamaged part.

    Raises:
        OSError: a file cannot be opened.
        ValueError: the bag is damaged or lacks something; the sentence names the remedy.
    """
    path, files = paths[0], [(path, kind_of(path)) for path in paths]
    with name_in_errors(paths):
        try:
            with ExitStack() as opened:
                bags = [opened.enter_context(open_bag(*file)) for file in files]
                return work(Recording(*files[0], joined_bags(bags), options))
        except DamagedError as error:
            if not options.salvage:
                raise
            from slams.formats.bag_salvage import salvaged  # loads every decompressor

            bag = joined_bags([salvaged(*file) for file in files])
            if not bag.topics:
                raise DamagedError("nothing in it can be salvaged") from error
            recording = Recording(*files[0], bag, options)
            recording.notes.append(str(error).partition("; ")[0].removeprefix(f"{path}: "))
            return work(recording)


class Recording:
    """Reads one bag; `notes` are for the user."""

    def __init__(self, path: Path, kind: str, bag: Bag, options: SourceOptions) -> None:
        self.path, self.kind, self.options = path, kind, options
        self.notes: list[str] = []
        self.topics = [topic for topic in bag.topics if topic.messages and topic.name]
        self.messages = Messages(bag, options.salvage)
        self.tree = self.messages.transforms

    def log(self) -> ScanLog:
        """The bag as a log."""
        self._collect()
        odom, odometry = self._odometry()
        truth, true_source = self._truth()
        rate, attitude = self._inertial()
        scans = [self._laser_scans(topic, attitude is not None) for topic in self.roles.scans]
        t, ranges, laser_of = merged(scans)
        source = {
            "format": KIND_NAMES[self.kind],
            "file": self.path.resolve().name,
            "scans": ", ".join(self.roles.scans),
            "odometry": odometry,
            "yaw_rate": self.roles.imu if rate else None,
            "truth": true_source,
            "base_frame": self.base,
            "laser_frame": self.laser,
        }
        return ScanLog(
            t,
            ranges,
            scans[0].laser,
            odom,
            truth,
            rate,
            {"name": name_of(self.path), "source": source},
            tuple(dict.fromkeys(self.notes)),
            attitude,
            tuple(one.laser for one in scans[1:]),
            laser_of,
        )

    def poses(self) -> TimeSeries:
        """Only the poses that the options name as the truth.

        Raises:
            ValueError: no such topic or frame, no poses, or poses that are not finite.
        """
        self._collect()
        poses, source = self._truth()
        n_messages = len(self.messages.rows[source or ""])  # 0 for a frame
        n_broken = n_messages - (len(poses.t) if poses else 0)
        if poses is None or n_broken > 0:
            error = f"{n_broken} poses are not finite" if n_broken else "there are no poses"
            raise ValueError(f"{self.options.truth}: {error}; expected a trajectory")
        return poses

    def contents(self) -> tuple[list[Topic], Transforms]:
        """The topics that have messages, and all transforms."""
        self.messages.collect({})
        return self.topics, self.tree

    # messages

    def _collect(self) -> None:
        """Choose topics, read their messages, find the frames of laser and base."""
        self.roles = roles = Roles(self.topics, self.options, self.notes)
        poses = {roles.odom: (ODOMETRY_TYPE,), roles.imu: (IMU_TYPE,), roles.truth: POSE_TYPES}
        wanted: dict[str, Collection[str]] = {name: kinds for name, kinds in poses.items() if name}
        self.messages.collect(wanted | dict.fromkeys(roles.scans, SCAN_TYPES))
        self.laser = self.messages.frame(roles.scans[0])
        if n := self.messages.n_unreadable:
            self.notes.append(f"{n} messages cannot be read and are left out")
        self.base = self._base_frame()

    def _laser_scans(self, topic: str, tilts: bool) -> LaserScans:
        """The scans of a topic; the laser's height is used only if the robot tilts."""
        each = zip(*self.messages.series(topic), strict=True)
        sweeps = [Sweep(float(t), *values) for t, values in each]
        good = [sweep for sweep in sweeps if has_directions(sweep.geometry)]
        if n := len(sweeps) - len(good):
            self.notes.append(f"{n} scans without beams or angles are left out")
        if not good:
            raise ValueError(f"no scan of {topic} has beams")
        if not any(row.stamp for row in self.messages.rows[topic]):
            self.notes.append("scans have no stamps; the times of recording are used")
        frames = sorted({without_slash(row.frame) for row in self.messages.rows[topic]})
        given = f"scans in {len(frames)} frames ({shortened(frames)})"
        expect(len(frames) == 1, topic, given, "those of one laser; each laser needs its own topic")
        mount = self._laser_mount(frames[0])
        return resampled(good, mount if tilts else mount._replace(z=0.0), self.notes)

    # frames

    def _base_frame(self) -> str:
        """The robot's frame: the chosen one, else the odometry's, else base_link or the like."""
        laser, wanted = self.laser, self.options.base_frame
        if wanted is not None:
            if self.tree.fixed_transform(wanted, laser) is None:
                raise ValueError(
                    f"--base-frame: {wanted} is not fixed to the laser's frame {laser}; frames: "
                    f"{shortened(self.tree.frames)}"
                )
            return without_slash(wanted)
        above = self.tree.ancestors(laser)
        odom = self.messages.frame(self.roles.odom) if self.roles.odom else None
        base = self.tree.base_of(laser, odom)
        if base is None and len(above) > 2:
            raise ValueError(
                f"the laser's frame {laser} is below {len(above) - 1} frames, --base-frame picks "
                f"one: {shortened(above[1:])}"
            )
        return base or above[-1]

    def _laser_mount(self, laser: str) -> LaserMount:
        """A laser's mount in the base.

        Transforms without the laser's frame are refused: the laser may be upside down.
        """
        matrix = self.tree.fixed_transform(self.base, laser)
        if matrix is not None and self.base != laser:
            return planar(matrix, "the laser", self.notes)
        if laser != self.laser:
            raise ValueError(
                f"a further laser's frame {laser} is not fixed to {self.base}; frames: "
                f"{shortened(self.tree.frames)}"
            )
        frames = self.tree.frames
        if frames and laser not in frames and self.options.base_frame is None:
            # a split ROS 1 bag has its static transforms in the first file only
            raise ValueError(
                f"no transform from its frames ({shortened(frames)}) to the laser's frame {laser}: "
                f"the mount is in /tf_static, of a split bag in the first file; give all files, or "
                f"--base-frame {laser} takes it as the base"
            )
        self.notes.append(
            f"no transform from a base to the laser's frame '{laser}'; the laser is taken as the "
            "base"
        )
        return LaserMount(IDENTITY)

    # time series

    def _odometry(self) -> tuple[TimeSeries | None, str | None]:
        wanted = self.options.odom
        if self.roles.odom is None and wanted is None:
            frames = [frame for frame in self._frames_above() if "odom" in frame.lower()]
            if still := [frame for frame in frames if frame in self.tree.ancestors(self.base)]:
                self.notes.append(f"{shortened(still)} does not move and is no odometry")
                frames = [frame for frame in frames if frame not in still]
            if len(frames) > 1:
                text = f"{len(frames)} odometry frames, --odom picks one (or none)"
                raise ValueError(f"{text}: {shortened(frames)}")
            wanted = frames[0] if frames else "none"
        return self._poses(self.roles.odom, wanted)

    def _truth(self) -> tuple[TimeSeries | None, str | None]:
        """The truth and its source, a topic or else a frame; files are read elsewhere."""
        wanted, topic, frames = self.options.truth, self.roles.truth, self.tree.frames
        if topic is None and (wanted and without_slash(wanted)) not in (None, "none", *frames):
            raise ValueError(
                f"{wanted!r} is no topic, frame or file; topics: "
                f"{topic_list(self.roles.of(POSE_TYPES))}; frames: {shortened(frames)}"
            )
        return self._poses(topic, wanted)

    def _poses(self, topic: str | None, frame: str | None) -> tuple[TimeSeries | None, str | None]:
        """The base's poses on a topic, else in a frame; and their source.

        Poses of another frame that is fixed to the base are transformed to the base.
        """
        if topic is not None:
            poses, child = self.messages.poses(topic), self.messages.frame(topic)
            matrix = self.tree.fixed_transform(child, self.base)
            if poses is None or matrix is None or child == self.base:
                return poses, topic
            to_base = np.array([planar(matrix, "the base", self.notes).pose])
            return TimeSeries(poses.t, composed(poses.values, to_base)), topic
        if frame is None or frame == "none":
            return None, None
        poses = self.tree.poses_in(frame, self.base)
        if poses is None:
            raise ValueError(
                f"{frame!r} is no topic and no frame above {self.base}; such frames: "
                f"{shortened(self._frames_above())}"
            )
        return poses, f"tf {frame}"

    def _frames_above(self) -> list[str]:
        return self.tree.ancestors(self.base, rigid=False)[1:]

    def _inertial(self) -> tuple[TimeSeries | None, TimeSeries | None]:
        """Yaw rate about the vertical, roll and pitch of the base: from the IMU, else from tf."""
        topic = self.roles.imu
        if topic is None:
            return None, self.tree.attitude(self.base)
        rotation = self.tree.imu_axes(self.base, self.messages.frame(topic), self.notes)
        return imu_series(*self.messages.series(topic), rotation)
