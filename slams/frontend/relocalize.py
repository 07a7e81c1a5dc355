"""Relocalizer: global localization in an algorithm's own map, with bounded work for each scan.

Only the part of the map around the predicted pose of a lost robot is searched. The part is drawn at
one scan, and `GlobalLocalizer` builds distance maps and searches at the next ones. A pose is
returned when it explains two scans, some distance or time apart, better than any other pose. After
a search in vain the next one starts after a pause.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from slams.grid_bounds import Box
from slams.localize.global_localizer import GlobalLocalizer
from slams.localize.map_index import CELL_COST, has_enough
from slams.types import OccupancyGrid, Pose2, Scan

WORK_PER_SCAN = 9_000.0  # us
MAX_SEARCH_CELLS = int(WORK_PER_SCAN / CELL_COST)  # of a distance map; finer maps are coarsened
MAX_SEARCH_HALF_WIDTH = 20.0  # m, of the part of the map: 800^2 cells of 0.05 m
SEARCH_MARGIN = 8.0  # m around `reach`: half for motion during the search, half for the walls
N_AGREEING_SEARCHES = 2  # since one scan may also fit another place
MIN_RELOCALIZATION_SCORE = 0.6  # higher than in a given map, as the own map is up to date
MIN_SEARCH_PAUSE, MAX_SEARCH_PAUSE = 0.5, 8.0  # s after a search in vain: exponential backoff

Draw = Callable[[Box], OccupancyGrid | None]


class Relocalizer:
    """Finds a lost robot within `MAX_SEARCH_HALF_WIDTH` of its predicted pose."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Stop the search, and start the next one without a pause."""
        self._localizer: GlobalLocalizer | None = None
        self._pause = self._remaining = 0.0  # s: the last pause, and its remaining time
        self._time = math.inf  # stamp of the last scan [s]

    def update(self, scan: Scan, predicted: Pose2, reach: float, draw: Draw) -> Pose2 | None:
        """Add a scan of a lost robot; return the pose of the base at this scan once it is certain.

        Args:
            scan: ignored if fewer than 20 beams are valid.
            predicted: dead-reckoned pose of the base in the map; its steps give the motion.
            reach: greatest distance of the base from it [m]; may be inf.
            draw: draws a part of the map, without scans inserted while lost; None if it is empty.
        """
        if not all(map(math.isfinite, (scan.t, *predicted))):
            return None
        self._remaining -= max(scan.t - self._time, 0.0)
        self._time = scan.t
        if self._remaining > 0.0 or not reach >= 0.0 or not has_enough(scan):
            return None
        if self._localizer is None:
            self._start(predicted, reach, draw)
            return None
        found = self._localizer.add(scan, predicted, reach)
        if self._localizer.failed:
            self._pause_search()
        elif found is not None:
            self.reset()
        return found.pose if found else None

    def _start(self, predicted: Pose2, reach: float, draw: Draw) -> None:
        x, y, _ = predicted
        grid = draw(Box.around(x, y, min(reach + SEARCH_MARGIN, MAX_SEARCH_HALF_WIDTH)))
        settings = WORK_PER_SCAN, N_AGREEING_SEARCHES, MIN_RELOCALIZATION_SCORE
        if grid is not None:
            with suppress(ValueError):  # the map has no walls here
                self._localizer = GlobalLocalizer(coarsened(grid), *settings)
        if self._localizer is None:
            self._pause_search()

    def _pause_search(self) -> None:
        self._localizer = None
        self._pause = min(max(2.0 * self._pause, MIN_SEARCH_PAUSE), MAX_SEARCH_PAUSE)
        self._remaining = self._pause


def coarsened(grid: OccupancyGrid) -> OccupancyGrid:
    """A grid of at most `MAX_SEARCH_CELLS`: the largest known probability in each block of cells.

    Rows and columns beyond the last whole block are left out.
    """
    side = math.ceil(math.sqrt(grid.p.size / MAX_SEARCH_CELLS))
    if side <= 1:
        return grid
    ny, nx = grid.p.shape[0] // side, grid.p.shape[1] // side
    blocks = grid.p[: ny * side, : nx * side].reshape(ny, side, nx, side)
    p = np.fmax.reduce(np.fmax.reduce(blocks, axis=3), axis=1)
    return OccupancyGrid(p, grid.resolution * side, grid.origin)
