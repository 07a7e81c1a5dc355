"""Ray cast: the model scan, which a laser would measure in the field."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.geometry import wrap_angle
from slams.jit import FAST, njit
from slams.types import Floats
from tsd.map_kernels import N_LAYERS, TSD_TILE_SIDE, Field, read_field

MAX_FRONT_COSINE = 0.71  # of a ray to a layer's axis; above it the ray meets only backs
MIN_SURFACE_SLOPE, MAX_SURFACE_SLOPE = 0.6, 1.5  # of the field at one surface, not between two
UNKNOWN_STEP_CELLS = 2.0  # cells that a ray advances where all is unknown; the front band is wider
TILE_EDGE_MARGIN = 1e-6  # m that a ray advances beyond the edge of an empty tile
Pair = tuple[float, float]


class Fan(NamedTuple):
    """Rays of a model scan: number, bearing of the first, `gap` between them [rad], range [m].

    `per_circle` is the number of rays in a full circle, 0 if the rays do not fill a circle.
    """

    rays: int
    first: float
    gap: float
    reach: float
    per_circle: int


class Model(NamedTuple):
    """Model scan: `points` (n, 5) x, y [m], normal x, y in the map, range [m], 0 for no hit.

    The rays of `fan` start at the laser's pose x, y, heading.
    """

    points: Floats
    fan: Fan
    x: float
    y: float
    heading: float


@njit(fastmath=FAST, inner=True)
def visible_layers(field: Field, ty: int, tx: int, dx: float, dy: float) -> int:
    """Bits of the layers that have cells in a tile and surfaces that a ray meets in front. ours."""
    bits = 0
    for layer in range(4):
        along = dx if layer % 2 == 0 else dy
        if field.slots[ty, tx, layer] > 0 and (along if layer < 2 else -along) <= MAX_FRONT_COSINE:
            bits |= 1 << layer
    return bits


@njit(fastmath=FAST, inner=True)
def distance_to_edge(at: float, step: float, size: float) -> float:
    """Distance [m] along a ray to the edge of its tile on one axis; `at` in tiles. ours."""
    if step == 0.0:
        return math.inf
    return (math.floor(at) + (1.0 if step > 0.0 else 0.0) - at) * size / step


@njit(fastmath=FAST, inner=True)
def find_zero(
    field: Field,
    layer: int,
    model: Model,
    dx: float,
    dy: float,
    distances: Pair,
    values: Pair,
    out: Floats,
) -> None:
    """Zero of one layer along a ray, kept if it is the front of a surface nearer than out[4].

    At the two `distances` [m] on the ray the field has the `values` [m], positive and not.
    Original code: linear between the two; ours: by the gradient there, which has to be that of one
    surface. out (5,) is a row of `Model.points`.
    """
    (low, high), (before, after) = distances, values
    hit = low + (high - low) * before / (before - after)
    value, gx, gy = read_field(field, layer, model.x + hit * dx, model.y + hit * dy)
    fall, slope = gx * dx + gy * dy, math.sqrt(gx * gx + gy * gy)
    if MIN_SURFACE_SLOPE < slope < MAX_SURFACE_SLOPE and fall < 0.0:
        hit = min(max(hit - value / fall, low), high)
        if hit < out[4]:
            out[0], out[1] = model.x + hit * dx, model.y + hit * dy
            out[2], out[3], out[4] = gx / slope, gy / slope, hit


@njit(fastmath=FAST, inner=True)
def invalidate(before: Floats) -> None:
    """Set the values of the last step to nan. ours: a slice assignment takes long to compile."""
    for layer in range(4):
        before[layer] = math.nan


@njit(fastmath=FAST, inner=True)
def cast_ray(field: Field, model: Model, dx: float, dy: float, before: Floats, out: Floats) -> bool:
    """Nearest surface along a ray: out (5,), a row of `Model.points`; False if there is none.

    [May14] ray cast; ours: a ray jumps over tiles without cells, to their edges so that it misses
    no surface beside them, and elsewhere advances by the least distance. before (4,) is scratch.
    """
    size, cell = field.cell * TSD_TILE_SIDE, field.cell
    distance, last = 0.0, 0.0
    out[4] = math.inf
    invalidate(before)
    while distance < model.fan.reach:
        x, y = model.x + distance * dx, model.y + distance * dy
        u, v = (x - field.corner[0]) / size, (y - field.corner[1]) / size
        tx, ty = math.floor(u), math.floor(v)
        if tx < 0 or ty < 0 or ty >= field.slots.shape[0] or tx >= field.slots.shape[1]:
            break
        bits = visible_layers(field, ty, tx, dx, dy)
        if bits == 0:
            invalidate(before)
            edge = min(distance_to_edge(u, dx, size), distance_to_edge(v, dy, size))
            distance += edge + TILE_EDGE_MARGIN
            continue
        step = math.inf
        for layer in range(4):
            sd = math.nan
            if bits & (1 << layer):
                sd, _, _ = read_field(field, layer, x, y)
            if before[layer] > 0.0 and sd <= 0.0:
                interval = (last, distance)
                find_zero(field, layer, model, dx, dy, interval, (before[layer], sd), out)
            before[layer] = sd
            if sd > 0.0:
                step = min(step, sd)
        if out[4] < math.inf:
            return True
        last = distance
        distance += max(step, cell) if step < math.inf else UNKNOWN_STEP_CELLS * cell
    return False


@njit(fastmath=FAST, inner=True)
def ray_at(fan: Fan, bearing: float) -> int:
    """Index of the ray nearest to a bearing [rad] in the laser's frame. ours."""
    middle = 0.5 * (fan.rays - 1)
    return round(wrap_angle(bearing - fan.first - middle * fan.gap) / fan.gap + middle)


@njit
def cast_rays(field: Field, model: Model) -> int:
    """Write the model scan, the nearest surface of every ray, to model.points; returns the hits.

    [May14] geometry of the scanner at the predicted pose, normal = gradient of the field; ours:
    only the layers with surfaces that the ray meets in front.
    """
    n_hits = 0
    fan, out = model.fan, model.points
    before = np.empty((1, N_LAYERS))[0]  # a type of array that is compiled already
    for k in range(fan.rays):
        angle = model.heading + fan.first + k * fan.gap
        if cast_ray(field, model, math.cos(angle), math.sin(angle), before, out[k]):
            n_hits += 1
        else:
            out[k, 4] = 0.0
    return n_hits
