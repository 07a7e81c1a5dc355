"""Places: what a laser would see from everywhere in a map, to compare a scan with.

ours: range by range, for all headings, every place of a lattice over the free space. Other than
matching end points to a likelihood field, it asks what is seen from a place, so walls in between
count; and its cost is known beforehand. [Hess16] (branch and bound on a pyramid) was the other
candidate; a lattice of 0.25 m is small enough to need no bound.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.localize.chart import Chart
from slams.localize.chart_kernels import compare, look_around
from slams.types import Floats, Pose2, Scan

TURNS = 180  # directions of a full turn
UNIT = 100.0  # ranges are kept in centimeters
PITCH = 0.25  # m between two places
MOST = 60_000  # places; a larger floor gets a wider lattice, so that a search stays bounded
CLEARANCE = 0.15  # m from any wall: no robot's laser is closer
FAR = 60.0  # m, no indoor laser sees farther
NEAR, SHARE = 0.8, 0.03  # a range agrees within 0.8 of the pitch + 3 % (half a direction, aslant)


class Disc(NamedTuple):
    """Part of the plane: what is within `radius` of x, y [m]."""

    x: float
    y: float
    radius: float


class View(NamedTuple):
    """A scan as it is compared: end points (n, 2) [m] in the laser's frame, and rough ranges.

    `directions` (m,) in turns, `ranges` (m,) [cm].
    """

    points: Floats
    directions: NDArray[np.int64]
    ranges: NDArray[np.int32]


def ends_of(scan: Scan) -> Floats:
    """Where the beams that met something end (n, 2) [m], in the laser's frame."""
    met = _met(scan)
    return np.asarray(scan.ranges[met, None].astype(np.float64) * scan.laser.directions[met])


def view_of(scan: Scan) -> View:
    """The beams that met something; of those in one direction the one nearest to its middle."""
    met = _met(scan)
    ranges = scan.ranges[met].astype(np.float64)
    turns = scan.laser.angles[met] * (TURNS / (2.0 * math.pi))
    whole = np.round(turns).astype(np.int64)
    order = np.lexsort((np.abs(turns - whole), whole % TURNS))
    directions, first = np.unique(whole[order] % TURNS, return_index=True)
    rough = np.minimum(ranges[order][first], FAR) * UNIT
    return View(ends_of(scan), directions, rough.astype(np.int32))


def _met(scan: Scan) -> NDArray[np.intp]:
    return np.flatnonzero(np.isfinite(scan.ranges) & (scan.ranges > 0.0))


class Places:
    """A lattice over the free space of a chart, and what is seen from its points.

    `prepare` casts the rays of its points, all at once or in pieces; `ready` of them have theirs.

    Args:
        chart: the map.
        most: about how many points there are at most; a larger floor gets a wider lattice.
        area: where they are, in the map's frame; None, everywhere.
    """

    def __init__(self, chart: Chart, most: int | None = None, area: Disc | None = None) -> None:
        count = _count(chart, PITCH, area)
        self.pitch = PITCH * math.sqrt(max(1.0, count / (MOST if most is None else most)))
        self.chart = chart
        self.cells = _lattice(chart, self.pitch, area)
        self.seen = np.zeros((len(self.cells), TURNS), np.uint16)
        self.ready = 0

    def __len__(self) -> int:
        return len(self.cells)

    def prepare(self, count: int) -> None:
        """Cast the rays of the next `count` points, `TURNS` each."""
        part = slice(self.ready, min(self.ready + count, len(self)))
        cell = self.chart.resolution
        far, scale = FAR / cell, UNIT * cell
        look_around(self.chart.cells, self.cells[part], far, scale, self.seen[part])
        self.ready = part.stop

    def rank(self, view: View, most: int) -> list[Pose2]:
        """The laser's poses at the best places, each at its best heading, best first."""
        ranking = Ranking(self, view)
        ranking.compare(len(self))
        return ranking.best(most)


class Ranking:
    """A scan compared with the points of a lattice, all at once or in pieces; `done` of them."""

    def __init__(self, places: Places, view: View) -> None:
        places.prepare(len(places) - places.ready)
        self._places, self._view = places, view
        self._tolerance = (NEAR * places.pitch * UNIT + SHARE * view.ranges).astype(np.int32)
        self._agree, self._turn = np.zeros((2, len(places)), np.int32)
        self.done = 0

    def compare(self, count: int) -> None:
        """Compare with the next `count` points."""
        part = slice(self.done, min(self.done + count, len(self._places)))
        seen, view, tolerance = self._places.seen[part], self._view, self._tolerance
        agree, turn = self._agree[part], self._turn[part]
        compare(seen, view.directions, view.ranges, tolerance, agree, turn)
        self.done = part.stop

    def best(self, most: int) -> list[Pose2]:
        """The laser's poses at the best points, each at its best heading, best first."""
        order = np.argsort(-self._agree, kind="stable")[:most]
        chart = self._places.chart
        spots = self._places.cells[order] * chart.resolution + chart.origin
        headings = self._turn[order] * (2.0 * math.pi / TURNS)
        rows = np.column_stack([spots, headings]).tolist()
        return [Pose2(x, y, theta) for x, y, theta in rows]


def _count(chart: Chart, pitch: float, area: Disc | None) -> float:
    """About how many places a lattice has."""
    ny, nx = chart.free.shape
    open_ = chart.clearance > CLEARANCE
    if area is not None:
        open_ &= _within(area, chart, np.arange(0.5, nx), np.arange(0.5, ny)[:, None])
    return float(open_.sum()) * (chart.resolution / pitch) ** 2


def _lattice(chart: Chart, pitch: float, area: Disc | None = None) -> Floats:
    """Places (n, 2) x, y [cell], in rows from the lowest y."""
    step = pitch / chart.resolution
    ny, nx = chart.free.shape
    x, y = np.meshgrid(np.arange(0.5 * step, nx, step), np.arange(0.5 * step, ny, step))
    open_ = chart.clearance[y.astype(np.intp), x.astype(np.intp)] > CLEARANCE
    if area is not None:
        open_ &= _within(area, chart, x, y)
    return np.stack([x[open_], y[open_]], axis=1)


def _within(area: Disc, chart: Chart, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Whether points x, y [cell] of a chart are in an area."""
    cx, cy = (np.array(area[:2]) - chart.origin) / chart.resolution
    return np.asarray((x - cx) ** 2 + (y - cy) ** 2 <= (area.radius / chart.resolution) ** 2)
