"""What is measured of two maps: overlap, distances, thickness, coverage; None: means nothing."""

from __future__ import annotations

import math

import numpy as np

from bench.judge.map_cells import Mask, cells_of, centers
from slams.types import OccupancyGrid, Pose2

FEWEST_WALLS = 100  # occupied cells that a statement about walls takes
FEWEST_CELLS = 1000  # known cells that a statement about areas takes


def overlap(here: Mask, there: Mask) -> float | None:
    """Cells in both masks (ny, nx) over those in either."""
    either = int((here | there).sum())
    return int((here & there).sum()) / either if either else None


def distances(grid: OccupancyGrid, truth: OccupancyGrid, T_world_map: Pose2) -> tuple[float, float]:
    """Mean from each occupied cell to the nearest true one, and back [m]; both maps have walls."""
    from scipy.spatial import KDTree

    here = T_world_map.transform(centers(grid, cells_of(grid.p).occupied))
    there = centers(truth, cells_of(truth.p).occupied)
    to_truth, from_truth = KDTree(there).query(here)[0], KDTree(here).query(there)[0]
    return float(np.mean(to_truth)), float(np.mean(from_truth))


def thickness(occupied: Mask, resolution: float) -> float | None:
    """Area over half the outline, the latter by Cauchy and Crofton from four directions.

    Lines along rows, columns and diagonals meet the walls so many times; the factor makes long
    walls along the grid exact, and leaves slanted ones up to 8 % too thin.
    """
    cells = int(occupied.sum())
    if cells < FEWEST_WALLS:
        return None
    padded = np.pad(occupied, 1)
    inner = padded[1:-1, 1:-1]
    straight = (inner & ~padded[1:-1, :-2]).sum() + (inner & ~padded[:-2, 1:-1]).sum()
    slanted = (inner & ~padded[:-2, :-2]).sum() + (inner & ~padded[:-2, 2:]).sum()
    half_outline = (straight + slanted / math.sqrt(2.0)) / (1.0 + math.sqrt(2.0))
    return resolution * cells / float(half_outline)


def coverage(known: Mask, true: Mask) -> float | None:
    """Share of the cells that could be seen (ny, nx) that are known."""
    cells = int(true.sum())
    return int(known.sum()) / cells if cells >= FEWEST_CELLS else None
