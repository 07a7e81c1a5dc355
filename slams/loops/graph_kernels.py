"""Kernel of the pose graph: how uncertain one keyframe is, seen from another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats


@njit
def propagate(
    poses: Floats, order: NDArray[np.int64], before: NDArray[np.int32], added: Floats, out: Floats
) -> None:
    """Covariance of every pose relative to a root, along the tree of the surest paths [Olson08].

    J S J^T + the step's: an error of the parent's heading moves the child by the lever between
    them. poses (n, 3); order (k,) nodes, each behind its parent `before` (k,), without the root;
    added (k, 3, 3) of the step to each, all in the map's axes; out (n, 3, 3).
    """
    for k in range(len(order)):
        child, parent = order[k], before[k]
        S, C = out[parent], out[child]
        levers = poses[parent, 1] - poses[child, 1], poses[child, 0] - poses[parent, 0], 0.0
        for i in range(3):
            turned = S[i, 2] + levers[i] * S[2, 2]
            for j in range(3):
                C[i, j] = S[i, j] + levers[i] * S[2, j] + turned * levers[j] + added[k, i, j]
