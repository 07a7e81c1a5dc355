"""Chart: an occupancy grid made ready to be looked at from inside."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from slams.localize.chart_kernels import EXPLAINED, REFUTED, Cells, Tolerance, fit, judge
from slams.types import Floats, OccupancyGrid, Pose2

Mask = NDArray[np.bool_]

FAR_GAP = 255  # cells of one leap of a ray
REACH = 1.0  # m; walls farther from a point do not pull
END, WAY = 0.1, 0.3  # m, how well a beam has to agree; + one cell
BEAMS = 180  # that are asked whether they agree
SOFT = (0.3, 0.1, 0.05)  # m, distance to a wall that halves a point's weight, round by round
STEPS = 8  # of Gauss-Newton for each


class Chart:
    """A map with distances to its walls; poses in meters, in the map's frame.

    Cells are free below p = 0.5, occupied above; what was never observed ends a beam's way without
    a wall, except single cells between beams.

    Raises:
        ValueError: the map has no wall, or no free cell.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
        self.resolution = float(grid.resolution)
        self.origin = np.array(grid.origin, np.float64)
        self._corner: tuple[float, float] = (float(grid.origin[0]), float(grid.origin[1]))
        self.occupied: Mask = grid.p > 0.5
        self.free: Mask = _without_holes(grid.p < 0.5, np.isnan(grid.p))
        if not (self.occupied.any() and self.free.any()):
            raise ValueError(
                f"a map of {self.occupied.sum()} occupied and {self.free.sum()} free cells; "
                "expected a floor with walls"
            )
        cell = self.resolution
        self._tolerance = Tolerance((END + cell) / cell, (WAY + cell) / cell)
        self._soft = np.array(SOFT) / cell

    @cached_property
    def gap(self) -> NDArray[np.uint8]:
        """From each cell to the nearest one that is not free (ny, nx) [cell], Chebyshev."""
        import cv2

        gap = cv2.distanceTransform(np.pad(self.free, 1).astype(np.uint8), cv2.DIST_C, 3)
        return np.ascontiguousarray(np.minimum(np.round(gap[1:-1, 1:-1]), FAR_GAP), np.uint8)

    @cached_property
    def cells(self) -> Cells:
        """What kernels take."""
        import cv2

        near = cv2.dilate(self.occupied.astype(np.uint8), np.ones((3, 3), np.uint8))
        wall = (~self.occupied).astype(np.uint8)
        distance = cv2.distanceTransform(wall, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        capped = np.minimum(distance, REACH / self.resolution).astype(np.float32)
        return Cells(self.gap, near.astype(np.bool_), capped)

    @cached_property
    def clearance(self) -> NDArray[np.float32]:
        """From each cell to the nearest one that is not free (ny, nx) [m]."""
        import cv2

        free = np.pad(self.free, 1).astype(np.uint8)
        cells = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
        return np.asarray(cells * self.resolution, np.float32)

    def fit(self, points: Floats, pose: Pose2) -> Pose2:
        """The pose near `pose` from which points (n, 2) [m], in its frame, lie on walls."""
        inner = self._inner(pose)
        fit(self.cells, _some(points) / self.resolution, self._soft, STEPS, inner)
        x, y = (inner[:2] * self.resolution + self.origin).tolist()
        return Pose2(x, y, math.atan2(math.sin(inner[2]), math.cos(inner[2])))

    def explained(self, points: Floats, pose: Pose2) -> tuple[float, float]:
        """Shares of beams, ending in points (n, 2) [m] around `pose`, explained and refuted."""
        said = self.judged(_some(points), pose)
        n = max(len(said), 1)
        return np.count_nonzero(said == EXPLAINED) / n, np.count_nonzero(said == REFUTED) / n

    def judged(self, points: Floats, pose: Pose2) -> NDArray[np.int8]:
        """What of beams (n,) that end in points (n, 2) [m] around `pose`, as `judge` has it."""
        out = np.empty(len(points), np.int8)
        judge(self.cells, points / self.resolution, self._inner(pose), self._tolerance, out)
        return out

    def distances(self, points: Floats, pose: Pose2) -> Floats:
        """From points (n, 2) [m] around `pose` to the nearest wall (n,) [m], `REACH` at most.

        Between the centers of four cells; outside of the map as at its border. By hand: a robot
        that drives would wait for half a second until scipy is there.
        """
        cells = self.cells.distance
        at = (pose.transform(points) - self.origin) / self.resolution - 0.5
        low = np.clip(np.floor(at).astype(np.int64), 0, np.array(cells.shape[::-1]) - 2)
        (x, y), (right, up) = low.T, np.clip(at - low, 0.0, 1.0).T
        below = (1.0 - right) * cells[y, x] + right * cells[y, x + 1]
        above = (1.0 - right) * cells[y + 1, x] + right * cells[y + 1, x + 1]
        return np.asarray(((1.0 - up) * below + up * above) * self.resolution)

    def _inner(self, pose: Pose2) -> Floats:
        """A pose in cells."""
        x, y = self._corner
        return np.array(
            [(pose.x - x) / self.resolution, (pose.y - y) / self.resolution, pose.theta]
        )


def _some(points: Floats) -> Floats:
    """About `BEAMS` of the points, evenly."""
    return points[:: max(1, len(points) // BEAMS)]


def _without_holes(free: Mask, unknown: Mask) -> Mask:
    """Free cells, with those unknown that are mostly surrounded by them: gaps between far beams."""
    import cv2

    around = cv2.blur(free.astype(np.float32), (3, 3))
    return free | (unknown & (around > 0.5))
