"""Ray cast: the model scan, what a laser would see of the field."""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.jit import njit
from slams.types import Floats
from tsd.map_kernels import SIDE, Field, read_field

FRONT = 0.71  # cosine between a ray and a layer's axis: a layer beyond shows it only backs
LEAST_SLOPE, MOST_SLOPE = 0.6, 1.5  # of one surface; borders between two have others
EDGE = 1e-6  # m beyond the edge of a tile


class Fan(NamedTuple):
    """Rays `gap` [rad] apart from the first one on, as far as `reach` [m].

    `around` is how many fill a circle, 0 where these do not.
    """

    rays: int
    first: float
    gap: float
    reach: float
    around: int


class Model(NamedTuple):
    """The model scan: `points` (n, 5) x, y [m], normal x, y in the map, range [m], 0 = nothing.

    It was cast by the rays of `fan` from a laser at x, y, heading.
    """

    points: Floats
    fan: Fan
    x: float
    y: float
    heading: float


@njit(inner=True)
def way_out(field: Field, layer: int, x: float, y: float, dx: float, dy: float) -> float:
    """Way [m] along a ray out of an empty tile; 0 in a tile with cells, inf outside. ours: S3."""
    size = field.cell * SIDE
    u, v = (x - field.corner[0]) / size, (y - field.corner[1]) / size
    ix, iy = math.floor(u), math.floor(v)
    if ix < 0 or iy < 0 or iy >= field.slots.shape[1] or ix >= field.slots.shape[2]:
        return math.inf
    if field.slots[layer, iy, ix] >= 0:
        return 0.0
    way = math.inf
    if dx != 0.0:
        way = ((ix + 1.0 if dx > 0.0 else ix) - u) * size / dx
    if dy != 0.0:
        way = min(way, ((iy + 1.0 if dy > 0.0 else iy) - v) * size / dy)
    return way + EDGE


@njit
def cast_ray(
    field: Field, layer: int, x: float, y: float, dx: float, dy: float, reach: float
) -> float:
    """Way [m] along a ray to where one layer's distance falls below zero; inf if nowhere.

    [May14] ray cast; ours: steps as long as the distance itself, tiles without cells are jumped
    over (S3, D12), only one surface's slope is a surface.
    """
    way, last, before = 0.0, 0.0, math.nan
    while way < reach:
        px, py = x + way * dx, y + way * dy
        jump = way_out(field, layer, px, py, dx, dy)
        if jump > 0.0:
            way, before = way + jump, math.nan
            continue
        v, _, _ = read_field(field, layer, px, py)
        if before > 0.0 and v <= 0.0:
            hit = last + (way - last) * before / (before - v)
            at, gx, gy = read_field(field, layer, x + hit * dx, y + hit * dy)
            fall, slope = gx * dx + gy * dy, math.sqrt(gx * gx + gy * gy)
            if LEAST_SLOPE < slope < MOST_SLOPE and fall < 0.0:
                return min(max(hit - at / fall, last), way)
        before, last = v, way
        way += max(v, field.cell) if v == v else field.cell
    return math.inf


@njit
def cast_rays(field: Field, model: Model) -> int:
    """Model scan: of every ray the nearest surface with its normal. Returns how many rays hit.

    [May14] geometry of the scanner from the predicted pose, normal = gradient of the field; ours:
    the layers that a ray can see from the front. Writes model.points.
    """
    n_hits = 0
    fan, out = model.fan, model.points
    for k in range(fan.rays):
        angle = model.heading + fan.first + k * fan.gap
        dx, dy = math.cos(angle), math.sin(angle)
        nearest, seen = fan.reach, -1
        for layer in range(4):
            along = dx if layer % 2 == 0 else dy
            if (along if layer < 2 else -along) > FRONT:
                continue
            way = cast_ray(field, layer, model.x, model.y, dx, dy, nearest)
            if way < nearest:
                nearest, seen = way, layer
        out[k, 4] = 0.0
        if seen < 0:
            continue
        x, y = model.x + nearest * dx, model.y + nearest * dy
        _, gx, gy = read_field(field, seen, x, y)
        slope = math.sqrt(gx * gx + gy * gy)
        if not slope > 0.0:
            continue
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = x, y, gx / slope, gy / slope
        out[k, 4] = nearest
        n_hits += 1
    return n_hits
