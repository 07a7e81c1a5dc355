"""Ray tracing into a plain map of log-odds at poses that are given."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats, Ranges


class Odds(NamedTuple):
    """Log-odds that a hit and a miss add to a cell, and what those of a cell stay between."""

    hit: float
    miss: float
    low: float
    high: float


class PlainMap(NamedTuple):
    """Cells (ny, nx): their log-odds, and the number of the scan that changed them last."""

    log_odds: Floats
    latest: NDArray[np.int32]


@njit(inner=True)
def _add(grid: PlainMap, iy: int, ix: int, scan: int, change: float, odds: Odds) -> None:
    """Change a cell of the map that this scan has not changed; ours."""
    ny, nx = grid.latest.shape
    if 0 <= ix < nx and 0 <= iy < ny and grid.latest[iy, ix] != scan:
        grid.latest[iy, ix] = scan
        grid.log_odds[iy, ix] = min(max(grid.log_odds[iy, ix] + change, odds.low), odds.high)


@njit(inner=True)
def _miss(grid: PlainMap, ray: Floats, r: float, scan: int, odds: Odds) -> None:
    """Change the cells that a ray passes before the one that it ends in.

    ours: the walk of Amanatides and Woo (1987). ray (3,) x, y [cell], direction; r [cell].
    """
    c, s = math.cos(ray[2]), math.sin(ray[2])
    ix, iy = math.floor(ray[0]), math.floor(ray[1])
    end_x, end_y = math.floor(ray[0] + r * c), math.floor(ray[1] + r * s)
    step_x, step_y = (1 if c > 0.0 else -1), (1 if s > 0.0 else -1)
    per_x, per_y = (1.0 / abs(c) if c else math.inf), (1.0 / abs(s) if s else math.inf)
    next_x = per_x * (ix + 1 - ray[0] if c > 0.0 else ray[0] - ix) if c else math.inf
    next_y = per_y * (iy + 1 - ray[1] if s > 0.0 else ray[1] - iy) if s else math.inf
    for _ in range(abs(end_x - ix) + abs(end_y - iy)):
        _add(grid, iy, ix, scan, odds.miss, odds)
        if next_x < next_y:
            ix += step_x
            next_x += per_x
        else:
            iy += step_y
            next_y += per_y


@njit
def insert_scans(grid: PlainMap, rays: Floats, ranges: Ranges, first: int, odds: Odds) -> None:
    """Add scans to a map, each cell once per scan, hits before misses [Moravec85].

    rays (n, b, 3): start x, y in cells from the outer corner of cell [0, 0], direction; ranges
    (n, b) in cells, those that are not finite tell nothing. `first` is the number of the first
    scan, not 0, which `latest` begins with.
    """
    for k in range(len(rays)):
        for i in range(rays.shape[1]):
            r = ranges[k, i]
            if math.isfinite(r):
                ix = math.floor(rays[k, i, 0] + r * math.cos(rays[k, i, 2]))
                iy = math.floor(rays[k, i, 1] + r * math.sin(rays[k, i, 2]))
                _add(grid, iy, ix, first + k, odds.hit, odds)
        for i in range(rays.shape[1]):
            if math.isfinite(ranges[k, i]):
                _miss(grid, rays[k, i], ranges[k, i], first + k, odds)
