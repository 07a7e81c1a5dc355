"""Kernels of the pose graph: how uncertain one keyframe is, seen from another."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats


@njit
def propagate(
    poses: Floats,
    order: NDArray[np.int64],
    parents: NDArray[np.int32],
    loops: NDArray[np.int64],
    variances: Floats,
    noise: Floats,
    out: Floats,
) -> None:
    """Covariance of every pose relative to a root, along the tree of the surest paths [Olson08].

    E. Olson: Robust and Efficient Robotic Mapping, PhD thesis, MIT 2008, "Dijkstra projection".
    Axes are the map's: an error of the parent's heading moves the child by the lever between them.
    poses (n, 3); order (k,) nodes, each behind its parent, without the root; parents (n,); loops
    (n,) the loop to the parent, -1: a step; variances (n, 3) of the step to each node, and noise
    (m, 3, 3) covariance of a loop, in the frame of the earlier node; out (n, 3, 3).
    """
    for child in order:
        parent = parents[child]
        earlier = min(child, parent)
        c, s = math.cos(poses[earlier, 2]), math.sin(poses[earlier, 2])
        if loops[child] < 0:
            step = variances[earlier + 1]
            along, aside, across, turn = step[0], 0.0, step[1], step[2]
        else:
            N = noise[loops[child]]
            along, aside, across, turn = N[0, 0], N[0, 1], N[1, 1], N[2, 2]
        x, y = poses[child, 0] - poses[parent, 0], poses[child, 1] - poses[parent, 1]
        S, C = out[parent], out[child]
        xt, yt, tt = S[0, 2], S[1, 2], S[2, 2]
        C[0, 0] = (
            S[0, 0]
            - 2.0 * y * xt
            + y * y * tt
            + c * c * along
            - 2.0 * c * s * aside
            + s * s * across
        )
        C[1, 1] = (
            S[1, 1]
            + 2.0 * x * yt
            + x * x * tt
            + s * s * along
            + 2.0 * c * s * aside
            + c * c * across
        )
        C[0, 1] = (
            S[0, 1]
            + x * xt
            - y * yt
            - x * y * tt
            + c * s * (along - across)
            + (c * c - s * s) * aside
        )
        C[0, 2] = xt - y * tt
        C[1, 2] = yt + x * tt
        C[2, 2] = tt + turn
        C[1, 0], C[2, 0], C[2, 1] = C[0, 1], C[0, 2], C[1, 2]
