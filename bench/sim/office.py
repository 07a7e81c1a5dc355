"""A seeded office floor: corridors, rooms with open doors on both sides, furniture.

Parallel corridors run along the floor, with a row of rooms on each side. Cross corridors connect
them, which makes loops. Some rooms are open-plan offices. A drive with 0.3 m of clearance reaches
every room.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

from bench.sim import furniture
from bench.sim.canvas import Canvas
from bench.sim.world import World

if TYPE_CHECKING:
    from numpy.random import Generator

    from bench.sim.furniture import Piece, PieceMaker

OUTER_WALL_THICKNESS = 0.3  # m
INNER_WALL_THICKNESS = 0.1  # m
DOOR_WIDTHS = (0.9, 1.0)  # m
CORRIDOR_WIDTHS = (1.8, 2.2)  # m
ROOM_WIDTHS = (3.0, 6.0)  # m
LOWER_ROOM_SHARES = (0.46, 0.54)  # of the depth of two rows of rooms
MODULE_DEPTH = 12.5  # m, of a corridor with its rooms
CROSSING_SPACING = 20.0  # m between cross corridors
OPEN_PLAN_WIDTHS = (7.0, 10.0)  # m
OFFICE_CLEARANCE = 0.43  # m on both sides of a path
DOOR_FRONT_DEPTH = 1.2  # m of the corridor that furniture must not block
OFFICE_PIECES: tuple[PieceMaker, ...] = (
    furniture.desk,
    furniture.desk,
    furniture.desk,
    furniture.cupboard,
    furniture.cupboard,
    furniture.table,
    furniture.bin_or_plant,
    furniture.copier,
)


@dataclass(frozen=True)
class Room:
    """A rectangle [m] between walls, with the corridor `below` or `above` or both."""

    left: float
    bottom: float
    right: float
    top: float
    below: bool
    above: bool

    @property
    def width(self) -> float:
        """From the left wall to the right."""
        return self.right - self.left

    @property
    def depth(self) -> float:
        """From the lower wall to the upper."""
        return self.top - self.bottom


@dataclass
class Floor:
    """Rooms, and corridors as rectangles (left, bottom, right, top) [m]."""

    width: float
    depth: float
    corridors: list[tuple[float, float, float, float]] = field(default_factory=list)
    rooms: list[Room] = field(default_factory=list)


def office(rng: Generator, resolution: float, size: float) -> World:
    """An office floor of about `size` x 5/8 `size` metres; same generator state, same floor."""
    floor = _floor(size, 0.625 * size, rng)
    walls = 2.0 * OUTER_WALL_THICKNESS
    canvas = Canvas.solid(floor.width + walls, floor.depth + walls, resolution)
    for corridor in floor.corridors:
        canvas.carve(*corridor)
    for room in floor.rooms:
        canvas.carve(room.left, room.bottom, room.right, room.top)
    for room in floor.rooms:
        _doors(canvas, room, rng)
    for room in floor.rooms:
        _furnish(canvas, room, rng)
    return canvas.world()


def _floor(width: float, depth: float, rng: Generator) -> Floor:
    """Corridors and rooms, from the bottom to the top."""
    floor, outer, inner = Floor(width, depth), OUTER_WALL_THICKNESS, INNER_WALL_THICKNESS
    n = max(1, round(depth / MODULE_DEPTH))
    bands = [_band(outer + k * depth / n, depth / n, rng) for k in range(n)]
    right = outer + width
    floor.corridors = [(outer, low, right, high) for low, high in bands]
    _row(floor, (outer, right), (outer, bands[0][0] - inner), False, True, rng)
    for (_, low), (high, _) in pairwise(bands):
        _between(floor, low, high, rng)
    _row(floor, (outer, right), (bands[-1][1] + inner, outer + depth), True, False, rng)
    return floor


def _band(bottom: float, depth: float, rng: Generator) -> tuple[float, float]:
    """Lower and upper wall of the corridor of a module."""
    width = float(rng.uniform(*CORRIDOR_WIDTHS))
    low = bottom + (depth - width) * float(rng.uniform(*LOWER_ROOM_SHARES))
    return low, low + width


def _between(floor: Floor, low: float, high: float, rng: Generator) -> None:
    """Cross corridors from `low` to `high`, and between them rooms back to back."""
    outer, inner = OUTER_WALL_THICKNESS, INNER_WALL_THICKNESS
    across = (low + inner, high - inner)
    n = max(1, round(floor.width / CROSSING_SPACING))
    left = outer
    for k in range(n):
        middle = outer + floor.width * (k + 0.5 + float(rng.uniform(-0.15, 0.15))) / n
        half = 0.5 * float(rng.uniform(*CORRIDOR_WIDTHS))
        floor.corridors.append((middle - half, low, middle + half, high))
        _rows(floor, (left, middle - half - inner), across, rng)
        left = middle + half + inner
    _rows(floor, (left, outer + floor.width), across, rng)


def _rows(
    floor: Floor, along: tuple[float, float], across: tuple[float, float], rng: Generator
) -> None:
    """Two rows of rooms; an open-plan office may replace the left part or all of them."""
    (left, right), (bottom, top) = along, across
    plan = float(rng.uniform(*OPEN_PLAN_WIDTHS))
    if right - left > OPEN_PLAN_WIDTHS[0] and rng.random() < 0.5:
        end = left + plan if right - left - plan > ROOM_WIDTHS[0] else right
        floor.rooms.append(Room(left, bottom, end, top, True, True))
        left = end + INNER_WALL_THICKNESS
    if right - left < 1.5:
        return
    middle = bottom + (top - bottom) * float(rng.uniform(*LOWER_ROOM_SHARES))
    _row(floor, (left, right), (bottom, middle - 0.5 * INNER_WALL_THICKNESS), True, False, rng)
    _row(floor, (left, right), (middle + 0.5 * INNER_WALL_THICKNESS, top), False, True, rng)


def _row(
    floor: Floor,
    along: tuple[float, float],
    across: tuple[float, float],
    below: bool,
    above: bool,
    rng: Generator,
) -> None:
    """Rooms side by side that fill a rectangle; sometimes one of them is wide."""
    left, right = along
    n = max(1, round((right - left) / 4.4))
    shares = rng.uniform(*ROOM_WIDTHS, n)
    if n > 3 and rng.random() < 0.4:
        shares[int(rng.integers(n))] *= 2.0
    for width in ((right - left + INNER_WALL_THICKNESS) * shares / shares.sum()).tolist():
        end = left + width - INNER_WALL_THICKNESS
        floor.rooms.append(Room(left, across[0], end, across[1], below, above))
        left += width


def _doors(canvas: Canvas, room: Room, rng: Generator) -> None:
    """A door to each corridor beside a room, two in a wide room."""
    for there, wall in ((room.below, room.bottom - INNER_WALL_THICKNESS), (room.above, room.top)):
        if not there:
            continue
        for k in range(n := 1 if room.width < OPEN_PLAN_WIDTHS[0] else 2):
            share = room.width / n
            wanted = float(rng.uniform(*DOOR_WIDTHS))
            slack = share - wanted - 0.3
            left = room.left + k * share + 0.15 + float(rng.uniform(0.0, slack))
            _opening(canvas, left, wall, wanted)


def _opening(canvas: Canvas, left: float, bottom: float, width: float) -> None:
    """Carve a door into a horizontal wall, never narrower than `width`."""
    cell = canvas.resolution
    left = round(left / cell) * cell
    right = left + math.ceil(width / cell - 1e-6) * cell
    wall = INNER_WALL_THICKNESS
    canvas.carve(left, bottom - 0.5 * wall, right, bottom + 1.5 * wall)


def _furnish(canvas: Canvas, room: Room, rng: Generator) -> None:
    """Desks and cupboards along the walls, tables in the middle, about one piece to 4 m^2."""
    wall = INNER_WALL_THICKNESS
    area = canvas.area(
        room.left - wall,
        room.bottom - (wall + DOOR_FRONT_DEPTH if room.below else wall),
        room.right + wall,
        room.top + (wall + DOOR_FRONT_DEPTH if room.above else wall),
    )
    for _ in range(int(room.width * room.depth / 4.0)):
        piece = OFFICE_PIECES[int(rng.integers(len(OFFICE_PIECES)))](rng)
        for _ in range(3):
            placed = _place(room, piece, rng)
            if placed is None:
                continue
            left, bottom, quarters = placed
            dx, dy = piece.sides(quarters)
            free = canvas.is_free(left, bottom, left + dx, bottom + dy)
            if free and canvas.put(piece.at(left, bottom, quarters), OFFICE_CLEARANCE, area):
                break


def _place(room: Room, piece: Piece, rng: Generator) -> tuple[float, float, int] | None:
    """Lower left corner and quarter turns of a piece with its back to a wall, a table anywhere."""
    quarters = int(rng.integers(4))
    dx, dy = piece.sides(quarters)
    free_x, free_y = room.width - dx - 0.04, room.depth - dy - 0.04
    if min(free_x, free_y) < 0.0:
        return None
    x, y = float(rng.uniform(0.0, free_x)), float(rng.uniform(0.0, free_y))
    if not piece.free:  # back to the wall
        x = (x, free_x, x, 0.0)[quarters]
        y = (0.0, y, free_y, y)[quarters]
    return room.left + 0.02 + x, room.bottom + 0.02 + y, quarters
