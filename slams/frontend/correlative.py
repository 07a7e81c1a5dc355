"""Correlative matching: one window search on any map that has a likelihood of walls [Olson09].

[Olson09] E. Olson: Real-Time Correlative Scan Matching. ICRA 2009.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.frontend.correlative_kernels import correlate
from slams.types import Floats, Pose2

BEAMS = 120  # of a scan that are looked up
DEVIATIONS = 3.0  # of the prior that a window covers
WIDEST, MOST_ROTATION = 2.0, math.pi  # m, rad: half of a window at most
COARSEST = 0.1  # rad between two rotations
LOOKUPS = 2_000_000  # of cells in one search at most: 5 ms


class Lookup(NamedTuple):
    """Likelihood of walls 0..1 (ny, nx), the center of cell [0, 0] (x, y) [m], the cell [m]."""

    likelihood: NDArray[np.float32]
    x0: float
    y0: float
    resolution: float


def search(
    lookup: Lookup, points: Floats, far: float, middle: Pose2, covariance: Floats, tries: int
) -> list[Pose2]:
    """The best poses of a window around `middle`, best first: one for each rotation.

    Args:
        lookup: the map.
        points: end points (2, n) [m] in the base frame; a part of them is looked up.
        far: distance of the farthest [m].
        middle: middle of the window.
        covariance: of the pose (3, 3) [m, rad], as wide as the window is.
        tries: how many poses at most.
    """
    cell = lookup.resolution
    spread = math.sqrt(max(float(covariance[0, 0]), float(covariance[1, 1]), 0.0))
    half = min(DEVIATIONS * spread, WIDEST)
    shifts = max(1, math.ceil(half / cell))
    step = min(COARSEST, 2.0 * cell / max(far, 1.0))
    turn = min(DEVIATIONS * math.sqrt(max(float(covariance[2, 2]), 0.0)), MOST_ROTATION)
    rotations = max(2, math.ceil(turn / step))
    some = np.ascontiguousarray(points[:2, :: max(1, points.shape[1] // BEAMS)])
    lookups = (2 * shifts + 1) ** 2 * (2 * rotations + 1) * some.shape[1]
    if lookups > LOOKUPS:  # coarser rotations first, then fewer of them
        wider = min(lookups / LOOKUPS, COARSEST / step)
        step, rotations = step * wider, max(2, math.ceil(rotations / wider))
        most = LOOKUPS / ((2 * shifts + 1) ** 2 * some.shape[1])
        rotations = max(2, min(rotations, int(0.5 * most)))
    window = np.array((*middle, shifts, rotations, step))
    frame = np.array((lookup.x0, lookup.y0, cell))
    out = np.empty((2 * rotations + 1, 4))
    correlate(lookup.likelihood, frame, some, window, out)
    best = out[np.argsort(-out[:, 3], kind="stable")[:tries]]
    return [Pose2(*row[:3]) for row in best.tolist()]
