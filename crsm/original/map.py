"""ByteMap: gray levels in bytes, drawn beam by beam, that grows with the scans."""

from __future__ import annotations

import numpy as np

from crsm.original import map_kernels as kernels
from crsm.original.params import OriginalParams
from crsm.original.scan import RayPicker
from slams.grid_bounds import Box, GridBounds
from slams.types import OccupancyGrid, Pose2

INTENSITY = (0.04, 0.2)  # bounds of what a scan's mean range difference weighs
BOLD_SCANS = 10  # drawn with full intensity
PATCH_VALUE = 200


class ByteMap:
    """The map of the program: `cells` (ny, nx) bytes, the start in the cell `origin` (x, y).

    `scores` (ny, nx) is scratch of the search, of the same size.
    """

    def __init__(self, params: OriginalParams) -> None:
        self.params = params
        self.extent = GridBounds(params.max_cells, params.cell)
        self.cells = np.full((params.side, params.side), kernels.UNKNOWN, np.uint8)
        self.scores = np.zeros_like(self.cells, np.int16)
        self.origin = np.array([params.side // 2, params.side // 2])
        self._tables = np.zeros((3, 256), np.int64)
        self._grow = np.zeros(4, np.int64)
        self._drawn = 0

    def draw(self, view: RayPicker, x: int, y: int, theta: float) -> None:
        """Grow where the scan needs it and may, then draw every beam, seen from cell (x, y)."""
        p = self.params
        if not self.extent.admits(Box.around(x * p.cell, y * p.cell, float(view.d.max()))):
            return
        directions = view.directions(theta)
        kernels.reach(view.d, directions, self._at(x, y), self.cells.shape, p.cell, self._grow)
        if self._grow.any():
            self._enlarge()
        at = self._at(x, y)
        low, high = INTENSITY
        intensity = high if self._drawn < BOLD_SCANS else min(max(view.density, low), high)
        hit = p.density * p.obstacle_density
        kernels.intensity_tables(intensity, p.density, hit, self._tables)
        increment = view.laser.angle_increment
        kernels.draw(view.d, view.ends, directions, increment, at, p.cell, self._tables, self.cells)
        self._drawn += 1

    def draw_patch(self, mount: Pose2) -> None:
        """The robot's own footprint is free; the laser stands at the origin."""
        p = self.params
        half_w, half_l = int(p.robot_width / p.cell / 2), int(p.robot_length / p.cell / 2)
        back = int(mount.x / p.cell)
        x, y = int(self.origin[0]) - back, int(self.origin[1])
        self.cells[y - half_w : y + half_w, x - half_l : x + half_l] = PATCH_VALUE

    def occupancy(self, mount: Pose2) -> OccupancyGrid:
        """The bytes as probabilities; 127 is unknown."""
        p = (1.0 - self.cells / 255.0).astype(np.float32)
        p[self.cells == kernels.UNKNOWN] = np.nan
        cell = self.params.cell
        corner = (mount.x - self.origin[0] * cell, mount.y - self.origin[1] * cell)
        return OccupancyGrid(p, cell, (float(corner[0]), float(corner[1])))

    def _at(self, x: int, y: int) -> tuple[float, float]:
        return float(x + self.origin[0]), float(y + self.origin[1])

    def _enlarge(self) -> None:
        left, right, low, high = self._grow.tolist()
        self.cells = np.pad(
            self.cells, ((low, high), (left, right)), constant_values=kernels.UNKNOWN
        )
        self.scores = np.zeros_like(self.cells, np.int16)
        self.origin += (left, low)
