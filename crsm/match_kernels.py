"""What the map says of a pose, by all points of a scan."""

from __future__ import annotations

import math
from typing import Any

from crsm.map_kernels import WallMap, darkness
from slams.jit import njit
from slams.scan.scan_kernels import Points


@njit
def evidence(grid: WallMap, points: Points, m: int, pose: Any, every: int) -> Any:
    """ours: share of m points that the map explains at a pose, and that it contradicts.

    Explained: the map is dark there; contradicted: it is white.
    """
    step = grid.cell / grid.fine
    x0, y0, theta = pose
    left, low = grid.corner
    c, s = math.cos(theta), math.sin(theta)
    dark = white = 0.0
    for i in range(0, m, every):
        px, py = points[0, i], points[1, i]
        x, y = c * px - s * py + x0, s * px + c * py + y0
        here = min(darkness(grid, x, y), 1.0)
        dark += here
        ix, iy = math.floor((x - left) / step), math.floor((y - low) / step)
        if 0 <= ix < grid.grey.shape[1] and 0 <= iy < grid.grey.shape[0]:
            white += (1.0 - here) * max(-grid.grey[iy, ix], 0.0)
    n = max((m + every - 1) // every, 1)
    return dark / n, white / n
