"""Ray cast: the model scan, what a laser would see of the field."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.geometry import wrap_angle
from slams.jit import FAST, njit
from slams.types import Floats
from tsd.map_kernels import LAYERS, SIDE, Field, read_field

FRONT = 0.71  # cosine between a ray and a layer's axis: a layer beyond shows it only backs
LEAST_SLOPE, MOST_SLOPE = 0.6, 1.5  # of one surface; borders between two have others
BLIND = 2.0  # cells a ray goes where nothing is known: fewer than lie before a surface
EDGE = 1e-6  # m beyond the edge of a tile
Pair = tuple[float, float]


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


@njit(fastmath=FAST, inner=True)
def layers_there(field: Field, ty: int, tx: int, dx: float, dy: float) -> int:
    """Bits of the layers that have cells in a tile and show a ray their front. ours."""
    bits = 0
    for layer in range(4):
        along = dx if layer % 2 == 0 else dy
        if field.slots[ty, tx, layer] > 0 and (along if layer < 2 else -along) <= FRONT:
            bits |= 1 << layer
    return bits


@njit(fastmath=FAST, inner=True)
def way_through(at: float, step: float, size: float) -> float:
    """Way [m] along a ray to the edge of its tile, on one axis; `at` in tiles. ours."""
    if step == 0.0:
        return math.inf
    return (math.floor(at) + (1.0 if step > 0.0 else 0.0) - at) * size / step


@njit(fastmath=FAST, inner=True)
def settle(
    field: Field,
    layer: int,
    model: Model,
    dx: float,
    dy: float,
    ways: Pair,
    sides: Pair,
    out: Floats,
) -> None:
    """The zero of a layer's distance along a ray, if it is a surface's front nearer than out[4].

    The distances `sides`, at two `ways` [m], are positive and not. Original code: linear between
    the two; ours: from the slope there, which must be that of one surface. out (5,) as in `Model`.
    """
    (low, high), (before, after) = ways, sides
    hit = low + (high - low) * before / (before - after)
    at, gx, gy = read_field(field, layer, model.x + hit * dx, model.y + hit * dy)
    fall, slope = gx * dx + gy * dy, math.sqrt(gx * gx + gy * gy)
    if LEAST_SLOPE < slope < MOST_SLOPE and fall < 0.0:
        hit = min(max(hit - at / fall, low), high)
        if hit < out[4]:
            out[0], out[1] = model.x + hit * dx, model.y + hit * dy
            out[2], out[3], out[4] = gx / slope, gy / slope, hit


@njit(fastmath=FAST, inner=True)
def forget_last(before: Floats) -> None:
    """No distance is known at the last step. ours: assigning slices compiles for long."""
    for layer in range(4):
        before[layer] = math.nan


@njit(fastmath=FAST, inner=True)
def cast_ray(field: Field, model: Model, dx: float, dy: float, before: Floats, out: Floats) -> bool:
    """The nearest surface along a ray: out (5,), as a row of `Model.points`; False if nowhere.

    [May14] ray cast; ours: tiles without cells are jumped over to their edges, so that a surface
    beside one is not missed, and steps elsewhere are as long as the least distance. before (4,):
    room.
    """
    size, cell = field.cell * SIDE, field.cell
    way, last = 0.0, 0.0
    out[4] = math.inf
    forget_last(before)
    while way < model.fan.reach:
        x, y = model.x + way * dx, model.y + way * dy
        u, v = (x - field.corner[0]) / size, (y - field.corner[1]) / size
        tx, ty = math.floor(u), math.floor(v)
        if tx < 0 or ty < 0 or ty >= field.slots.shape[0] or tx >= field.slots.shape[1]:
            break
        bits = layers_there(field, ty, tx, dx, dy)
        if bits == 0:
            forget_last(before)
            way += min(way_through(u, dx, size), way_through(v, dy, size)) + EDGE
            continue
        step = math.inf
        for layer in range(4):
            sd = math.nan
            if bits & (1 << layer):
                sd, _, _ = read_field(field, layer, x, y)
            if before[layer] > 0.0 and sd <= 0.0:
                settle(field, layer, model, dx, dy, (last, way), (before[layer], sd), out)
            before[layer] = sd
            if sd > 0.0:
                step = min(step, sd)
        if out[4] < math.inf:
            return True
        last = way
        way += max(step, cell) if step < math.inf else BLIND * cell
    return False


@njit(fastmath=FAST, inner=True)
def ray_at(fan: Fan, bearing: float) -> int:
    """Number of the ray nearest to a bearing [rad] in the laser's frame. ours."""
    middle = 0.5 * (fan.rays - 1)
    return round(wrap_angle(bearing - fan.first - middle * fan.gap) / fan.gap + middle)


@njit
def cast_rays(field: Field, model: Model) -> int:
    """Model scan: of every ray the nearest surface with its normal. Returns how many rays hit.

    [May14] geometry of the scanner from the predicted pose, normal = gradient of the field; ours:
    the layers that a ray can see from the front. Writes model.points.
    """
    n_hits = 0
    fan, out = model.fan, model.points
    before = np.empty((1, LAYERS))[0]  # a kind of array that is compiled already
    for k in range(fan.rays):
        angle = model.heading + fan.first + k * fan.gap
        if cast_ray(field, model, math.cos(angle), math.sin(angle), before, out[k]):
            n_hits += 1
        else:
            out[k, 4] = 0.0
    return n_hits
