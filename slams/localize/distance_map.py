"""DistanceMap: an occupancy grid with distances to walls, to which scans are fitted."""

from __future__ import annotations

import math
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from slams.localize import distance_kernels as kernels
from slams.localize.distance_kernels import Distances
from slams.types import Floats, OccupancyGrid, Pose2

Mask = NDArray[np.bool_]

MAX_RAY_STEP = 255  # cells
MAX_WALL_DISTANCE = 1.0  # m: walls farther from an end point have no weight
# m, + one cell: between an inlier and its wall; between a conflict's wall and its end point
INLIER_DISTANCE, CONFLICT_DISTANCE = 0.1, 0.3
N_FITTED_BEAMS = 180  # of a scan, about: fitted and evaluated
ROBUST_DISTANCES = (0.3, 0.1, 0.05)  # m to a wall, where a weight is a quarter, for each round
STEPS_PER_ROUND = 8  # of Gauss-Newton, at most


class DistanceMap:
    """Distances to walls and to cells that are not free; poses [m] in the map's frame.

    Cells are free below p = 0.5, occupied above. An unknown cell ends a beam, unless most of its
    neighbors are free: it is a gap between distant beams.

    Raises:
        ValueError: the map has no wall, or no free cell.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
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
        gap = cv2.distanceTransform(np.pad(self.free, 1).astype(np.uint8), cv2.DIST_C, 3)
        return np.ascontiguousarray(np.minimum(np.round(gap[1:-1, 1:-1]), MAX_RAY_STEP), np.uint8)

    @cached_property
    def distances(self) -> Distances:
        """The distances as arrays for the kernels."""
        free = (~self.occupied).astype(np.uint8)
        distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        limit = MAX_WALL_DISTANCE / self.resolution
        return Distances(self.gap, np.minimum(distance, limit).astype(np.float32))

    def fit(self, points: Floats, pose: Pose2) -> Pose2:
        """The pose near `pose` at which end points (n, 2) [m] in its frame lie on walls."""
        inner = self.in_cells(pose)
        softs = np.array(ROBUST_DISTANCES) / self.resolution
        kernels.fit(self.distances, self._thinned(points), softs, STEPS_PER_ROUND, inner)
        x, y = (inner[:2] * self.resolution + self.origin).tolist()
        return Pose2(x, y, math.atan2(math.sin(inner[2]), math.cos(inner[2])))

    def evaluate(self, points: Floats, pose: Pose2) -> tuple[float, float]:
        """Inlier ratio and free-space conflict of beams with end points (n, 2) [m] at a pose."""
        near, before = (d / self.resolution + 1.0 for d in (INLIER_DISTANCE, CONFLICT_DISTANCE))
        points, inner = self._thinned(points), self.in_cells(pose)
        return kernels.evaluate(self.distances, points, inner, near, before)

    def in_cells(self, pose: Pose2) -> Floats:
        """A pose as x, y [cell], theta."""
        x, y = ((np.array(pose[:2]) - self.origin) / self.resolution).tolist()
        return np.array([x, y, pose.theta])

    def _thinned(self, points: Floats) -> Floats:
        """About `N_FITTED_BEAMS` of the end points, evenly spaced [cell]."""
        return points[:: max(1, len(points) // N_FITTED_BEAMS)] / self.resolution
