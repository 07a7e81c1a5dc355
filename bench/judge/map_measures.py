"""What is measured of two maps: overlap, distances, thickness, coverage."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bench.judge.map_cells import Mask, cells_of, centers
from slams.types import Floats, OccupancyGrid, Pose2

FEWEST_WALLS = 100  # occupied cells that a statement about walls takes
FEWEST_CELLS = 1000  # known cells that a statement about areas takes


class Quality(NamedTuple):
    """One measure: its value, None where there is none, and whether it means something."""

    value: float | None
    meaningful: bool


def _share(part: int, of: int) -> float | None:
    return part / of if of else None


def overlap(here: Mask, there: Mask, comparable: bool) -> Quality:
    """Cells in both masks (ny, nx) over those in either."""
    found = _share(int((here & there).sum()), int((here | there).sum()))
    return Quality(found, comparable and found is not None)


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


def mean_of(values: Floats, comparable: bool) -> Quality:
    """The mean of (n,) values."""
    return Quality(float(values.mean()) if len(values) else None, comparable and len(values) > 0)


def thickness(occupied: Mask, resolution: float) -> Quality:
    """Area over half the outline, the latter by Cauchy and Crofton from four directions.

    Lines along rows, columns and diagonals meet the walls so many times; the factor makes long
    walls along the grid exact, and leaves slanted ones up to 8 % too thin.
    """
    cells = int(occupied.sum())
    padded = np.pad(occupied, 1)
    inner = padded[1:-1, 1:-1]
    straight = (inner & ~padded[1:-1, :-2]).sum() + (inner & ~padded[:-2, 1:-1]).sum()
    slanted = (inner & ~padded[:-2, :-2]).sum() + (inner & ~padded[:-2, 2:]).sum()
    half_outline = (straight + slanted / math.sqrt(2.0)) / (1.0 + math.sqrt(2.0))
    value = resolution * cells / float(half_outline) if cells else None
    return Quality(value, cells >= FEWEST_WALLS)


def coverage(known: Mask, true: Mask) -> Quality:
    """Share of the cells that could be seen (ny, nx) that are known."""
    cells = int(true.sum())
    return Quality(_share(int(known.sum()), cells), cells >= FEWEST_CELLS)
