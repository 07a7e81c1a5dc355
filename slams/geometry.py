"""Kernels that several algorithms need and that have one right answer."""

from __future__ import annotations

import math

from slams.jit import njit
from slams.types import Floats


@njit(inner=True)
def wrap_angle(angle: float) -> float:
    """The same direction in (-pi, pi] [rad]. ours: compiled twin of `slams.types.wrap_angle`."""
    return angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


@njit(inner=True)
def solve3(H: Floats, b: Floats, out: Floats) -> bool:
    """Solve the symmetric H out = b by Cholesky; False if H is not positive definite.

    ours: by hand, compiling `np.linalg.solve` takes seconds. H (3, 3), b and out (3,).
    """
    l00 = H[0, 0]
    if not l00 > 0.0:
        return False
    l00 = math.sqrt(l00)
    l10, l20 = H[1, 0] / l00, H[2, 0] / l00
    d1 = H[1, 1] - l10 * l10
    if not d1 > 1e-12 * H[1, 1]:
        return False
    l11 = math.sqrt(d1)
    l21 = (H[2, 1] - l20 * l10) / l11
    d2 = H[2, 2] - l20 * l20 - l21 * l21
    if not d2 > 1e-12 * H[2, 2]:
        return False
    l22 = math.sqrt(d2)
    z0 = b[0] / l00
    z1 = (b[1] - l10 * z0) / l11
    z2 = (b[2] - l20 * z0 - l21 * z1) / l22
    out[2] = z2 / l22
    out[1] = (z1 - l21 * out[2]) / l11
    out[0] = (z0 - l10 * out[1] - l20 * out[2]) / l00
    return True
