"""Kernels of the scan: valid ranges, and choice of the critical rays."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slams.jit import njit


@njit
def clean(ranges: Any, directions: Any, limits: Any, out_d: Any, out_ends: Any) -> None:
    """[Tsardoulias13] code: ranges d (n,) [m], 0 without data, and truncated end cells (n, 2).

    limits (minimum range [m], range_max [m], cell [m])
    """
    for i in range(ranges.shape[0]):
        r = ranges[i]
        out_d[i] = r if limits[0] <= r <= limits[1] else 0.0
        # truncation towards 0, as a cast in C
        out_ends[i, 0] = int(out_d[i] / limits[2] * directions[i, 0])
        out_ends[i, 1] = int(out_d[i] / limits[2] * directions[i, 1])


@njit
def range_changes(d: Any, jump: float, far: float, out_picked: Any) -> tuple[float, float]:
    """[Tsardoulias13] "big changes": pick both sides of range jumps, and the first and last beam.

    jump [m]; no ray of `far` [m] or more is picked; out_picked (n,). Returns the mean difference of
    neighboring ranges and the longest range [m].
    """
    n = d.shape[0]
    total, longest = 0.0, 0.0
    first, last = -1, -1
    for i in range(n):
        out_picked[i] = False
        longest = max(longest, d[i])
        if i + 1 < n:
            total += abs(d[i] - d[i + 1])
        if d[i] < far:
            first = i if first < 0 else first
            last = i
    i = 0
    while i < n - 1:
        step = 1
        if abs(d[i] - d[i + 1]) > jump:
            out_picked[i] = d[i] < far
            out_picked[i + 1] = d[i + 1] < far
            step = max(1, int(out_picked[i]) + int(out_picked[i + 1]))
        i += step
    if first >= 0:
        out_picked[first] = True
        out_picked[last] = True
    return total / max(n - 1, 1), longest


@njit
def pick_between(d: Any, level: float, far: float, longest: float, picked: Any) -> int:
    """[Tsardoulias13] controlled density: pick a ray wherever the range has changed enough.

    picked (n,) has the jumps, and then all rays; far, longest [m]. Returns the number added.
    """
    n = d.shape[0]
    count = 0
    root = math.sqrt(longest)
    s = -1
    for e in range(n):
        if not picked[e]:
            continue
        if s >= 0 and d[s + 1] <= far:
            step = 0.0
            for i in range(s, e - 1):
                step += abs(d[i] - d[i + 1])
            step /= e - s
            collected = 0.0
            for i in range(s, e):
                collected += abs(d[i] - d[i + 1])
                if collected > level * step / math.exp(3.0 * d[i] / root):
                    picked[i] = True
                    count += 1
                    collected = 0.0
        s = e
    return count


@njit
def fill_gaps(gap: int, picked: Any) -> None:
    """[Tsardoulias13] gap filling: halve every gap of more than `gap` beams until none is left."""
    n = picked.shape[0]
    s = -1
    for e in range(n):
        if not picked[e]:
            continue
        if s >= 0:
            _halve(s, e, gap, picked)
        s = e


@njit
def _halve(s: int, e: int, gap: int, picked: Any) -> None:
    """[Tsardoulias13] gap filling of one gap between the rays s and e."""
    todo = np.empty((64, 2), np.int64)
    todo[0, 0], todo[0, 1] = s, e
    k = 1
    while k > 0:
        k -= 1
        a, b = todo[k, 0], todo[k, 1]
        if b - a > gap:
            half = (a + b) // 2
            picked[half] = True
            todo[k, 0], todo[k, 1] = a, half
            todo[k + 1, 0], todo[k + 1, 1] = half, b
            k += 2


@njit
def selected(d: Any, longest_valid: float, picked: Any, ends: Any, out_ends: Any) -> int:
    """[Tsardoulias13] code: end cells (k, 2) float32 of the picked rays with a hit; returns k."""
    k = 0
    for i in range(d.shape[0]):
        if picked[i] and d[i] != 0.0 and d[i] != longest_valid:
            out_ends[k, 0] = ends[i, 0]
            out_ends[k, 1] = ends[i, 1]
            k += 1
    return k
