"""Relocalizer: global localization in an algorithm's own map, with bounded work for each scan.

A lost robot is searched for in the part of the map around its predicted pose. The part is drawn in
one scan; distance maps and search are made in the next ones, as `GlobalLocalizer` has it. A pose is
returned when it explains two scans, some distance or time apart, better than any other. When none
explains a scan, a new search begins after a pause.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from slams.grid_bounds import Box
from slams.localize.global_localizer import GlobalLocalizer
from slams.localize.map_index import CELL_COST, MapIndex, has_enough
from slams.types import OccupancyGrid, Pose2, Scan

WORK = 9_000.0  # us for each scan
MAX_CELLS = int(WORK / CELL_COST)  # of a distance transform; finer maps are coarsened
MAX_HALF_WIDTH = 20.0  # m, of the part of the map that is searched: 800^2 cells of 0.05 m
MARGIN = 8.0  # m around `reach`: half driven while the map is searched, half for its walls
SEARCHES = 2  # that have to agree: one scan may look like another place
MIN_SCORE = 0.6  # the own map is newer than a given one: more of a scan has to agree
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 8.0  # s after searches in vain: exponential backoff

Draw = Callable[[Box], OccupancyGrid | None]


class Relocalizer:
    """Finds a lost robot within `MAX_HALF_WIDTH` of the pose predicted when a search begins."""

    def __init__(self, enabled: bool = True) -> None:
        self._enabled = enabled
        self.reset()

    def reset(self) -> None:
        """The pose is known again: forget everything."""
        self._localizer: GlobalLocalizer | None = None
        self._pause = self._rest = 0.0  # s: the last pause, and what is left of it
        self._time = math.inf  # stamp of the last scan [s]

    def update(self, scan: Scan, predicted: Pose2, reach: float, draw: Draw) -> Pose2 | None:
        """Take a scan of a lost robot; the base's pose at this scan, once it is certain, else None.

        Args:
            scan: ignored if less than 20 beams are valid.
            predicted: dead-reckoned pose of the base in the map; motion is taken from its steps.
            reach: how far from it the base can be [m]; may be inf.
            draw: part of the map as a grid, without scans inserted while lost; None if none.
        """
        if not (self._enabled and all(map(math.isfinite, (scan.t, *predicted)))):
            return None
        self._rest -= max(scan.t - self._time, 0.0)
        self._time = scan.t
        if self._rest > 0.0 or not reach >= 0.0 or not has_enough(scan):
            return None
        if self._localizer is None:
            self._begin(predicted, reach, draw)
            return None
        found = self._localizer.add(scan, predicted, reach)
        if self._localizer.failed:
            self._give_up()
        elif found is not None:
            self.reset()
        return found.pose if found else None

    def _begin(self, predicted: Pose2, reach: float, draw: Draw) -> None:
        x, y, _ = predicted
        grid = draw(Box.around(x, y, min(reach + MARGIN, MAX_HALF_WIDTH)))
        try:
            if grid is None or grid.p.size == 0:
                raise ValueError("nothing is mapped here")
            index = MapIndex(coarsened(grid))
        except ValueError:  # or it has no walls
            self._give_up()
        else:
            self._localizer = GlobalLocalizer(index, WORK, SEARCHES, MIN_SCORE)

    def _give_up(self) -> None:
        self._localizer = None
        self._pause = min(max(2.0 * self._pause, FIRST_PAUSE), LONGEST_PAUSE)
        self._rest = self._pause


def coarsened(grid: OccupancyGrid) -> OccupancyGrid:
    """A grid of at most `MAX_CELLS`: of every block of cells the largest known probability.

    Rows and columns beyond the last whole block are left out.
    """
    side = math.ceil(math.sqrt(grid.p.size / MAX_CELLS))
    if side <= 1:
        return grid
    ny, nx = grid.p.shape[0] // side, grid.p.shape[1] // side
    blocks = grid.p[: ny * side, : nx * side].reshape(ny, side, nx, side)
    p = np.fmax.reduce(np.fmax.reduce(blocks, axis=3), axis=1)
    return OccupancyGrid(p, grid.resolution * side, grid.origin)
