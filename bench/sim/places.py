"""Places a robot may go to and the steps between them: a fine grid over free space."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bench.sim.world import Mask, World
from slams.types import Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_array

MIN_NODE_DISTANCE = 0.06  # m between two nodes of the route graph
HALF_NEIGHBORS = ((0, 1), (1, 0), (1, 1), (1, -1))  # (dy, dx) to four of the eight neighbors
Numbers = NDArray[np.integer]


@dataclass(frozen=True)
class Nodes:
    """A grid of nodes in a world, every `cells`-th cell: `open`, `clearance` (my, mx) [m]."""

    open: Mask
    clearance: NDArray[np.float32]
    cells: int
    world: World

    @property
    def pitch(self) -> float:
        """Distance of two nodes [m]."""
        return self.cells * self.world.resolution

    def points(self, iy: Numbers, ix: Numbers) -> Floats:
        """Positions (n, 2) [m] of nodes."""
        k = self.cells
        cells = np.stack([ix * k + k // 2 + 0.5, iy * k + k // 2 + 0.5], axis=1)
        return np.asarray(cells * self.world.resolution + np.array(self.world.origin))


def nodes_of(world: World, clearance: float) -> Nodes:
    """Every k-th cell's center, open where all walls are at least `clearance` [m] away."""
    k = max(1, math.floor(MIN_NODE_DISTANCE / world.resolution + 1e-9))
    room = world.clearance[k // 2 :: k, k // 2 :: k]
    return Nodes(room.astype(np.float64) >= clearance, room, k, world)


class EveryNode:
    """Every node of a part of the grid is a place; large worlds use `bench.sim.regions`.

    `points` (n, 2) [m], `clearance` (n,) [m], `graph` (n, n) of costs; `step` [m] is the
    approximate distance of two neighbors. A goal is the nearest of `choice` random places; for a
    share `anywhere` of the goals it is any place.
    """

    choice = 6
    anywhere = 0.15

    def __init__(self, nodes: Nodes, part: Mask) -> None:
        self.step = MIN_NODE_DISTANCE
        self.clearance = nodes.clearance[part].astype(np.float64)
        self.points = nodes.points(*np.nonzero(part))
        index = np.full(part.shape, -1)
        index[part] = np.arange(len(self.points))
        steps = [(*pairs(index, dy, dx), math.hypot(dy, dx)) for dy, dx in HALF_NEIGHBORS]
        self.graph = graph_of(steps, price(self.clearance, float(self.clearance.min())))

    def line(self, route: list[int]) -> Floats:
        """The polyline (k, 2) [m] along a route over places."""
        line: Floats = self.points[route]
        return line


def price(room: Floats, least: float) -> Floats:
    """Cost factor (n,) of a step: larger near walls, maximal at the `least` clearance [m]."""
    return np.asarray(1.0 + 6.0 * np.exp(-(room - least) / 0.15))


def graph_of(steps: Iterable[tuple[Numbers, Numbers, Floats | float]], prices: Floats) -> csr_array:
    """Steps from places a to b of a length, and back, at the mean of their prices (n,)."""
    from scipy.sparse import csr_array

    rows, columns, costs = [], [], []
    for a, b, length in steps:
        rows += [a, b]
        columns += [b, a]
        costs += [0.5 * length * (prices[a] + prices[b])] * 2
    n = len(prices)
    entries = (np.concatenate(rows), np.concatenate(columns))
    return csr_array((np.concatenate(costs), entries), shape=(n, n))


def pairs(index: Numbers, dy: int, dx: int) -> tuple[Numbers, Numbers]:
    """Numbers of the nodes, and of those (dy, dx) further, where both exist."""
    my, mx = index.shape
    a = index[: my - dy, max(0, -dx) : mx - max(0, dx)].ravel()
    b = index[dy:, max(0, dx) : mx + min(0, dx)].ravel()
    both = (a >= 0) & (b >= 0)
    return a[both], b[both]


def route_of(before: Numbers, start: int, goal: int) -> list[int]:
    """The places from `start` to `goal`; `before` is the predecessor of each place."""
    route = [goal]
    while route[-1] != start:
        route.append(int(before[route[-1]]))
    return route[::-1]


def largest_part(mask: Mask) -> Mask:
    """The largest 8-connected component of a mask."""
    import cv2

    _, label, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    if len(stats) < 2:
        return np.zeros_like(mask)
    largest: Mask = label == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return largest
