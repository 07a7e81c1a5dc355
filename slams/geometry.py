"""Kernels that several algorithms need and that have one right answer."""

from __future__ import annotations

import math

from slams.jit import njit


@njit
def wrap_angle(angle: float) -> float:
    """The same direction in (-pi, pi] [rad]. ours: compiled twin of `slams.types.wrap_angle`."""
    return angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))
