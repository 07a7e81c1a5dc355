"""ViewLattice: the ranges a laser would measure all over a map, to compare a scan with.

ours: range by range, for all headings, at every point of a lattice over the free space. Other than
correlative matching of end points it asks what is visible from a point, so walls in between count;
and its cost is known beforehand. [Hess16] (branch and bound on a pyramid) was the other candidate;
a lattice of 0.25 m is small enough to need no bound.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.localize.distance_map import DistanceMap
from slams.localize.lattice_kernels import compare, view_around
from slams.types import Floats, Pose2, Scan

DIRECTIONS = 180  # of a full turn
UNIT = 100.0  # ranges are kept in centimeters
SPACING = 0.25  # m between two points
MAX_POINTS = 60_000  # a larger floor gets a wider lattice, so that a search stays bounded
CLEARANCE = 0.15  # m from what is not free: no robot's laser is closer
FAR = 60.0  # m, no indoor laser measures farther
# a range agrees within this share of the spacing, and of the range (half a direction, aslant)
NEAR, SHARE = 0.8, 0.03
MIN_DIRECTIONS = 20  # with a valid range in fewer there is nothing to compare


class Disc(NamedTuple):
    """Part of the plane: what is within `radius` of x, y [m]."""

    x: float
    y: float
    radius: float


EVERYWHERE = Disc(0.0, 0.0, math.inf)


class View(NamedTuple):
    """A scan at the lattice's resolution: directions (m,) of a turn, ranges (m,) [cm]."""

    directions: NDArray[np.int64]
    ranges: NDArray[np.int32]

    @property
    def enough(self) -> bool:
        """Whether there are enough directions to compare."""
        return len(self.directions) >= MIN_DIRECTIONS


def end_points(scan: Scan) -> Floats:
    """End points (n, 2) [m] of the valid beams in the laser's frame."""
    valid = _valid(scan)
    return np.asarray(scan.ranges[valid, None].astype(np.float64) * scan.laser.directions[valid])


def view_of(scan: Scan) -> View:
    """The valid beams; of those in one direction the one nearest to its middle."""
    valid = _valid(scan)
    turns = scan.laser.angles[valid] * (DIRECTIONS / (2.0 * math.pi))
    whole = np.round(turns).astype(np.int64)
    order = np.lexsort((np.abs(turns - whole), whole % DIRECTIONS))
    directions, first = np.unique(whole[order] % DIRECTIONS, return_index=True)
    ranges = np.minimum(scan.ranges[valid][order][first].astype(np.float64), FAR) * UNIT
    return View(directions, ranges.astype(np.int32))


def _valid(scan: Scan) -> NDArray[np.intp]:
    return np.flatnonzero(np.isfinite(scan.ranges) & (scan.ranges > 0.0))


class ViewLattice:
    """A lattice over the free space of a map, and the ranges around each of its points.

    `cast` casts the rays of its points, all at once or in pieces; `done` of them have theirs.

    Args:
        distances: the map.
        max_points: about how many there are at most; a larger floor gets a wider lattice.
        area: where they are, in the map's frame.
    """

    def __init__(
        self, distances: DistanceMap, max_points: int | None = None, area: Disc = EVERYWHERE
    ) -> None:
        limit = MAX_POINTS if max_points is None else max_points
        self.distances, self.spacing = distances, SPACING
        self.cells = _points(distances, SPACING, area)
        if len(self.cells) > limit:
            self.spacing *= math.sqrt(len(self.cells) / limit)
            self.cells = _points(distances, self.spacing, area)
        self.ranges = np.zeros((len(self.cells), DIRECTIONS), np.uint16)
        self.done = 0

    def __len__(self) -> int:
        return len(self.cells)

    def cast(self, count: int) -> None:
        """Cast the rays of the next `count` points, `DIRECTIONS` each."""
        part = slice(self.done, min(self.done + count, len(self)))
        cell = self.distances.resolution
        arrays = self.cells[part], self.ranges[part]
        view_around(self.distances.distances, *arrays, FAR / cell, UNIT * cell)
        self.done = part.stop

    def compare(self, view: View, first: int, count: int) -> NDArray[np.int32]:
        """How many beams agree at points from the `first`, and the heading of most (count, 2)."""
        tolerance = (NEAR * self.spacing * UNIT + SHARE * view.ranges).astype(np.int32)
        ranges = self.ranges[first : first + count]
        out = np.empty((len(ranges), 2), np.int32)
        compare(ranges, view.directions, view.ranges, tolerance, out)
        return out

    def poses(self, points: NDArray[np.intp], directions: NDArray[np.int32]) -> list[Pose2]:
        """Poses of the laser at points (n,), heading in directions (n,)."""
        xy = self.cells[points] * self.distances.resolution + self.distances.origin
        headings = directions * (2.0 * math.pi / DIRECTIONS)
        return [Pose2(*row) for row in np.column_stack([xy, headings]).tolist()]


def _points(distances: DistanceMap, spacing: float, area: Disc) -> Floats:
    """Points (n, 2) x, y [cell] of a lattice, in rows from the lowest y."""
    cell = distances.resolution
    ny, nx = distances.free.shape
    step = spacing / cell
    x, y = np.meshgrid(np.arange(0.5 * step, nx, step), np.arange(0.5 * step, ny, step))
    gap = distances.gap[y.astype(np.intp), x.astype(np.intp)]
    cx, cy = (np.array(area[:2]) - distances.origin) / cell
    inside = np.hypot(x - cx, y - cy) <= area.radius / cell
    inside &= gap * cell > CLEARANCE
    return np.stack([x[inside], y[inside]], axis=1)
