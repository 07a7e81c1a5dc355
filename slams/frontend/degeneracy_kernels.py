"""Kernel of degeneracy: scatter of the normals of a scan."""

from __future__ import annotations

from slams.jit import njit
from slams.scan.scan_kernels import Points


@njit
def scatter(normals: Points, n: int) -> tuple[float, float, float]:
    """Integrals of n n^T along the surfaces of a scan [m]: xx, xy, yy.

    normals (3, >= n): vectors along the normals, 0 where none is known, and the gap to the
    neighbors [m]. ours: weighted by length, since a near leg has as many beams as a wall.
    """
    xx = xy = yy = 0.0
    for i in range(n):
        x, y = normals[0, i], normals[1, i]
        square = x * x + y * y
        if square > 0.0:
            w = normals[2, i] / square
            xx += w * x * x
            xy += w * x * y
            yy += w * y * y
    return xx, xy, yy
