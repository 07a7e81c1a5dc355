"""Kernels of ground of old: what key scans of long ago show, and how a scan fits there."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats

BLUR = 0.1  # m, deviation from a wall at which an end still tells of it
REACH = 5  # cells to either side that a wall is blurred
SHORT = 3  # cells before its end from which a beam says nothing of free space
TWICE = 2  # beams that have to go through a cell before it counts as free
NO_WALL = 0.05  # likelihood below which a cell that is free contradicts an end


class Ground(NamedTuple):
    """What was seen long ago, cells [iy, ix] of (ny, nx); `x`, `y` [m] the outer corner.

    `likelihood` 0..1 of an end there, `through` the number of beams that went through.
    """

    likelihood: Floats
    through: NDArray[np.int64]
    x: float
    y: float
    cell: float


@njit
def show(ground: Ground, beams: Floats) -> None:
    """Enter beams (n, 4) [m], end x, y and laser x, y. ours."""
    ny, nx = ground.likelihood.shape
    for x, y, from_x, from_y in beams:
        far = math.hypot(x - from_x, y - from_y)
        for k in range(int(far / ground.cell) - SHORT):
            part = k * ground.cell / far
            i = math.floor((from_x + part * (x - from_x) - ground.x) / ground.cell)
            j = math.floor((from_y + part * (y - from_y) - ground.y) / ground.cell)
            if 0 <= i < nx and 0 <= j < ny:
                ground.through[j, i] += 1
        at_i = math.floor((x - ground.x) / ground.cell)
        at_j = math.floor((y - ground.y) / ground.cell)
        for j in range(max(at_j - REACH, 0), min(at_j + REACH + 1, ny)):
            for i in range(max(at_i - REACH, 0), min(at_i + REACH + 1, nx)):
                dx = ground.x + (i + 0.5) * ground.cell - x
                dy = ground.y + (j + 0.5) * ground.cell - y
                near = math.exp(-0.5 * (dx * dx + dy * dy) / BLUR**2)
                ground.likelihood[j, i] = max(ground.likelihood[j, i], near)


@njit
def fits(ground: Ground, points: Floats, poses: Floats, out: Floats) -> None:
    """How well points (n, 2) [m] fit at poses (k, 3): out (k,), share explained less contradicted.

    A point in free space contradicts; one where nothing was seen says nothing. ours.
    """
    ny, nx = ground.likelihood.shape
    for k in range(len(poses)):
        c, s, told = math.cos(poses[k, 2]), math.sin(poses[k, 2]), 0.0
        for m in range(len(points)):
            x = poses[k, 0] + c * points[m, 0] - s * points[m, 1]
            y = poses[k, 1] + s * points[m, 0] + c * points[m, 1]
            i = math.floor((x - ground.x) / ground.cell)
            j = math.floor((y - ground.y) / ground.cell)
            if 0 <= i < nx and 0 <= j < ny:
                near = ground.likelihood[j, i]
                told += near
                if near < NO_WALL and ground.through[j, i] >= TWICE:
                    told -= 1.0
        out[k] = told / len(points)
