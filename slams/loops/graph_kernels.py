"""Kernels of the pose graph: how uncertain one keyframe is, seen from another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats


@njit
def propagate(
    poses: Floats,
    order: NDArray[np.int64],
    parents: NDArray[np.int32],
    edges: NDArray[np.int64],
    noise: Floats,
    out: Floats,
) -> None:
    """Covariance of every pose relative to a root, along the tree of the surest paths [Olson08].

    E. Olson: Robust and Efficient Robotic Mapping, PhD thesis, MIT 2008, "Dijkstra projection".
    Axes are the map's: an error of the parent's heading moves the child by the lever between them.
    poses (n, 3); order (k,) nodes, each behind its parent, without the root; parents (n,); edges
    (n,) the edge to the parent; noise (m, 3, 3) covariance of an edge; out (n, 3, 3).
    """
    for child in order:
        parent = parents[child]
        x, y = poses[child, 0] - poses[parent, 0], poses[child, 1] - poses[parent, 1]
        S, Q, C = out[parent], noise[edges[child]], out[child]
        xt, yt, tt = S[0, 2], S[1, 2], S[2, 2]
        C[0, 0] = S[0, 0] - 2.0 * y * xt + y * y * tt + Q[0, 0]
        C[1, 1] = S[1, 1] + 2.0 * x * yt + x * x * tt + Q[1, 1]
        C[0, 1] = S[0, 1] + x * xt - y * yt - x * y * tt + Q[0, 1]
        C[0, 2] = xt - y * tt
        C[1, 2] = yt + x * tt
        C[2, 2] = tt + Q[2, 2]
        C[1, 0], C[2, 0], C[2, 1] = C[0, 1], C[0, 2], C[1, 2]
