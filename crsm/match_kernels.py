"""What the map says of a pose, by the points of a scan."""

from __future__ import annotations

import math
from typing import Any

from crsm.map_kernels import WallMap, darkness
from crsm.rays_kernels import add_measured, measured
from slams.jit import njit
from slams.scan.scan_kernels import Points
from slams.types import Floats


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


@njit
def told(
    grid: WallMap, points: Points, normals: Points, rays: Any, pose: Any, noise: Any, H: Floats
) -> None:
    """ours: the information (3, 3) of the points `rays` about the pose they climbed to, into `H`.

    Each tells by how dark the map is at its end; noise as in `leverage`. Lone points tell nothing:
    along a corridor most of them lie on its walls, where beams are too far apart for normals.
    """
    x0, y0, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    for i in range(3):
        for k in range(3):
            H[i, k] = 0.0
    for i in rays:
        px, py = points[0, i], points[1, i]
        x, y = c * px - s * py, s * px + c * py
        nx, ny, variance, lone = measured(normals, i, noise)
        here = min(darkness(grid, x + x0, y + y0), 1.0)
        if here > 0.0 and not lone:
            normal = c * nx - s * ny, s * nx + c * ny
            add_measured(x, y, (*normal, variance / here, lone), H)
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
