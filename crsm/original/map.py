"""ByteMap: a grid of gray levels in bytes that grows with the scans."""

from __future__ import annotations

import numpy as np

from crsm.original import map_kernels as kernels
from crsm.original.params import OriginalParams
from crsm.original.scan import RayPicker
from slams.grid_bounds import Box, GridBounds
from slams.types import OccupancyGrid, Pose2

MIN_INTENSITY, MAX_INTENSITY = 0.04, 0.2  # m; bounds of a scan's mean range difference in it
N_MAX_INTENSITY_SCANS = 10  # scans at the start, drawn with the maximum intensity
FOOTPRINT_VALUE = 200  # gray level of 255


class ByteMap:
    """The program's map: `cells` (ny, nx) bytes; the start is in the cell `origin` (x, y).

    `scores` (ny, nx) is a buffer of the search, of the same size.
    """

    def __init__(self, params: OriginalParams) -> None:
        self.params = params
        self.bounds = GridBounds(params.max_cells, params.cell)
        self.cells = np.full((params.side, params.side), kernels.UNKNOWN_VALUE, np.uint8)
        self.scores = np.zeros_like(self.cells, np.int16)
        self.origin = np.array([params.side // 2, params.side // 2])
        self._tables = np.zeros((3, 256), np.int64)
        self._missing = np.zeros(4, np.int64)
        self._n_drawn = 0

    def draw(self, scan: RayPicker, x: int, y: int, theta: float) -> None:
        """Grow to the end points of a scan, if the bounds allow it; draw it from cell (x, y)."""
        p = self.params
        if not self.bounds.admits(Box.around(x * p.cell, y * p.cell, float(scan.d.max()))):
            return
        directions = scan.directions(theta)
        missing, shape = self._missing, self.cells.shape
        kernels.missing_cells(scan.d, directions, self._at(x, y), shape, p.cell, missing)
        if missing.any():
            self._enlarge()
        at = self._at(x, y)
        intensity = min(max(scan.density, MIN_INTENSITY), MAX_INTENSITY)
        intensity = MAX_INTENSITY if self._n_drawn < N_MAX_INTENSITY_SCANS else intensity
        hit = p.density * p.obstacle_density
        kernels.intensity_tables(intensity, p.density, hit, self._tables)
        increment = scan.laser.angle_increment
        kernels.draw(scan.d, scan.ends, directions, increment, at, p.cell, self._tables, self.cells)
        self._n_drawn += 1

    def draw_footprint(self, mount: Pose2) -> None:
        """Make the robot's footprint at the start free; the laser is at the origin."""
        p = self.params
        half_w, half_l = int(p.robot_width / p.cell / 2), int(p.robot_length / p.cell / 2)
        back = int(mount.x / p.cell)
        x, y = int(self.origin[0]) - back, int(self.origin[1])
        self.cells[y - half_w : y + half_w, x - half_l : x + half_l] = FOOTPRINT_VALUE

    def occupancy(self, mount: Pose2) -> OccupancyGrid:
        """The gray levels as probabilities of occupied, nan where unknown."""
        p = (1.0 - self.cells / 255.0).astype(np.float32)
        p[self.cells == kernels.UNKNOWN_VALUE] = np.nan
        cell = self.params.cell
        corner = (mount.x - self.origin[0] * cell, mount.y - self.origin[1] * cell)
        return OccupancyGrid(p, cell, (float(corner[0]), float(corner[1])))

    def _at(self, x: int, y: int) -> tuple[float, float]:
        """Cells from the corner of the map, by cells from the start."""
        return float(x + self.origin[0]), float(y + self.origin[1])

    def _enlarge(self) -> None:
        left, right, low, high = self._missing.tolist()
        added, unknown = ((low, high), (left, right)), kernels.UNKNOWN_VALUE
        self.cells = np.pad(self.cells, added, constant_values=unknown)
        self.scores = np.zeros_like(self.cells, np.int16)
        self.origin += (left, low)
