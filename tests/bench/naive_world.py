"""Slow, obvious twins of the ray casting kernels."""

import math

import numpy as np


def cast(occupied, resolution, origin, ray):
    """Nearest entry into any occupied square, by the slab method over all of them."""
    iy, ix = np.nonzero(occupied)
    best = math.inf
    for low_x, low_y in zip(origin[0] + ix * resolution, origin[1] + iy * resolution, strict=True):
        best = min(best, _entry(ray, low_x, low_y, resolution))
    return best


def _entry(ray, low_x, low_y, edge):
    x, y, angle = ray
    enter, leave = 0.0, math.inf
    for start, step, low in ((x, math.cos(angle), low_x), (y, math.sin(angle), low_y)):
        if step == 0.0:
            if not low <= start <= low + edge:
                return math.inf
            continue
        a, b = sorted(((low - start) / step, (low + edge - start) / step))
        enter, leave = max(enter, a), min(leave, b)
    return enter if enter <= leave else math.inf
