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


def gap(occupied):
    """Chebyshev distance of every cell to the nearest occupied one."""
    places = np.argwhere(occupied)
    ny, nx = occupied.shape
    return np.array(
        [[np.abs(places - (iy, ix)).max(axis=1).min() for ix in range(nx)] for iy in range(ny)]
    )


def room(world, point):
    """Distance of a point to the nearest square that is not free, or to the edge of the map."""
    iy, ix = np.nonzero(~world.free)
    x = world.origin[0] + ix * world.resolution
    y = world.origin[1] + iy * world.resolution
    dx = np.maximum(np.maximum(x - point[0], point[0] - x - world.resolution), 0.0)
    dy = np.maximum(np.maximum(y - point[1], point[1] - y - world.resolution), 0.0)
    left, right, bottom, top = world.extent
    edge = min(point[0] - left, right - point[0], point[1] - bottom, top - point[1])
    return min(float(np.hypot(dx, dy).min()), edge)
