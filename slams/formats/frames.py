"""The transform tree of a bag: mounts of lasers, and the motion of one frame in another."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from slams.formats.sweep import LaserMount
from slams.ros.attitude import headings, roll_and_pitch, vertical_of
from slams.ros.messages import seconds
from slams.scanlog import TimeSeries
from slams.types import Floats, Pose2, wrap_angle
from slams.validation import MAX_POSE_VALUE

FIXED_TF_TOLERANCE = 1e-4  # m, and of a quaternion; rounding changes a fixed transform by less
LEVEL_FRAMES = ("base_stabilized", "base_footprint")  # frames that stay level under a tilting base
BASE_FRAMES = ("base_link", "base_footprint")  # REP 105
MAX_MOUNT_TILT = math.radians(10.0)  # rad; a laser that is tilted more is reported

Edge = tuple[str, str]  # parent, child
Row = tuple[float, ...]  # t, x, y, z, qx, qy, qz, qw


def without_slash(frame: str) -> str:
    """A frame's name as in tf2, without the leading slash of tf."""
    return frame.lstrip("/")


class Transforms:
    """Samples of transforms by parent and child frame."""

    def __init__(self) -> None:
        self.samples: dict[Edge, list[Row]] = {}
        self.static: set[Edge] = set()

    def add(self, message: Any, static: bool) -> dict[Edge, list[Row]]:
        """Add the valid transforms of a tf message; gives the added samples."""
        new: dict[Edge, list[Row]] = {}
        for item in message.transforms:
            edge = without_slash(item.header.frame_id), without_slash(item.child_frame_id)
            p, q = item.transform.translation, item.transform.rotation
            row = (seconds(item.header.stamp), p.x, p.y, p.z, q.x, q.y, q.z, q.w)
            if edge[0] != edge[1] and all(abs(value) < MAX_POSE_VALUE for value in row[1:]):
                new.setdefault(edge, []).append(row)
        for edge, rows in new.items():
            self.samples.setdefault(edge, []).extend(rows)
        self.static |= set(new) if static else set()
        return new

    @property
    def frames(self) -> list[str]:
        """Names of all frames."""
        return sorted({frame for edge in self.samples for frame in edge})

    def ancestors(self, frame: str, rigid: bool = True) -> list[str]:
        """The frame and the frames above it; if `rigid` only while the transforms are fixed."""
        found = [without_slash(frame)]
        while (edge := self._parent_edge(found[-1], rigid)) and edge[0] not in found:
            found.append(edge[0])
        return found

    def fixed_transform(self, base: str | None, frame: str | None) -> Floats | None:
        """Pose (4, 4) of the frame in base if fixed transforms connect them, else None."""
        if base is None or frame is None:
            return None
        of_frame, of_base = self._to_root(frame), self._to_root(base)
        shared = next((name for name in of_frame if name in of_base), None)
        return None if shared is None else np.linalg.inv(of_base[shared]) @ of_frame[shared]

    def imu_axes(self, base: str | None, frame: str, notes: list[str]) -> Floats | None:
        """Rotation (3, 3) from an IMU's axes to the base's; None, with a note, if tf lacks it."""
        matrix = self.fixed_transform(base, frame)
        if matrix is None:
            notes.append(f"no transform to the gyro's frame '{frame}'; it is taken as upright")
        return None if matrix is None else matrix[:3, :3]

    def base_of(self, laser: str, moving: str | None) -> str | None:
        """The robot's base frame, one that the laser is fixed to; None if none is found.

        `moving`, the child frame of the odometry, comes first, then base_link and base_footprint
        (REP 105) in any namespace.
        """
        if moving and self.fixed_transform(moving, laser) is not None:
            return without_slash(moving)
        above = self.ancestors(laser)
        found = [name for base in BASE_FRAMES for name in above if name.rpartition("/")[2] == base]
        return found[0] if found else None

    def poses_in(self, parent: str, frame: str) -> TimeSeries | None:
        """The frame's planar poses in a frame above it, at the stamps of the fastest transform.

        The other transforms are interpolated, never extrapolated: x and y linearly, the heading
        by the shorter rotation. A fixed transform holds at all times.
        """
        above, parent = self.ancestors(frame, rigid=False), without_slash(parent)
        if parent not in above[1:]:
            return None
        down = above[above.index(parent) :: -1]
        chain = list(pairwise(down))
        series = [_planar_poses(self.samples[edge]) for edge in chain]
        moving = [k for k, edge in enumerate(chain) if not self.is_fixed(edge)]
        fastest = max(moving or range(len(chain)), key=lambda k: len(np.unique(series[k].t)))
        t = series[fastest].t
        poses = np.zeros((len(t), 3))
        for k, one in enumerate(series):
            poses = composed(poses, one.poses_at(t) if k in moving else one.values[-1:])
        covered = np.isfinite(poses).all(axis=1)
        return TimeSeries(t[covered], poses[covered]) if covered.any() else None

    def attitude(self, base: str) -> TimeSeries | None:
        """Roll and pitch (k, 2) [rad] of the base in a level parent frame.

        None if the parent is not level, or the transform is fixed.
        """
        edge = self.level_edge(base)
        if edge is None or self.is_fixed(edge):
            return None
        rows = self.samples[edge]
        return TimeSeries(np.array([row[0] for row in rows]), attitudes_of(rows))

    def level_edge(self, base: str) -> Edge | None:
        """The transform from a level parent frame to the base, if there is one."""
        edge = self._parent_edge(without_slash(base), rigid=False)
        return edge if edge and edge[0].rpartition("/")[2] in LEVEL_FRAMES else None

    def _parent_edge(self, frame: str, rigid: bool) -> Edge | None:
        edges = [edge for edge in self.samples if edge[1] == frame]
        edges = [edge for edge in edges if self.is_fixed(edge)] if rigid else edges
        return edges[0] if edges else None

    def is_fixed(self, edge: Edge) -> bool:
        """Whether a transform is static, or published repeatedly without a change."""
        rows = self.samples[edge]
        if edge in self.static:
            return True
        return bool(np.ptp(np.array(rows)[:, 1:], axis=0).max() < FIXED_TF_TOLERANCE)

    def _to_root(self, frame: str) -> dict[str, Floats]:
        """Pose (4, 4) of the frame in each frame above it that it is fixed to."""
        names = self.ancestors(frame)
        found = {names[0]: np.eye(4)}
        for child, parent in pairwise(names):
            latest = self.samples[parent, child][-1]  # as in tf2
            found[parent] = _matrix(latest) @ found[child]
        return found


def attitudes_of(rows: list[Row]) -> Floats:
    """Roll and pitch (n, 2) [rad] of n samples of a transform from a level frame."""
    return roll_and_pitch(vertical_of(np.array(rows)[:, 4:]))


def planar(matrix: Floats, what: str, notes: list[str]) -> LaserMount:
    """A pose (4, 4) in space as a planar pose, whether it is upside down, and its height."""
    upright = float(np.clip(matrix[2, 2], -1.0, 1.0))
    tilt = min(math.acos(upright), math.pi - math.acos(upright))
    if tilt > MAX_MOUNT_TILT:
        notes.append(f"{what} is tilted by {math.degrees(tilt):.0f} degrees; it is taken as level")
    yaw = math.atan2(matrix[1, 0], matrix[0, 0])
    x, y, z = matrix[:3, 3].tolist()
    return LaserMount(Pose2(x, y, yaw), upright < 0.0, z)


def composed(a: Floats, b: Floats) -> Floats:
    """Composed poses a @ b (n, 3), row by row; b may be a single pose (1, 3)."""
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    x = a[:, 0] + c * b[:, 0] - s * b[:, 1]
    y = a[:, 1] + s * b[:, 0] + c * b[:, 1]
    poses: Floats = np.stack([x, y, wrap_angle(a[:, 2] + b[:, 2])], axis=1)
    return poses


def _planar_poses(rows: list[Row]) -> TimeSeries:
    table = np.array(rows, np.float64)
    return TimeSeries(table[:, 0].copy(), np.column_stack([table[:, 1:3], headings(table[:, 4:])]))


def _matrix(row: Row) -> Floats:
    """The pose (4, 4) of x, y, z and a quaternion of any norm."""
    x, y, z, w = np.array(row[4:]) / (np.linalg.norm(row[4:]) or 1.0)
    pose = np.eye(4)
    pose[:3, 3] = row[1:4]
    pose[:3, :3] += 2.0 * np.array(
        [
            [-y * y - z * z, x * y - z * w, x * z + y * w],
            [x * y + z * w, -x * x - z * z, y * z - x * w],
            [x * z - y * w, y * z + x * w, -x * x - y * y],
        ]
    )
    return pose
