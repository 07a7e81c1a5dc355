"""Kernels of the view lattice: ranges around its points, and a scan compared with them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.localize.distance_kernels import Distances, cast
from slams.types import Floats


@njit
def view_around(
    distances: Distances, points: Floats, out: NDArray[np.uint16], far: float, scale: float
) -> None:
    """Ranges around points (n, 2) [cell] in all directions, times `scale`; 0 where no wall is.

    ours: out (n, turns), direction k is 2 pi k / turns.
    """
    n, turns = out.shape
    for i in range(n):
        for k in range(turns):
            angle = 2.0 * math.pi * k / turns
            c, s = math.cos(angle), math.sin(angle)
            r = cast(distances, points[i, 0], points[i, 1], c, s, far)
            out[i, k] = np.uint16(max(r, 0.0) * scale)


@njit
def compare(
    views: NDArray[np.uint16],
    directions: NDArray[np.int64],
    ranges: NDArray[np.int32],
    tolerances: NDArray[np.int32],
    out: NDArray[np.int32],
) -> None:
    """How many beams of a scan agree with each point's view, at the heading where most do.

    ours: beam by beam for all headings at once. views (n, turns) in the unit of `ranges` (m,);
    directions (m,) of the beams in turns; out (n, 2): the number and the heading.
    """
    n, turns = views.shape
    agree = np.zeros(turns, np.int32)
    twice = np.zeros(2 * turns, np.int32)
    for i in range(n):
        for k in range(turns):
            twice[k] = twice[k + turns] = views[i, k]
            agree[k] = 0
        for j in range(len(ranges)):
            part, r, tolerance = twice[directions[j] :], ranges[j], tolerances[j]
            for k in range(turns):
                agree[k] += 1 if abs(part[k] - r) < tolerance else 0
        best = 0
        for k in range(turns):
            if agree[k] > agree[best]:
                best = k
        out[i, 0], out[i, 1] = agree[best], best
