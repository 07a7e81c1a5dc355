"""The transform tree of a bag: where the laser sits, and how one frame moves in another."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from slams.formats.sweep import Mounted
from slams.ros.attitude import headings, roll_and_pitch, up_of
from slams.ros.messages import seconds
from slams.scanlog import TimeSeries
from slams.types import Floats, Pose2, wrap_angle
from slams.validation import MAX_POSE_VALUE

RIGID_TOLERANCE = 1e-4  # [m, and of a quaternion] that a transform moves by rounding
LEVEL = ("base_stabilized", "base_footprint")  # frames that stay level under a tilting base
BASES = ("base_link", "base_footprint")  # REP 105
MAX_TILT = math.radians(10.0)  # [rad] out of the plane that is too much

Edge = tuple[str, str]  # parent, child
Row = tuple[float, ...]  # t, x, y, z, qx, qy, qz, qw


def bare(frame: str) -> str:
    """A frame's name as tf2 has it, without the slash of tf."""
    return frame.lstrip("/")


class Transforms:
    """Transforms by parent and child, each a list of rows."""

    def __init__(self) -> None:
        self.samples: dict[Edge, list[Row]] = {}
        self.static: set[Edge] = set()

    def add(self, message: Any, static: bool) -> dict[Edge, list[Row]]:
        """Take the transforms of a tf message; gives those that are taken."""
        new: dict[Edge, list[Row]] = {}
        for item in message.transforms:
            edge = bare(item.header.frame_id), bare(item.child_frame_id)
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
        """Frames the frame is fixed to, or sits or moves in, from itself up the tree."""
        found = [bare(frame)]
        while (edge := self._above(found[-1], rigid)) and edge[0] not in found:
            found.append(edge[0])
        return found

    def fixed(self, base: str | None, frame: str | None) -> Floats | None:
        """The frame in base, 4 x 4, if both are known and rigidly fixed to each other."""
        if base is None or frame is None:
            return None
        up, over = self._to_root(frame), self._to_root(base)
        shared = next((name for name in up if name in over), None)
        return None if shared is None else np.linalg.inv(over[shared]) @ up[shared]

    def imu_axes(self, base: str | None, frame: str, notes: list[str]) -> Floats | None:
        """From the axes of an IMU to the base's, (3, 3); None, noted, where tf lacks its frame."""
        matrix = self.fixed(base, frame)
        if matrix is None:
            notes.append(f"no transform to the gyro's frame '{frame}'; it is taken as upright")
        return None if matrix is None else matrix[:3, :3]

    def base_of(self, laser: str, moving: str | None) -> str | None:
        """The frame that poses are of, by what the laser is fixed to; None where that is open.

        `moving` is the frame that the odometry is of and comes first, then base_link and
        base_footprint (REP 105), in any namespace.
        """
        if moving and self.fixed(moving, laser) is not None:
            return bare(moving)
        above = self.ancestors(laser)
        usual = [name for base in BASES for name in above if name.rpartition("/")[2] == base]
        return usual[0] if usual else None

    def moving(self, parent: str, frame: str) -> TimeSeries | None:
        """The frame's planar pose in a frame above it, at the stamps of the quickest transform.

        The other transforms are interpolated, never extrapolated: x and y linearly, the heading
        the short way round. One that never changes holds at all times.
        """
        above, parent = self.ancestors(frame, rigid=False), bare(parent)
        if parent not in above[1:]:
            return None
        down = above[above.index(parent) :: -1]
        chain = list(pairwise(down))
        tracks = [_planar_track(self.samples[edge]) for edge in chain]
        alive = [k for k, edge in enumerate(chain) if not self.is_fixed(edge)]
        clock = max(alive or range(len(chain)), key=lambda k: len(np.unique(tracks[k].t)))
        t = tracks[clock].t
        poses = np.zeros((len(t), 3))
        for k, track in enumerate(tracks):
            poses = composed(poses, track.poses_at(t) if k in alive else track.values[:1])
        covered = np.isfinite(poses).all(axis=1)
        return TimeSeries(t[covered], poses[covered]) if covered.any() else None

    def attitude(self, base: str) -> TimeSeries | None:
        """Roll and pitch (k, 2) [rad] of the base in a level frame right above it, if there is one.

        None where the two do not move against each other.
        """
        edge = self.leveled(base)
        if edge is None or self.is_fixed(edge):
            return None
        rows = self.samples[edge]
        return TimeSeries(np.array([row[0] for row in rows]), attitudes_of(rows))

    def leveled(self, base: str) -> Edge | None:
        """The transform from a level frame right above the base, if there is one."""
        edge = self._above(bare(base), rigid=False)
        return edge if edge and edge[0].rpartition("/")[2] in LEVEL else None

    def _above(self, frame: str, rigid: bool) -> Edge | None:
        edges = [edge for edge in self.samples if edge[1] == frame]
        edges = [edge for edge in edges if self.is_fixed(edge)] if rigid else edges
        return edges[0] if edges else None

    def is_fixed(self, edge: Edge) -> bool:
        """Whether a transform is static, or published again and again without a change."""
        rows = self.samples[edge]
        if edge in self.static:
            return True
        return bool(np.ptp(np.array(rows)[:, 1:], axis=0).max() < RIGID_TOLERANCE)

    def _to_root(self, frame: str) -> dict[str, Floats]:
        """The frame in each of its rigid ancestors."""
        names = self.ancestors(frame)
        found = {names[0]: np.eye(4)}
        for child, parent in pairwise(names):
            found[parent] = _matrix(self.samples[parent, child][0]) @ found[child]
        return found


def attitudes_of(rows: list[Row]) -> Floats:
    """Roll and pitch (n, 2) [rad] of the samples of a transform from a level frame."""
    return roll_and_pitch(up_of(np.array(rows)[:, 4:]))


def planar(matrix: Floats, what: str, notes: list[str]) -> Mounted:
    """A pose in space as one in the plane, whether it stands on its head, and its height."""
    upright = float(np.clip(matrix[2, 2], -1.0, 1.0))
    tilt = min(math.acos(upright), math.pi - math.acos(upright))
    if tilt > MAX_TILT:
        notes.append(f"{what} is tilted by {math.degrees(tilt):.0f} degrees; it is taken as level")
    yaw = math.atan2(matrix[1, 0], matrix[0, 0])
    x, y, z = matrix[:3, 3].tolist()
    return Mounted(Pose2(x, y, yaw), upright < 0.0, z)


def composed(a: Floats, b: Floats) -> Floats:
    """Poses a @ b (n, 3), row by row; b may be a single one (1, 3)."""
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    x = a[:, 0] + c * b[:, 0] - s * b[:, 1]
    y = a[:, 1] + s * b[:, 0] + c * b[:, 1]
    poses: Floats = np.stack([x, y, wrap_angle(a[:, 2] + b[:, 2])], axis=1)
    return poses


def _planar_track(rows: list[Row]) -> TimeSeries:
    table = np.array(rows, np.float64)
    return TimeSeries(table[:, 0].copy(), np.column_stack([table[:, 1:3], headings(table[:, 4:])]))


def _matrix(row: Row) -> Floats:
    """4 x 4 of x, y, z and a quaternion of any length."""
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
