"""What is measured of two maps: overlap, distances, similarity, thickness, coverage."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bench.judge.map_cells import Mask, cells_of, centers
from slams.types import Floats, OccupancyGrid, Pose2

FEWEST_WALLS = 100  # occupied cells that a statement about walls takes
FEWEST_CELLS = 1000  # known cells that a statement about areas takes
SSIM_WINDOW, SSIM_SIGMA = 11, 1.5  # cells, [Wang04] section III.B
SSIM_C1, SSIM_C2 = 0.01**2, 0.03**2  # [Wang04]: (K1 L)^2 and (K2 L)^2, L = 1


class Quality(NamedTuple):
    """One measure: its value, from how many cells, whether it means something, else why not."""

    value: float
    support: int
    meaningful: bool
    reason: str


def _quality(value: float, support: int, doubt: str) -> Quality:
    doubt = doubt if math.isfinite(value) else doubt or "nothing to measure"
    return Quality(value, support, not doubt, doubt)


def too_small(cells: Mask) -> str:
    """Why a measure of these cells (ny, nx) would mean nothing, "" when it does mean something."""
    return f"only {cells.sum()} cells known in both" if cells.sum() < FEWEST_CELLS else ""


def overlap(here: Mask, there: Mask, doubt: str) -> Quality:
    """Cells in both masks (ny, nx) over those in either."""
    either = int((here | there).sum())
    return _quality(float((here & there).sum() / either) if either else math.nan, either, doubt)


def distances(
    grid: OccupancyGrid, truth: OccupancyGrid, T_world_map: Pose2
) -> tuple[Floats, Floats]:
    """From each occupied cell to the nearest true one (n,) and back (m,) [m].

    Empty where either map has no walls.
    """
    from scipy.spatial import KDTree

    here = T_world_map.transform(centers(grid, cells_of(grid.p).occupied))
    there = centers(truth, cells_of(truth.p).occupied)
    if not len(here) or not len(there):
        return np.zeros(0), np.zeros(0)
    to_truth, from_truth = KDTree(there).query(here)[0], KDTree(here).query(there)[0]
    return np.asarray(to_truth), np.asarray(from_truth)


def mean_of(values: Floats, doubt: str) -> Quality:
    """The mean of (n,) values."""
    return _quality(float(values.mean()) if len(values) else math.nan, len(values), doubt)


def greater_of(to_truth: Floats, from_truth: Floats, share: float, doubt: str) -> Quality:
    """The greater of both directions' quantiles."""
    support = len(to_truth) + len(from_truth)
    if not support:
        return _quality(math.nan, 0, doubt)
    greater = max(float(np.quantile(part, share)) for part in (to_truth, from_truth))
    return _quality(greater, support, doubt)


def _blurred(values: Floats) -> Floats:
    """Weighted sum (ny, nx) over the Gaussian window around each cell, nothing beyond the edge."""
    import cv2

    size = (SSIM_WINDOW, SSIM_WINDOW)
    return np.asarray(
        cv2.GaussianBlur(values, size, SSIM_SIGMA, borderType=cv2.BORDER_CONSTANT), np.float64
    )


def similarity_of(a: Mask, b: Mask, known: Mask) -> Floats:
    """[Wang04] eq. 13 around each cell (ny, nx) of two pictures of 1 and 0.

    Means, variances and covariance are taken over the known cells of a window alone.
    """
    weight = np.maximum(_blurred(known.astype(np.float64)), 1e-12)

    def mean(values: Mask) -> Floats:
        """Of the known cells around each."""
        return _blurred((values & known).astype(np.float64)) / weight

    mean_a, mean_b = mean(a), mean(b)
    # 1 and 0 are their own squares
    variance_a, variance_b = mean_a - mean_a**2, mean_b - mean_b**2
    covariance = mean(a & b) - mean_a * mean_b
    luminance = (2.0 * mean_a * mean_b + SSIM_C1) / (mean_a**2 + mean_b**2 + SSIM_C1)
    similarity: Floats = (
        luminance * (2.0 * covariance + SSIM_C2) / (variance_a + variance_b + SSIM_C2)
    )
    return similarity


def around(walls: Mask, known: Mask) -> Mask:
    """Known cells whose window holds a known wall."""
    around: Mask = (_blurred((walls & known).astype(np.float64)) > 0.0) & known
    return around


def thickness(occupied: Mask, resolution: float) -> Quality:
    """Area over half the outline, the latter by Cauchy and Crofton from four directions.

    Lines along rows, columns and diagonals meet the walls so many times; the factor makes long
    walls along the grid exact, and leaves slanted ones up to 8 % too thin.
    """
    support = int(occupied.sum())
    padded = np.pad(occupied, 1)
    inner = padded[1:-1, 1:-1]
    straight = (inner & ~padded[1:-1, :-2]).sum() + (inner & ~padded[:-2, 1:-1]).sum()
    slanted = (inner & ~padded[:-2, :-2]).sum() + (inner & ~padded[:-2, 2:]).sum()
    half_outline = (straight + slanted / math.sqrt(2.0)) / (1.0 + math.sqrt(2.0))
    doubt = f"only {support} occupied cells" if support < FEWEST_WALLS else ""
    value = resolution * support / float(half_outline) if support else math.nan
    return _quality(value, support, doubt)


def coverage(known: Mask, true: Mask) -> Quality:
    """Share of the cells that could be seen (ny, nx) that are known."""
    support = int(true.sum())
    doubt = f"only {support} cells could be seen" if support < FEWEST_CELLS else ""
    return _quality(float(known.sum() / support) if support else math.nan, support, doubt)
