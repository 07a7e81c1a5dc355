"""The picture of one particle's history."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gmapping.tile_kernels import cell_of
from slams.jit import njit
from slams.types import Floats


@njit
def draw(
    points: Floats,
    sensor: Floats,
    resolution: float,
    corner: NDArray[np.int64],
    hits: NDArray[np.int32],
    visits: NDArray[np.int32],
) -> None:
    """Count for every cell how often a beam ended in it and how often one came by.

    [Grisetti07] original code, map of the best particle; Bresenham's line.
    points (n, 2), sensor (2,) m in the map; corner (2,) ix, iy of hits[0, 0]; counts (ny, nx).
    """
    sx, sy = cell_of(sensor[0], resolution) - corner[0], cell_of(sensor[1], resolution) - corner[1]
    height, width = visits.shape
    for i in range(points.shape[0]):
        ex = cell_of(points[i, 0], resolution) - corner[0]
        ey = cell_of(points[i, 1], resolution) - corner[1]
        x, y = sx, sy
        dx, dy = abs(ex - sx), abs(ey - sy)
        step_x, step_y = (1 if ex > sx else -1), (1 if ey > sy else -1)
        error = dx - dy
        while x != ex or y != ey:
            if 0 <= x < width and 0 <= y < height:
                visits[y, x] += 1
            twice = 2 * error
            if twice > -dy:
                error -= dy
                x += step_x
            if twice < dx:
                error += dx
                y += step_y
        if 0 <= x < width and 0 <= y < height:
            visits[y, x] += 1
            hits[y, x] += 1
