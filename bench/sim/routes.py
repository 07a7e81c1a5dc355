"""Ways through a world from place to place that keep clear of its walls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.world import Mask, World
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator
    from scipy.sparse import csr_array

STEP = 0.06  # m, least distance of two nodes of the route graph
SPACING = 0.02  # m, between two points of a way
NEAR = 1.8  # m: a place this near to the way so far counts as visited


@dataclass(frozen=True)
class Nodes:
    """A coarse grid of places: `open` (my, mx), `clearance` [m] and position (my, mx, 2) [m]."""

    open: Mask
    clearance: Floats
    position: Floats


def nodes_of(world: World, clearance: float) -> Nodes:
    """Every k-th cell's center, open where all walls are at least `clearance` [m] away."""
    k = max(1, math.floor(STEP / world.resolution + 1e-9))
    room = world.clearance[k // 2 :: k, k // 2 :: k].astype(np.float64)
    iy, ix = np.indices(room.shape) * k + k // 2 + 0.5
    position = np.stack([ix, iy], axis=2) * world.resolution + np.array(world.origin)
    return Nodes(room >= clearance, room, position)


class Routes:
    """Shortest ways that like the middle of the lanes, in the largest open part of a world."""

    def __init__(self, world: World, clearance: float) -> None:
        self.world = world
        self.nodes = nodes_of(world, clearance)
        self.part = _largest_part(self.nodes.open)
        if self.part.sum() < 50:
            raise ValueError(
                f"no room to drive with {clearance:.2f} m to every wall; expected a map with free"
                " space (check resolution and thresholds) or a smaller clearance"
            )
        self.index = np.full(self.part.shape, -1)
        self.index[self.part] = np.arange(int(self.part.sum()))
        self.points = self.nodes.position[self.part]
        self.graph = self._graph()

    def way(self, length: float, rng: Generator) -> Floats:
        """A way (m, 2) of at least `length` [m] that visits place after place, evenly spaced."""
        here = int(np.argmax(self.nodes.clearance[self.part]))
        nodes, seen = [here], np.zeros(len(self.points), np.bool_)
        total = 0.0
        while total < length:
            route = self._route(here, seen, rng)
            for node in route[:: max(1, math.floor(0.3 * NEAR / STEP))]:
                seen |= np.hypot(*(self.points - self.points[node]).T) < NEAR
            if seen.mean() > 0.9:
                seen[:] = False
            total += float(np.hypot(*np.diff(self.points[route], axis=0).T).sum())
            nodes += route[1:]
            here = nodes[-1]
        return _smooth(self.points[nodes])

    def _route(self, start: int, seen: Mask, rng: Generator) -> list[int]:
        """The shortest way to the nearest of a few places not seen yet; now and then to any."""
        from scipy.sparse.csgraph import dijkstra

        costs, befores = dijkstra(self.graph, indices=[start], return_predecessors=True)
        cost, before = costs[0], befores[0]
        fresh = np.flatnonzero(~seen)
        goals = rng.choice(fresh, 6) if rng.random() < 0.85 else rng.integers(0, len(seen), 1)
        route = [int(goals[np.argmin(cost[goals])])]
        while route[-1] != start:
            route.append(int(before[route[-1]]))
        return route[::-1]

    def _graph(self) -> csr_array:
        """Steps to the eight neighbors, dearer where walls are near."""
        from scipy.sparse import csr_array

        room = self.nodes.clearance[self.part]
        price = 1.0 + 6.0 * np.exp(-(room - room.min()) / 0.15)
        rows, columns, costs = [], [], []
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            a, b = _pairs(self.index, dy, dx)
            rows += [a, b]
            columns += [b, a]
            costs += [0.5 * math.hypot(dy, dx) * (price[a] + price[b])] * 2
        n = len(room)
        entries = (np.concatenate(rows), np.concatenate(columns))
        return csr_array((np.concatenate(costs), entries), shape=(n, n))


def _pairs(index: np.ndarray, dy: int, dx: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the nodes, and of those (dy, dx) further, where both exist."""
    my, mx = index.shape
    a = index[: my - dy, max(0, -dx) : mx - max(0, dx)].ravel()
    b = index[dy:, max(0, dx) : mx + min(0, dx)].ravel()
    both = (a >= 0) & (b >= 0)
    return a[both], b[both]


def _largest_part(mask: Mask) -> Mask:
    import cv2

    _, label, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    if len(stats) < 2:
        return np.zeros_like(mask)
    largest: Mask = label == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return largest


def _smooth(corners: Floats, width: float = 0.12) -> Floats:
    """The polyline (k, 2) resampled evenly and rounded by a Gaussian of `width` [m]."""
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    even = np.arange(0.0, s[-1], SPACING)
    points = np.stack([np.interp(even, s, c) for c in corners.T], axis=1)
    n = math.ceil(3.0 * width / SPACING)
    bell = np.exp(-0.5 * (np.arange(-n, n + 1) * SPACING / width) ** 2)
    padded = np.pad(points, ((n, n), (0, 0)), mode="edge")
    columns = [np.convolve(column, bell / bell.sum(), mode="valid") for column in padded.T]
    return np.stack(columns, axis=1)
