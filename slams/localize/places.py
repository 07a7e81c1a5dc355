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
    """A lattice over the free space of a chart, and what is seen from its points."""

    def __init__(self, chart: Chart) -> None:
        self.pitch = PITCH * math.sqrt(max(1.0, _count(chart, PITCH) / MOST))
        self._chart = chart
        self._cells = _lattice(chart, self.pitch)
        self._seen = np.zeros((len(self._cells), TURNS), np.uint16)
        cell = chart.resolution
        look_around(chart.cells, self._cells, FAR / cell, UNIT * cell, self._seen)

    def __len__(self) -> int:
        return len(self._cells)

    def rank(self, view: View, most: int) -> list[Pose2]:
        """The laser's poses at the best places, each at its best heading, best first."""
        best, turn = np.zeros((2, len(self)), np.int32)
        tolerance = NEAR * self.pitch * UNIT + SHARE * view.ranges
        compare(self._seen, view.directions, view.ranges, tolerance.astype(np.int32), best, turn)
        order = np.argsort(-best, kind="stable")[:most]
        spots = self._cells[order] * self._chart.resolution + self._chart.origin
        headings = turn[order] * (2.0 * math.pi / TURNS)
        rows = np.column_stack([spots, headings]).tolist()
        return [Pose2(x, y, theta) for x, y, theta in rows]


def _count(chart: Chart, pitch: float) -> float:
    """About how many places a lattice has."""
    return float((chart.clearance > CLEARANCE).sum()) * (chart.resolution / pitch) ** 2


def _lattice(chart: Chart, pitch: float) -> Floats:
    """Places (n, 2) x, y [cell], in rows from the lowest y."""
    step = pitch / chart.resolution
    ny, nx = chart.free.shape
    x, y = np.meshgrid(np.arange(0.5 * step, nx, step), np.arange(0.5 * step, ny, step))
    open_ = chart.clearance[y.astype(np.intp), x.astype(np.intp)] > CLEARANCE
    return np.stack([x[open_], y[open_]], axis=1)
