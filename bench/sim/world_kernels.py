"""Ray casting against the squares of occupied cells, and against round legs."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats

Cells = NDArray[np.uint8]
Ticks = NDArray[np.int32]

FLOOR_RAY_STEP, N_FLOOR_RAY_HALVINGS = 0.1, 7  # m, horizontal; bisections of the last step


@njit
def _cast(gap: Cells, x: float, y: float, dx: float, dy: float) -> float:
    """Distance [cells] from (x, y) along the unit vector (dx, dy) to the first occupied square.

    ours: the traversal of Amanatides and Woo (1987), but across the largest empty square around a
    cell at once, by `gap` (ny, nx); inf when the ray leaves the map. Borders are computed from
    their index, so rounding errors do not accumulate, and the other cell index stays inside the
    empty square, so a ray cannot pass a corner by rounding.
    """
    ny, nx = gap.shape
    ix, iy = math.floor(x), math.floor(y)
    t = 0.0
    while 0 <= ix < nx and 0 <= iy < ny:
        reach = int(np.int64(gap[iy, ix]))  # signed, for the subtractions
        if reach == 0:
            return t
        tx = ty = math.inf
        if dx > 0.0:
            tx = (ix + reach - x) / dx
        elif dx < 0.0:
            tx = (ix + 1 - reach - x) / dx
        if dy > 0.0:
            ty = (iy + reach - y) / dy
        elif dy < 0.0:
            ty = (iy + 1 - reach - y) / dy
        if tx <= ty:
            t = tx
            ix += reach if dx > 0.0 else -reach
            iy = min(max(math.floor(y + t * dy), iy - reach + 1), iy + reach - 1)
        else:
            t = ty
            iy += reach if dy > 0.0 else -reach
            ix = min(max(math.floor(x + t * dx), ix - reach + 1), ix + reach - 1)
    return math.inf


@njit
def cast_rays(gap: Cells, resolution: float, origin: Floats, rays: Floats, out: Floats) -> None:
    """Distance out (m,) [m] along each ray (m, 3) x, y, direction to the first occupied square.

    ours: exact up to rounding. `gap` (ny, nx): Chebyshev distance in cells to the nearest
    occupied cell, 0 inside one; smaller values are also valid, but slower.
    """
    scale = 1.0 / resolution
    for i in range(len(rays)):
        x = (rays[i, 0] - origin[0]) * scale
        y = (rays[i, 1] - origin[1]) * scale
        out[i] = resolution * _cast(gap, x, y, math.cos(rays[i, 2]), math.sin(rays[i, 2]))


@njit
def occlude(rays: Floats, tick: Ticks, discs: Floats, radius: float, out: Floats) -> None:
    """Shorten out (m,) [m] where a ray (m, 3) meets a disc first.

    ours: intersection of line and circle. Disc k is at discs[tick[i], k] while ray i is measured.
    A disc around the start of the ray is ignored.
    """
    for i in range(len(rays)):
        c, s = math.cos(rays[i, 2]), math.sin(rays[i, 2])
        now = tick[i]
        for k in range(discs.shape[1]):
            dx, dy = discs[now, k, 0] - rays[i, 0], discs[now, k, 1] - rays[i, 1]
            along, across = c * dx + s * dy, c * dy - s * dx
            if abs(across) < radius:
                entry = along - math.sqrt(radius * radius - across * across)
                if 0.0 < entry < out[i]:
                    out[i] = entry


@njit(inner=True)
def floor_at(x: float, y: float, ramps: Floats) -> float:
    """Height [m] of a floor of ramps. ours: two crossing triangle waves.

    `ramps` (4,): slope, horizontal length [m] from a valley to a ridge, two phases.
    """
    u = (x / ramps[1] + ramps[2]) % 2.0 - 1.0
    v = (y / ramps[1] + ramps[3]) % 2.0 - 1.0
    height: float = ramps[0] * ramps[1] * (abs(u) + abs(v))
    return height


@njit
def floor_heights(points: Floats, ramps: Floats, out: Floats) -> None:
    """ours: heights out (m,) [m] at points (m, 2) [m], by `floor_at`."""
    for i in range(len(points)):
        out[i] = floor_at(points[i, 0], points[i, 1], ramps)


@njit(inner=True)
def clears(ray: Floats, t: float, height: float, ramps: Floats) -> bool:
    """Whether a ray (3,) at `height` [m] is above the floor after `t` [m], horizontal. ours."""
    x, y = ray[0] + t * math.cos(ray[2]), ray[1] + t * math.sin(ray[2])
    return height >= floor_at(x, y, ramps)


@njit
def meet_floor(
    rays: Floats, far: Floats, rise: Floats, height: Floats, ramps: Floats, out: Floats
) -> None:
    """Horizontal distance out (m,) [m] at which rays (m, 3) meet a floor of ramps, else inf.

    ours: fixed steps, then bisection. A ray starts at `height` (m,) [m], rises by `rise` (m,) for
    each meter and ends at `far` (m,) [m]; `ramps` (4,) as in `floor_at`.
    """
    for i in range(len(rays)):
        low, high, out[i] = 0.0, FLOOR_RAY_STEP, math.inf
        while low < far[i] and clears(rays[i], high, height[i] + high * rise[i], ramps):
            low, high = high, high + FLOOR_RAY_STEP
        if low < far[i]:
            for _ in range(N_FLOOR_RAY_HALVINGS):
                middle = 0.5 * (low + high)
                if clears(rays[i], middle, height[i] + middle * rise[i], ramps):
                    low = middle
                else:
                    high = middle
            out[i] = high
