"""The robot's frames from tf as it comes: where the laser sits, and what the base is."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from slams.formats.attitude import headings
from slams.formats.frames import Transforms, attitudes_of, bare, planar
from slams.live.series import PoseSeries, Series
from slams.track import MAX_ATTITUDE_GAP
from slams.types import IDENTITY, Pose2

FEW = 20  # transforms kept of each that moves: enough to see that it does


class Mounted(NamedTuple):
    """Where the laser sits: the base's name, the laser in it, whether it is upside down, z [m]."""

    base: str
    mount: Pose2
    flipped: bool
    z: float = 0.0


class RobotFrames:
    """The transform tree of a robot; frames that it is asked for are named without a slash.

    Of its past only the poses in the odometry's frame (`moving`) are kept, and the attitudes of
    frames that tilt against a level one right above (`tilting`), by the frames' names.

    Args:
        base: the frame that poses are of; None leaves it to odometry and tf.
        odom: the odometry's frame.
    """

    def __init__(self, base: str | None, odom: str) -> None:
        self.base = None if base is None else bare(base)
        self.odom = bare(odom)
        self.notes: list[str] = []
        self.tree = Transforms()
        self.moving: dict[str, PoseSeries] = {}
        self.tilting: dict[str, Series] = {}

    def take(self, message: Any, static: bool) -> None:
        """Take a tf message."""
        for edge, rows in self.tree.add(message, static).items():
            child, known = edge[1], self.tree.samples[edge]
            del known[: -1 if edge in self.tree.static else -max(FEW, len(rows))]
            if edge[0] == self.odom:
                series = self.moving.setdefault(child, PoseSeries())
                for row, theta in zip(rows, headings(np.array(rows)[:, 4:]).tolist(), strict=True):
                    series.push(*row[:3], theta)
            is_new = child not in self.tilting
            if edge == self.tree.leveled(child) and not (is_new and self.tree.is_fixed(edge)):
                rows = known if is_new else rows
                tilts = self.tilting.setdefault(child, Series(MAX_ATTITUDE_GAP))
                for row, attitude in zip(rows, attitudes_of(rows).tolist(), strict=True):
                    tilts.push(row[0], *attitude)

    def carries(self, frame: str, laser: str) -> bool:
        """Whether the laser is fixed to a frame, or tilts with a base above it."""
        if self.tree.fixed(frame, laser) is not None:
            return True
        edge = self.tree.leveled(self.tree.ancestors(laser)[-1])
        return edge is not None and frame in self.tree.ancestors(edge[0])

    def mounted(self, laser: str, moving: str | None) -> Mounted | None:
        """Where the laser sits, or None while tf leaves that open.

        Args:
            laser: the frame of the scans.
            moving: the frame that the odometry is of; it is the base where none was asked for.
        """
        base = self.base or self.tree.base_of(laser, moving)
        if base is None:
            return None
        matrix = self.tree.fixed(base, laser)
        if matrix is None:
            return None
        self.base = base
        if base == laser:
            return Mounted(base, IDENTITY, False)
        mount, flipped = planar(matrix, "the laser", self.notes)
        return Mounted(base, mount, flipped, float(matrix[2, 3]))
