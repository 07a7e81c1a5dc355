"""The true world: occupied squares of a grid, from a map, a picture or an arena.

The geometry is exactly the squares of occupied cells, so it serves both as the world to drive in
and as the true map.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slams.formats.occupancy import read_map, read_picture
from slams.types import Floats, OccupancyGrid

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class World:
    """Cells (ny, nx) [iy, ix], row 0 lowest y: `occupied` stop a ray, `unknown` let it pass.

    `resolution` [m] is the size of a cell, `origin` (x, y) [m] the outer corner of cell [0, 0]. A
    robot drives on cells that are neither occupied nor unknown. Beyond the edge nothing is hit.
    """

    occupied: Mask
    unknown: Mask
    resolution: float
    origin: tuple[float, float]

    def __post_init__(self) -> None:
        if not 0.0 < self.resolution < 10.0:
            raise ValueError(f"resolution: got {self.resolution}, expected metres per cell, > 0")
        for mask in (self.occupied, self.unknown):
            mask.flags.writeable = False

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top [m]."""
        ny, nx = self.occupied.shape
        x, y = self.origin
        return x, x + nx * self.resolution, y, y + ny * self.resolution

    @property
    def free(self) -> Mask:
        """Cells known to be empty."""
        return ~(self.occupied | self.unknown)

    @cached_property
    def clearance(self) -> NDArray[np.float32]:
        """From each cell's center to the nearest center (ny, nx) [m] of a cell that is not free."""
        import cv2

        walled = np.pad(self.free, 1).astype(np.uint8)  # the robot cannot leave the map
        cells = cv2.distanceTransform(walled, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        metres: NDArray[np.float32] = cells[1:-1, 1:-1] * np.float32(self.resolution)
        return metres

    @cached_property
    def gap(self) -> NDArray[np.uint8]:
        """Chebyshev distance (ny, nx) [cell] to the nearest occupied cell, 0 inside, at most 255.

        One byte keeps large maps in the cache, and 255 cells suffice for one step.
        """
        import cv2

        if not self.occupied.any():
            return np.full(self.occupied.shape, 255, np.uint8)
        cells = cv2.distanceTransform((~self.occupied).astype(np.uint8), cv2.DIST_C, 3)
        np.minimum(np.round(cells, out=cells), 255.0, out=cells)
        return np.ascontiguousarray(cells, np.uint8)

    @cached_property
    def fingerprint(self) -> str:
        """Hash of the whole geometry."""
        digest = hashlib.sha256(repr((self.occupied.shape, self.resolution, self.origin)).encode())
        digest.update(np.packbits(self.occupied).tobytes())
        digest.update(np.packbits(self.unknown).tobytes())
        return digest.hexdigest()[:32]

    def cast(self, rays: Floats) -> Floats:
        """Exact distance (m,) [m] along each ray (m, 3) x, y, direction; inf is no hit."""
        from bench.sim.world_kernels import cast_rays

        distances = np.empty(len(rays))
        cast_rays(self.gap, self.resolution, np.array(self.origin), rays, distances)
        return distances

    def cells_of(self, points: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices (iy, ix) of the cells that hold points (n, 2) [m], clipped to the grid."""
        ny, nx = self.occupied.shape
        ij = np.floor((points - np.array(self.origin)) / self.resolution).astype(np.intp)
        return np.clip(ij[:, 1], 0, ny - 1), np.clip(ij[:, 0], 0, nx - 1)

    def grid(self) -> OccupancyGrid:
        """The true map: 1 occupied, 0 free, nan unknown."""
        p = self.occupied.astype(np.float32)
        p[self.unknown] = np.nan
        return OccupancyGrid(p, self.resolution, self.origin)


def read_world(path: str | Path, resolution: float | None = None) -> World:
    """A world from a map_server yaml, or from a picture (dark = wall) with its resolution [m].

    A given resolution replaces that of a yaml.

    Raises:
        OSError: a file cannot be opened.
        ValueError: the file is not a map, or its scale is unknown.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file; expected a map_server yaml or a picture")
    if path.suffix.lower() in (".yaml", ".yml"):
        grid = read_map(path)
        return _world(grid.p, grid.resolution if resolution is None else resolution, grid.origin)
    if resolution is None:
        raise ValueError(
            f"{path}: a picture has no scale; give --resolution, the metres per pixel, or the"
            " map's yaml file"
        )
    return _world(read_picture(path), resolution, (0.0, 0.0))


def _world(p: NDArray[np.float32], resolution: float, origin: tuple[float, float]) -> World:
    """Walls have a probability above one half; unknown cells let rays pass."""
    return World(p > 0.5, np.isnan(p), resolution, origin)
