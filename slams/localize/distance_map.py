"""DistanceMap: an occupancy grid with the distances that beams and scans are compared with."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from slams.localize import distance_kernels as kernels
from slams.localize.distance_kernels import Distances
from slams.types import Floats, OccupancyGrid, Pose2

Mask = NDArray[np.bool_]

MAX_GAP = 255  # cells of one step of a ray
MAX_DISTANCE = 1.0  # m; walls farther from an end point do not pull
# m, + one cell: an inlier ends so near a wall; a conflict passes a wall so far before its end
INLIER_DISTANCE, CONFLICT_DISTANCE = 0.1, 0.3
BEAMS = 180  # of a scan that are fitted and evaluated
ROBUST_DISTANCES = (0.3, 0.1, 0.05)  # m, distance to a wall that quarters a weight, by rounds
STEPS = 8  # of Gauss-Newton in a round


class DistanceMap:
    """Distances to walls and to what is not free; poses in meters, in the map's frame.

    Cells are free below p = 0.5, occupied above. Unknown cells end a beam without a wall, except
    those mostly surrounded by free ones: gaps between far beams.

    Raises:
        ValueError: the map has no wall, or no free cell.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
        import cv2

        self.resolution = float(grid.resolution)
        self.origin = np.array(grid.origin, np.float64)
        self.occupied: Mask = grid.p > 0.5
        free = grid.p < 0.5
        if not (self.occupied.any() and free.any()):
            raise ValueError(
                f"a map of {self.occupied.sum()} occupied and {free.sum()} free cells; "
                "expected a floor with walls"
            )
        around = cv2.boxFilter(free.astype(np.uint8), -1, (3, 3), normalize=False)
        self.free: Mask = free | (np.isnan(grid.p) & (around > 4))

    @cached_property
    def gap(self) -> NDArray[np.uint8]:
        """Chebyshev distance to the nearest cell that is not free (ny, nx) [cell]."""
        import cv2

        gap = cv2.distanceTransform(np.pad(self.free, 1).astype(np.uint8), cv2.DIST_C, 3)
        return np.ascontiguousarray(np.minimum(np.round(gap[1:-1, 1:-1]), MAX_GAP), np.uint8)

    @cached_property
    def distances(self) -> Distances:
        """What the kernels take."""
        import cv2

        free = (~self.occupied).astype(np.uint8)
        distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        limit = MAX_DISTANCE / self.resolution
        return Distances(self.gap, np.minimum(distance, limit).astype(np.float32))

    def fit(self, points: Floats, pose: Pose2) -> Pose2:
        """The pose near `pose` from which end points (n, 2) [m], in its frame, lie on walls."""
        inner = self.in_cells(pose)
        softs = np.array(ROBUST_DISTANCES) / self.resolution
        kernels.fit(self.distances, self._some(points), softs, STEPS, inner)
        x, y = (inner[:2] * self.resolution + self.origin).tolist()
        return Pose2(x, y, math.atan2(math.sin(inner[2]), math.cos(inner[2])))

    def evaluate(self, points: Floats, pose: Pose2) -> tuple[float, float]:
        """Shares of beams from `pose` to points (n, 2) [m] that are inliers, and in conflict."""
        near, before = (d / self.resolution + 1.0 for d in (INLIER_DISTANCE, CONFLICT_DISTANCE))
        some, inner = self._some(points), self.in_cells(pose)
        return kernels.evaluate(self.distances, some, inner, near, before)

    def in_cells(self, pose: Pose2) -> Floats:
        """A pose as x, y [cell], theta."""
        x, y = ((np.array(pose[:2]) - self.origin) / self.resolution).tolist()
        return np.array([x, y, pose.theta])

    def _some(self, points: Floats) -> Floats:
        """About `BEAMS` of the points, evenly [cell]."""
        return points[:: max(1, len(points) // BEAMS)] / self.resolution
