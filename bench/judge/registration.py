"""Register one scan to earlier ones: ICP with point-to-line distances.

[Censi08] A. Censi, "An ICP variant using a point-to-line metric", ICRA 2008.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats

PAIRING_RADII = (0.5, 0.5, 0.5, 0.3, 0.3, 0.2, 0.2, 0.15, 0.15, 0.15)  # m, by iteration
MAX_SEGMENT_LENGTH = 0.3  # m between two returns on one line, or
MAX_SPACING_RATIO = 3.0  # times the median spacing of returns, if larger
MIN_PAIRED_SHARE = 0.3  # of the scan's points; with fewer pairs the registration fails
MIN_EIGENVALUE_RATIO = 1e-2  # of the information matrix; below it a direction is degenerate


class Reference:
    """The scans to register to: points (n, 2) and normals (n, 2) of their lines.

    `scans` are points (m, 2) each, in the order of the beams.
    """

    def __init__(self, scans: Sequence[Floats]) -> None:
        from scipy.spatial import KDTree

        pieces = [_lines(points) for points in scans if len(points) > 2]
        self.points = np.concatenate([np.zeros((0, 2)), *(points for points, _ in pieces)])
        self.normals = np.concatenate([np.zeros((0, 2)), *(normals for _, normals in pieces)])
        self.tree = KDTree(self.points) if len(self.points) else None


def register(scan: Floats, target: Reference, base: Floats) -> float | None:
    """Distance [m] by which the registration of a scan (n, 2) moves the position `base` (2,).

    inf if the registration fails; None if a direction is degenerate.
    """
    if target.tree is None or len(scan) < 3:
        return None
    moved, position = scan.copy(), base.astype(np.float64).copy()
    for radius in PAIRING_RADII:
        distance, index = map(np.asarray, target.tree.query(moved, 1, 0.0, 2.0, radius))
        paired = np.isfinite(distance)
        if paired.mean() < MIN_PAIRED_SHARE:
            return math.inf
        step = _step(moved[paired], target, index[paired], position)
        if step is None:
            return None
        c, s = np.cos(step[2]), np.sin(step[2])
        moved = (moved - position) @ np.array([[c, s], [-s, c]]) + position + step[:2]
        position = position + step[:2]
    return float(np.hypot(*(position - base)))


def _step(
    points: Floats, target: Reference, index: NDArray[np.int64], position: Floats
) -> Floats | None:
    """Least-squares motion (3,) about a position; None if a direction is degenerate."""
    normals = target.normals[index]
    arm = points - position
    rotation = normals[:, 1] * arm[:, 0] - normals[:, 0] * arm[:, 1]
    rows = np.column_stack([normals, rotation])
    residuals = ((target.points[index] - points) * normals).sum(axis=1)
    information = rows.T @ rows
    values = np.linalg.eigvalsh(information)
    if values[0] < MIN_EIGENVALUE_RATIO * values[2]:
        return None
    step: Floats = np.linalg.solve(information, rows.T @ residuals)
    return step


def _lines(points: Floats) -> tuple[Floats, Floats]:
    """Points (n, 2) on a line with their two neighbors, and the normals (n, 2) of these lines."""
    before, after = points[:-2], points[2:]
    along = after - before
    length = np.hypot(along[:, 0], along[:, 1])
    max_length = max(MAX_SEGMENT_LENGTH, MAX_SPACING_RATIO * float(np.median(length)) / 2.0)
    kept = (length > 1e-6) & (length < 2.0 * max_length)
    along = along[kept] / length[kept, None]
    return points[1:-1][kept], np.column_stack([-along[:, 1], along[:, 0]])
