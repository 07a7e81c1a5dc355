"""A seeded arena like those of RoboCup Rescue: a maze of wall panels with obstacles.

After the standard test methods of the NIST arenas: square lanes between plywood panels, rooms,
dead ends, doorways, blocks, boxes and pallets, slanted panels, barrels and posts. Every lane stays
reachable for a robot that keeps `MAZE_CLEARANCE` to all occupied cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bench.sim.canvas import Canvas, Outline, pieces, rectangle, round_outline
from bench.sim.world import Mask, World

if TYPE_CHECKING:
    from numpy.random import Generator

PANEL_THICKNESS = 0.08  # m, with its battens
LANE_WIDTHS = (1.3, 1.7)  # m; NIST: 1.2 m lanes, RoboCup maps up to 1.6 m
MAZE_CLEARANCE = 0.46  # m on both sides of a path
REMOVED_PANEL_SHARE = 0.42  # of the panels beyond those removed to connect the maze
DOORWAY_SHARE = 0.06  # of the openings
DOORWAY_WIDTH = 1.0  # m


@dataclass
class Plan:
    """Lanes (ny, nx) of the arena and the panels between them.

    `lane` are open squares, `block` solid ones. `west` (ny, nx + 1) has the panel left of square
    ix, `south` (ny + 1, nx) the one below square iy: 0 none, 1 a panel, 2 one with a doorway.
    """

    lane: Mask
    block: Mask
    west: NDArray[np.int8] = field(init=False)
    south: NDArray[np.int8] = field(init=False)

    def __post_init__(self) -> None:
        padded = np.pad(self.lane, 1)
        self.west = (padded[1:-1, :-1] | padded[1:-1, 1:]).astype(np.int8)
        self.south = (padded[:-1, 1:-1] | padded[1:, 1:-1]).astype(np.int8)

    def edges(
        self,
    ) -> list[tuple[NDArray[np.int8], tuple[int, int], tuple[int, int], tuple[int, int]]]:
        """Every panel between two lanes: its array, its index there, and the two lanes."""
        found = []
        for iy, ix in np.argwhere(self.lane).tolist():
            if ix and self.lane[iy, ix - 1]:
                found.append((self.west, (iy, ix), (iy, ix - 1), (iy, ix)))
            if iy and self.lane[iy - 1, ix]:
                found.append((self.south, (iy, ix), (iy - 1, ix), (iy, ix)))
        return found


def rescue_arena(rng: Generator, resolution: float = 0.02, size: float = 20.0) -> World:
    """An arena of about `size` x `size` metres; same generator state, same arena.

    Raises:
        ValueError: the cells are too coarse for the panels, or the size is too small.
    """
    pitch = round(float(rng.uniform(*LANE_WIDTHS)) / resolution)
    n = int(size / (pitch * resolution))
    if not 4 <= n <= 100:
        raise ValueError(f"size: got {size} m, expected 7 to 130 for the arena")
    plan = _plan(n, rng)
    canvas = MazeCanvas(plan, pitch, resolution)
    for place in rng.permutation(np.argwhere(plan.lane)).tolist():
        if rng.random() < 0.45:
            canvas.furnish(place, rng)
    return canvas.world()


def _plan(n: int, rng: Generator) -> Plan:
    """The maze: a spanning tree of lanes, with more panels removed."""
    lane = _outline(n, rng)
    block = _blocks(lane, rng)
    plan = Plan(lane & ~block, block)
    edges = plan.edges()
    group = {(iy, ix): (iy, ix) for iy, ix in np.argwhere(plan.lane).tolist()}
    room = _rooms(n, rng)
    for k in rng.permutation(len(edges)).tolist():
        panels, at, a, b = edges[k]
        first, second = _root(group, a), _root(group, b)
        group[first] = second
        if first != second:
            panels[at] = 2 if rng.random() < DOORWAY_SHARE else 0
        elif rng.random() < REMOVED_PANEL_SHARE:
            panels[at] = 0
        if room[a] and room[a] == room[b]:
            panels[at] = 0
    return plan


def _root(group: dict[tuple[int, int], tuple[int, int]], a: tuple[int, int]) -> tuple[int, int]:
    while group[a] != a:
        a = group[a]
    return a


def _outline(n: int, rng: Generator) -> Mask:
    """A square of n x n with corners cut in steps, up to a diamond."""
    iy, ix = np.mgrid[:n, :n]
    cut = rng.uniform(0.05, 0.5, 4) * n
    ends = (ix + iy, ix + n - 1 - iy, n - 1 - ix + iy, 2 * n - 2 - ix - iy)
    inside: Mask = np.all([end >= c for end, c in zip(ends, cut, strict=True)], axis=0)
    return inside


def _blocks(lane: Mask, rng: Generator) -> Mask:
    """One square in twenty is solid, if the others stay connected."""
    block = np.zeros_like(lane)
    places = rng.permutation(np.argwhere(lane))
    for iy, ix in places[: len(places) // 20].tolist():
        block[iy, ix] = True
        if pieces(lane & ~block) > 1:
            block[iy, ix] = False
    return block


def _rooms(n: int, rng: Generator) -> NDArray[np.int64]:
    """Rectangles of 2 to 3 lanes without panels inside, numbered from 1."""
    room = np.zeros((n, n), np.int64)
    for k in range(n // 4):
        (iy, ix), (ny, nx) = rng.integers(0, n - 1, 2).tolist(), rng.integers(2, 4, 2).tolist()
        room[iy : iy + ny, ix : ix + nx] = k + 1
    return room


class MazeCanvas(Canvas):
    """Draws a plan and its furniture; metres are measured from the first lane's corner."""

    def __init__(self, plan: Plan, pitch: int, resolution: float) -> None:
        ny, nx = plan.lane.shape
        super().__init__((ny * pitch, nx * pitch), resolution)
        self.pitch = pitch
        self.plan = plan
        for iy, ix in np.argwhere(plan.lane | plan.block).tolist():
            square = self._square(iy, ix)
            self.inside[square] = True
            self.occupied[square] = plan.block[iy, ix]
        self._panels()

    def furnish(self, lane: tuple[int, int], rng: Generator) -> None:
        """Put one element into a lane, unless it would block a path; four attempts."""
        element = MAZE_ELEMENTS[int(rng.integers(len(MAZE_ELEMENTS)))]
        edge = self.pitch * self.resolution
        corner = np.array([lane[1] * edge, lane[0] * edge])
        nooks = self._nooks(*lane)
        for _ in range(4):
            outlines = [corner + outline for outline in element(edge, nooks, rng)]
            if self.put(outlines, MAZE_CLEARANCE):
                return

    def _nooks(self, iy: int, ix: int) -> list[int]:
        """Corners of a lane, counter-clockwise from the low one, where two panels meet."""
        west, south = self.plan.west, self.plan.south
        around = (west[iy, ix], south[iy, ix], west[iy, ix + 1], south[iy + 1, ix])
        return [k for k in range(4) if around[k] == 1 and around[(k + 1) % 4] == 1]

    def _square(self, iy: int, ix: int) -> tuple[slice, slice]:
        y, x = self.margin + iy * self.pitch, self.margin + ix * self.pitch
        return slice(y, y + self.pitch), slice(x, x + self.pitch)

    def _panels(self) -> None:
        """Draw panels between squares, half a thickness longer at each end."""
        half = max(1, round(0.5 * PANEL_THICKNESS / self.resolution))
        side = round(0.5 * (self.pitch - DOORWAY_WIDTH / self.resolution))
        for panels, turned in ((self.plan.south, False), (self.plan.west.T, True)):
            canvas = self.occupied.T if turned else self.occupied
            for iy, ix in np.argwhere(panels).tolist():
                y, x = self.margin + iy * self.pitch, self.margin + ix * self.pitch
                row = canvas[y - half : y + half, x - half : x + self.pitch + half]
                row[:, : side + half if panels[iy, ix] == 2 else None] = True
                row[:, -side - half :] = True


def _place(edge: float, margin: float, rng: Generator) -> tuple[float, float]:
    """A point of the lane at least `margin` [m] from its borders."""
    x, y = rng.uniform(margin, edge - margin, 2).tolist()
    return x, y


def _barrel(edge: float, nooks: list[int], rng: Generator) -> list[Outline]:
    """An upright barrel or pipe."""
    radius = float(rng.uniform(0.1, 0.29))
    return [round_outline(_place(edge, radius, rng), radius)]


def _posts(edge: float, nooks: list[int], rng: Generator) -> list[Outline]:
    """Up to three thin square posts."""
    return [
        rectangle(_place(edge, 0.1, rng), 0.1, 0.1, 0.0) for _ in range(int(rng.integers(1, 4)))
    ]


def _box(edge: float, nooks: list[int], rng: Generator) -> list[Outline]:
    """A crate, pallet or step field, mostly parallel to the panels."""
    length, width = rng.uniform(0.25, 0.8, 2).tolist()
    angle = float(rng.uniform(0.0, math.pi)) if rng.random() < 0.3 else 0.0
    return [rectangle(_place(edge, 0.5 * min(length, width), rng), length, width, angle)]


def _slanted(edge: float, nooks: list[int], rng: Generator) -> list[Outline]:
    """A free-standing panel at any angle."""
    length, angle = float(rng.uniform(0.5, 1.0)), float(rng.uniform(0.0, math.pi))
    return [rectangle(_place(edge, 0.2, rng), length, PANEL_THICKNESS, angle)]


def _corner(edge: float, nooks: list[int], rng: Generator) -> list[Outline]:
    """A panel across a corner between two panels; without a corner a free-standing panel."""
    if not nooks:
        return _slanted(edge, nooks, rng)
    cut = float(rng.uniform(0.3, 0.6)) * edge
    triangle = np.array([[0.0, 0.0], [cut, 0.0], [0.0, cut]])
    middle = np.array([0.5 * edge, 0.5 * edge])
    outline = triangle - middle
    for _ in range(nooks[int(rng.integers(len(nooks)))]):
        outline = np.stack([-outline[:, 1], outline[:, 0]], axis=1)  # a quarter turn
    return [outline + middle]


MAZE_ELEMENTS = (_barrel, _posts, _box, _box, _slanted, _corner)
