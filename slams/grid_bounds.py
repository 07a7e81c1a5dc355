"""GridBounds: limits of a growing map, so that a wrong pose does not take all memory."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from slams.params import param

MAX_DISTANCE_FROM_MAP = 100.0  # m of a scan: no robot drives farther without a match
DEFAULT_MAX_CELLS = 1 << 26  # cells: 410 m x 410 m with an edge of 0.05 m
MAX_CELLS_LIMIT = 1 << 29  # cells: 2 GB in float32


class Box(NamedTuple):
    """Part of the plane, from (x0, y0) to (x1, y1) [m]."""

    x0: float
    y0: float
    x1: float
    y1: float

    @classmethod
    def around(cls, x: float, y: float, reach: float) -> Box:
        """The square of all points within `reach` [m] of a point along each axis."""
        return cls(x - reach, y - reach, x + reach, y + reach)

    def joined(self, other: Box) -> Box:
        """The smallest box around both."""
        low = min(self.x0, other.x0), min(self.y0, other.y0)
        return Box(*low, max(self.x1, other.x1), max(self.y1, other.y1))

    def cells(self, resolution: float) -> float:
        """Number of cells of `resolution` [m]; nan if a corner is not finite."""
        return (self.x1 - self.x0) * (self.y1 - self.y0) / resolution**2

    def distance_to(self, other: Box) -> float:
        """Distance [m] of the nearest point of this box from the center of another."""
        x, y = 0.5 * (other.x0 + other.x1), 0.5 * (other.y0 + other.y1)
        dx, dy = max(self.x0 - x, x - self.x1, 0.0), max(self.y0 - y, y - self.y1, 0.0)
        return math.hypot(dx, dy)


def max_cells(default: int = DEFAULT_MAX_CELLS) -> Any:
    """Declare the field `max_cells` of an algorithm's `Params`."""
    return param(
        default,
        "cell",
        "cells of the smallest box around the map; a scan that needs more is not mapped",
        source="ours: memory",
        low=1 << 16,
        high=MAX_CELLS_LIMIT,
    )


class GridBounds:
    """Decides whether a map may grow to cover a scan, and counts the rejected scans.

    `covered` is the box around the start and all admitted scans.

    Args:
        max_cells: greatest number of cells of the box around the map.
        resolution: edge of a cell [m].
    """

    def __init__(self, max_cells: int, resolution: float) -> None:
        self._max_cells, self._resolution = max_cells, resolution
        self.covered = Box(0.0, 0.0, 0.0, 0.0)  # the start
        self.counts = {"too_far": 0, "too_large": 0}

    def admits(self, needed: Box) -> bool:
        """Whether the map may grow to the box that a scan needs; if so, `covered` includes it.

        A scan is rejected where the robot cannot have driven to (`too_far`), and if the map would
        have more than `max_cells` (`too_large`).
        """
        if not self.covered.distance_to(needed) <= MAX_DISTANCE_FROM_MAP:
            self.counts["too_far"] += 1
            return False
        joined = self.covered.joined(needed)
        if not joined.cells(self._resolution) <= self._max_cells:
            self.counts["too_large"] += 1
            return False
        self.covered = joined
        return True
