"""Preparation of a scan in the original code: mask and normals."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats, Ranges

Mask = NDArray[np.bool_]
Ints = NDArray[np.int64]
NORMAL_HALF_WINDOW = 5  # beams on each side in the window of a normal, original code


class Sensor(NamedTuple):
    """Laser and weights: angles [rad], limits [m], largest weight of a cell, unit of a weight."""

    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    low_reflectivity: float
    max_weight: float
    weight_unit: float


@njit
def mask_scan(
    ranges: Ranges, sensor: Sensor, shortest: float, jump: float, out_ranges: Floats, out_mask: Mask
) -> None:
    """Ranges (n,) [m] and mask (n,) of a scan. Original code: sensor mask.

    Ranges below `shortest` [m] are masked. Too long ranges become inf (free space) and stay valid;
    nan becomes inf and is masked. The far side of a range jump is masked if the chord meets the
    beam at less than `jump` [rad].
    """
    n = ranges.shape[0]
    for i in range(n):
        r = float(ranges[i])
        out_mask[i] = not (r != r or r < shortest or r <= 0.0)
        if r != r or r > sensor.range_max:
            r = math.inf
        elif r < shortest:
            r = 0.0
        out_ranges[i] = r
    c, s = math.cos(sensor.angle_increment), abs(math.sin(sensor.angle_increment))
    for i in range(1, n - 1):
        a = out_ranges[i]
        if a == math.inf:
            continue
        for k in (i - 1, i + 1):
            b = out_ranges[k]
            if a > b and b / math.sqrt(a * a + b * b - 2.0 * a * b * c) * s < math.sin(jump):
                out_mask[i] = False


@njit
def oriented_normals(points: Floats, mask: Mask, out_phi: Floats) -> None:
    """Direction of the normal [rad] at every beam (n,), nan where the surface is no line.

    Original code: PCA over 10 samples; a line is at least 2 times as long as wide.
    """
    n = mask.shape[0]
    out_phi[:] = math.nan
    for i in range(NORMAL_HALF_WINDOW, n - NORMAL_HALF_WINDOW):
        if not mask[i]:
            continue
        count, mx, my = 0, 0.0, 0.0
        for j in range(i - NORMAL_HALF_WINDOW, i + NORMAL_HALF_WINDOW):
            if mask[j]:
                count, mx, my = count + 1, mx + points[j, 0], my + points[j, 1]
        if count < 4:
            continue
        mx, my = mx / count, my / count
        xx, xy, yy = 0.0, 0.0, 0.0
        for j in range(i - NORMAL_HALF_WINDOW, i + NORMAL_HALF_WINDOW):
            if mask[j]:
                dx, dy = points[j, 0] - mx, points[j, 1] - my
                xx, xy, yy = xx + dx * dx, xy + dx * dy, yy + dy * dy
        along = 0.5 * math.atan2(2.0 * xy, xx - yy)
        c, s = math.cos(along), math.sin(along)
        a0, a1, b0, b1 = math.inf, -math.inf, math.inf, -math.inf
        for j in range(i - NORMAL_HALF_WINDOW, i + NORMAL_HALF_WINDOW):
            if mask[j]:
                a = c * points[j, 0] + s * points[j, 1]
                b = c * points[j, 1] - s * points[j, 0]
                a0, a1, b0, b1 = min(a0, a), max(a1, a), min(b0, b), max(b1, b)
        long2, short2 = (a1 - a0) * (a1 - a0), (b1 - b0) * (b1 - b0)
        if short2 == 0.0 or (short2 > 1e-6 and long2 < 4.0 * short2):
            continue
        toward = -s * points[i, 0] + c * points[i, 1] < 0.0
        out_phi[i] = math.atan2(c, -s) if toward else math.atan2(-c, s)
