"""Register one scan to earlier ones: ICP with point-to-line distances, independent of all fronts.

[Censi08] A. Censi, "An ICP variant using a point-to-line metric", ICRA 2008.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats

REACHES = (0.5, 0.5, 0.5, 0.3, 0.3, 0.2, 0.2, 0.15, 0.15, 0.15)  # m, of the pairs, step by step
LONGEST_PIECE = 0.3  # m between two returns that lie on one line, or
GAPS = 3.0  # times the usual distance of two returns, if that is more
LEAST_PAIRED = 0.3  # of the scan that must find a pair within the reach, else nothing fits
LEAST_RATIO = 1e-2  # of the information's eigenvalues, below which a direction is open


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
    """How far [m] the position `base` (2,) moves as the scan (n, 2) is laid on the target.

    inf where they do not fit together; None where the lines leave the position open.
    """
    if target.tree is None or len(scan) < 3:
        return None
    moved, at = scan.copy(), base.astype(np.float64).copy()
    for reach in REACHES:
        distance, index = map(np.asarray, target.tree.query(moved, 1, 0.0, 2.0, reach))
        paired = np.isfinite(distance)
        if paired.mean() < LEAST_PAIRED:
            return math.inf
        step = _step(moved[paired], target, index[paired], at)
        if step is None:
            return None
        c, s = np.cos(step[2]), np.sin(step[2])
        moved = (moved - at) @ np.array([[c, s], [-s, c]]) + at + step[:2]
        at = at + step[:2]
    return float(np.hypot(*(at - base)))


def _step(points: Floats, target: Reference, index: NDArray[np.int64], at: Floats) -> Floats | None:
    """Motion (3,) about `at` that least squares find for the pairs; None if a direction is open."""
    normals = target.normals[index]
    arm = points - at
    turn = normals[:, 1] * arm[:, 0] - normals[:, 0] * arm[:, 1]
    rows = np.column_stack([normals, turn])
    residuals = ((target.points[index] - points) * normals).sum(axis=1)
    information = rows.T @ rows
    values = np.linalg.eigvalsh(information)
    if values[0] < LEAST_RATIO * values[2]:
        return None
    step: Floats = np.linalg.solve(information, rows.T @ residuals)
    return step


def _lines(points: Floats) -> tuple[Floats, Floats]:
    """The points (n, 2) whose neighbors lie on one line with them, and its normals (n, 2)."""
    before, after = points[:-2], points[2:]
    along = after - before
    length = np.hypot(along[:, 0], along[:, 1])
    longest = max(LONGEST_PIECE, GAPS * float(np.median(length)) / 2.0)
    kept = (length > 1e-6) & (length < 2.0 * longest)
    along = along[kept] / length[kept, None]
    return points[1:-1][kept], np.column_stack([-along[:, 1], along[:, 0]])
