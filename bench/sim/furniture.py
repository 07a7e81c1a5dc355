"""Furniture of offices and halls: outlines at the height of a laser above the floor.

The outlines of a piece lie in its footprint (length, depth) [m]: x from 0 to the length, y from 0,
the back, to the depth.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.canvas import Outline, rectangle, round_outline

if TYPE_CHECKING:
    from numpy.random import Generator

TABLE_LEG_WIDTH = 0.05  # m
CHAIR_LEG_WIDTH = 0.04  # m
RACK_UPRIGHT_WIDTH = 0.1  # m


@dataclass(frozen=True)
class Piece:
    """A piece of furniture: its footprint [m] and its outlines in the laser's plane."""

    length: float
    depth: float
    outlines: Sequence[Outline]
    free: bool = False  # stands anywhere, not with its back to a wall

    def sides(self, quarters: int) -> tuple[float, float]:
        """Extent of the footprint in x and y [m], rotated by quarter turns."""
        return (self.depth, self.length) if quarters % 2 else (self.length, self.depth)

    def at(self, left: float, bottom: float, quarters: int) -> list[Outline]:
        """Outlines with the rotated footprint's lower left corner at (left, bottom)."""
        dx, dy = self.sides(quarters)
        right, top = left + dx, bottom + dy
        corner = ((left, bottom), (right, bottom), (right, top), (left, top))[quarters % 4]
        c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
        rotation = np.array([[c, s], [-s, c]], np.float64)
        return [outline @ rotation + np.array(corner) for outline in self.outlines]


PieceMaker = Callable[["Generator"], Piece]


def box(left: float, bottom: float, right: float, top: float) -> Outline:
    """A rectangle parallel to the axes."""
    return np.array([[left, bottom], [right, bottom], [right, top], [left, top]])


def _posts(left: float, bottom: float, right: float, top: float, edge: float) -> list[Outline]:
    """Four square legs whose outer edges span a rectangle."""
    xs, ys = (left, right - edge), (bottom, top - edge)
    return [box(x, y, x + edge, y + edge) for x in xs for y in ys]


def _chair(x: float, y: float) -> list[Outline]:
    """Four feet around (x, y)."""
    return _posts(x - 0.22, y - 0.22, x + 0.22, y + 0.22, CHAIR_LEG_WIDTH)


def desk(rng: Generator) -> Piece:
    """A desk with drawers on one side, legs on the other and a chair before it."""
    length = float(rng.uniform(1.4, 1.8))
    drawers = box(0.0, 0.1, 0.43, 0.7)
    legs = [box(length - TABLE_LEG_WIDTH, y, length, y + TABLE_LEG_WIDTH) for y in (0.0, 0.75)]
    chair = _chair(0.6 * length + float(rng.uniform(-0.1, 0.2)), float(rng.uniform(0.75, 1.05)))
    return Piece(length, 1.3, [drawers, *legs, *chair])


def cupboard(rng: Generator) -> Piece:
    """Cupboards in a row."""
    length = 0.8 * int(rng.integers(1, 4))
    return Piece(length, 0.42, [box(0.0, 0.0, length, 0.42)])


def table(rng: Generator) -> Piece:
    """A meeting table with chairs on both sides."""
    seats = int(rng.integers(1, 4))
    length = 0.5 + 0.7 * seats
    chairs = []
    for k in range(seats):
        x = 0.6 + 0.7 * k
        chairs += _chair(x, 0.3 + float(rng.uniform(-0.05, 0.1)))
        chairs += _chair(x, 1.7 - float(rng.uniform(-0.05, 0.1)))
    return Piece(length, 2.0, [*_posts(0.0, 0.5, length, 1.5, TABLE_LEG_WIDTH), *chairs], free=True)


def bin_or_plant(rng: Generator) -> Piece:
    """A round bin or plant."""
    radius = float(rng.uniform(0.12, 0.22))
    return Piece(2.0 * radius, 2.0 * radius, [round_outline((radius, radius), radius)])


def copier(rng: Generator) -> Piece:
    """A copier or a couch."""
    length = float(rng.uniform(0.7, 1.7))
    return Piece(length, 0.65, [box(0.0, 0.05, length, 0.65)])


def rack(length: float, depth: float, full: float, rng: Generator) -> Piece:
    """Pallet racks in a row: uprights between bays, of which a share `full` holds a pallet."""
    bays = max(1, round(length / 2.7))
    bay = (length - RACK_UPRIGHT_WIDTH) / bays
    outlines = []
    for k in range(bays + 1):
        x = k * bay
        for y in (0.0, depth - RACK_UPRIGHT_WIDTH):
            outlines.append(box(x, y, x + RACK_UPRIGHT_WIDTH, y + RACK_UPRIGHT_WIDTH))
    for k in range(bays):
        if rng.random() < full:
            side, back = rng.uniform(0.1, 0.4, 2).tolist()
            left = k * bay + RACK_UPRIGHT_WIDTH + side
            outlines.append(box(left, 0.3 * back, (k + 1) * bay - back, depth - 0.3 * side))
    return Piece(length, depth, outlines)


def pallets(rng: Generator) -> Piece:
    """One to six loaded pallets in rows, slightly rotated."""
    nx, ny = int(rng.integers(1, 4)), int(rng.integers(1, 3))
    outlines = []
    for k in range(nx * ny):
        x, y = 0.7 + 1.3 * (k % nx), 0.5 + 0.9 * (k // nx)
        outlines.append(rectangle((x, y), 1.2, 0.8, float(rng.normal(0.0, 0.04))))
    return Piece(0.1 + 1.3 * nx, 0.1 + 0.9 * ny, outlines)


def crates(rng: Generator) -> Piece:
    """One to three boxes at any angle."""
    n = int(rng.integers(1, 4))
    outlines = []
    for k in range(n):
        length, width = rng.uniform(0.4, 0.9, 2).tolist()
        outlines.append(
            rectangle((0.65 + 0.9 * k, 0.65), length, width, float(rng.uniform(0.0, math.pi)))
        )
    return Piece(0.4 + 0.9 * n, 1.3, outlines)


def machine(rng: Generator) -> Piece:
    """A machine or a workbench with a panel beside it."""
    length, depth = float(rng.uniform(1.5, 3.0)), float(rng.uniform(0.8, 1.4))
    panel = box(0.1, depth, 0.5, depth + 0.3)
    return Piece(length, depth + 0.3, [box(0.0, 0.0, length, depth), panel])
