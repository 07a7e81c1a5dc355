"""Kernel of degeneracy: which way the surfaces of a scan face."""

from __future__ import annotations

from slams.jit import njit
from slams.scan.scan_kernels import Points


@njit
def scatter(facing: Points, n: int) -> tuple[float, float, float]:
    """Integrals of n n^T along the surfaces of a scan [m].

    ours: by length, not by beams: of a leg beside the laser there are as many as of a wall. facing
    (3, >= n): vectors along the normals, 0 where there is none, and the gap to the neighbors [m].
    """
    xx = xy = yy = 0.0
    for i in range(n):
        x, y = facing[0, i], facing[1, i]
        square = x * x + y * y
        if square > 0.0:
            w = facing[2, i] / square
            xx += w * x * x
            xy += w * x * y
            yy += w * y * y
    return xx, xy, yy
