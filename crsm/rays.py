"""Which beams of a scan fix x, y and theta: the critical rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats

EDGES = 0.25  # share of the rays that discontinuities may take


def leverage(rows: Floats, weights: Floats) -> Floats:
    """Share (m,) of each point in fixing the pose, w c' H^-1 c; together they are 3."""
    weighted = weights * rows
    h = np.array([[np.dot(a, b) for b in rows] for a in weighted]) + 1e-6 * np.eye(3)
    inverse = np.linalg.inv(h)
    shares = np.zeros_like(weights)
    for i in range(3):
        shares += weighted[i] * sum(inverse[i, j] * rows[j] for j in range(3))
    return np.asarray(shares.reshape(2, -1).sum(axis=0))


def critical_rays(
    rows: Floats, weights: Floats, far: Floats, edges: NDArray[np.bool_], count: int
) -> NDArray[np.int64]:
    """Numbers of about `count` points that carry the pose.

    [Tsardoulias13]: those at discontinuities (`edges`), and of the rest the far ones (`far`, the
    range [m]) more densely. ours: half of the rest goes to those with the greatest share in x, y
    and theta. By error diffusion along the scan, without a draw.
    """
    m = len(weights) // 2
    if m <= count:
        return np.arange(m)
    at_edges = np.minimum(edges * EDGES * count / max(int(edges.sum()), 1), 1.0)
    rest = 0.5 * (count - at_edges.sum())
    owed = at_edges + rest * (leverage(rows, weights) / 3.0 + far / far.sum())
    steps = np.floor(np.cumsum(np.minimum(owed, 1.0)))
    return np.flatnonzero(np.diff(steps, prepend=0.0) > 0.0)
