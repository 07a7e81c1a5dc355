"""Kernel of the pose graph: covariances of keyframes relative to one of them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats


@njit
def propagate(
    poses: Floats, order: NDArray[np.int64], parents: NDArray[np.int32], added: Floats, out: Floats
) -> None:
    """Covariance of every pose relative to a root, along the tree of shortest paths [Olson08].

    C = J S J^T + that of the edge: a heading error of the parent moves the child by the lever arm
    between them. poses (n, 3); order (k,) nodes without the root, each after its parent in
    `parents` (k,); added (k, 3, 3) covariance of the edge to each node, in the frame of the earlier
    of both; out (n, 3, 3) in the map's axes.
    """
    for k in range(len(order)):
        child, parent = order[k], parents[k]
        S, C, A = out[parent], out[child], added[k]
        levers = poses[parent, 1] - poses[child, 1], poses[child, 0] - poses[parent, 0], 0.0
        theta = poses[min(child, parent), 2]
        c, s = math.cos(theta), math.sin(theta)
        R = (c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)
        for i in range(3):
            cross = S[i, 2] + levers[i] * S[2, 2]
            for j in range(3):
                C[i, j] = S[i, j] + levers[i] * S[2, j] + cross * levers[j]
                for u in range(3):
                    for v in range(3):
                        C[i, j] += R[i][u] * A[u, v] * R[j][v]
