"""Which beams of a scan fix x, y and theta: the critical rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats


def leverage(rows: Floats, weights: Floats) -> Floats:
    """Share (m,) of each point in fixing the pose, w c' H^-1 c; together they are 3."""
    weighted = weights * rows
    h = np.array([[np.dot(a, b) for b in rows] for a in weighted]) + 1e-6 * np.eye(3)
    inverse = np.linalg.inv(h)
    shares = np.zeros_like(weights)
    for i in range(3):
        shares += weighted[i] * sum(inverse[i, j] * rows[j] for j in range(3))
    return np.asarray(shares.reshape(2, -1).sum(axis=0))


def critical_rays(rows: Floats, weights: Floats, count: int) -> NDArray[np.int64]:
    """Numbers of about `count` points that carry the pose: [Tsardoulias13] in spirit, rule ours.

    Half of them are spread evenly over the scan, half go to those with the greatest share in x, y
    and theta; both by error diffusion along the scan, without a draw.
    """
    m = len(weights) // 2
    if m <= count:
        return np.arange(m)
    owed = 0.5 * count * (leverage(rows, weights) / 3.0 + 1.0 / m)
    steps = np.floor(np.cumsum(np.minimum(owed, 1.0)))
    return np.flatnonzero(np.diff(steps, prepend=0.0) > 0.0)
