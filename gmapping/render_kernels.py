"""Kernels of the grid drawn from one particle's history: hits and visits of every cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gmapping.tile_kernels import cell_of
from slams.jit import njit
from slams.types import Floats

COARSE_BITS = 2  # a cell of `coarse_hits` has 4 x 4 cells
MIN_FREE_VISITS, MAX_FREE_HIT_SHARE = 3, 0.15  # visits of a free cell; share of hits among them


class BeamCounts(NamedTuple):
    """Beams that ended in a cell (`hits`), and that passed or ended in it (`visits`), (ny, nx).

    `coarse_hits` (ny / 4, nx / 4): hits of coarse cells; `x0`, `y0`: index of the cell [0, 0];
    the center of a cell is its index * `resolution` [m].
    """

    hits: NDArray[np.int32]
    visits: NDArray[np.int32]
    coarse_hits: NDArray[np.float32]
    x0: int
    y0: int
    resolution: float


@njit(inner=True, borrows=True)
def is_free(counts: BeamCounts, x: float, y: float) -> bool:
    """Whether beams passed a point [m] and did not end there. ours: free-space conflict."""
    u = cell_of(x, counts.resolution) - counts.x0
    v = cell_of(y, counts.resolution) - counts.y0
    if not (0 <= u < counts.hits.shape[1] and 0 <= v < counts.hits.shape[0]):
        return False
    visits = counts.visits[v, u]
    return bool(visits >= MIN_FREE_VISITS and counts.hits[v, u] < MAX_FREE_HIT_SHARE * visits)


@njit
def draw(scan: Floats, counts: BeamCounts, times: int) -> None:
    """Add the beams of a scan to the hits and visits of the cells.

    [Grisetti07] original code, map of the best particle; Bresenham's line. scan (n + 1, 2) m in
    the map: end points, and last the laser; `times` 1, or -1 to remove what was drawn.
    """
    edge, hits, visits = counts.resolution, counts.hits, counts.visits
    sx, sy = cell_of(scan[-1, 0], edge) - counts.x0, cell_of(scan[-1, 1], edge) - counts.y0
    height, width = visits.shape
    for i in range(scan.shape[0] - 1):
        ex, ey = cell_of(scan[i, 0], edge) - counts.x0, cell_of(scan[i, 1], edge) - counts.y0
        x, y = sx, sy
        dx, dy = abs(ex - sx), abs(ey - sy)
        step_x, step_y = (1 if ex > sx else -1), (1 if ey > sy else -1)
        error = dx - dy
        while x != ex or y != ey:
            if 0 <= x < width and 0 <= y < height:
                visits[y, x] += times
            twice = 2 * error
            if twice > -dy:
                error -= dy
                x += step_x
            if twice < dx:
                error += dx
                y += step_y
        if 0 <= x < width and 0 <= y < height:
            visits[y, x] += times
            hits[y, x] += times
            counts.coarse_hits[y >> COARSE_BITS, x >> COARSE_BITS] += times
