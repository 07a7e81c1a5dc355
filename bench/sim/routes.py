"""Ways through a world from place to place that keep clear of its walls."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.places import EveryNode, largest_part, nodes_of, route_of
from bench.sim.regions import Regions
from bench.sim.world import Mask, World
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator
    from scipy.sparse import csr_array

SPACING = 0.02  # m, between two points of a way
NEAR = 1.8  # m: a place this near to the way so far counts as visited
MANY = 200_000  # nodes: a world with more is planned region by region
BACK = 2.5  # m behind the robot is what it would rather not turn back to
AGAIN = 50.0  # times as dear it is to leave from there


class Routes:
    """Shortest ways that like the middle of the lanes, in the largest open part of a world.

    With `laps` a way goes on ahead where it can: around a ring instead of to and fro.

    Raises:
        ValueError: the world has no room for it.
    """

    def __init__(self, world: World, clearance: float, laps: bool = False) -> None:
        nodes = nodes_of(world, clearance)
        self.part = largest_part(nodes.open)
        if self.part.sum() < 50:
            raise ValueError(
                f"no room to drive with {clearance:.2f} m to every wall; expected a map with free"
                " space (check resolution and thresholds) or a smaller clearance"
            )
        self.laps = laps
        self.large = int(self.part.sum()) > MANY
        places = Regions if self.large else EveryNode
        self.places: EveryNode | Regions = places(nodes, self.part)

    def way(self, length: float, rng: Generator) -> Floats:
        """A way (m, 2) of at least `length` [m] that visits place after place, evenly spaced."""
        points = self.places.points
        here = int(np.argmax(self.places.clearance))
        lines, seen = [points[[here]]], np.zeros(len(points), np.bool_)
        total = 0.0
        while total < length:
            route = self._route(here, seen, self._graph(lines), rng)
            for place in route[:: max(1, math.floor(0.3 * NEAR / self.places.step))]:
                seen |= self._near(points[place])
            if seen.mean() > 0.9:
                seen[:] = False
            line = self.places.line(route)
            total += float(np.hypot(*np.diff(line, axis=0).T).sum())
            lines.append(line[1:])
            here = route[-1]
        return _smooth(np.concatenate(lines))

    def _route(self, start: int, seen: Mask, graph: csr_array, rng: Generator) -> list[int]:
        """The shortest way to the nearest of a few places not seen yet; now and then to any."""
        from scipy.sparse.csgraph import dijkstra

        costs, befores = dijkstra(graph, indices=[start], return_predecessors=True)
        fresh = np.flatnonzero(~seen)
        if rng.random() < 1.0 - self.places.anywhere:
            goals = rng.choice(fresh, self.places.choice)
        else:
            goals = rng.integers(0, len(seen), 1)
        return route_of(befores[0], start, int(goals[np.argmin(costs[0][goals])]))

    def _near(self, point: Floats) -> Mask:
        near: Mask = np.hypot(*(self.places.points - point).T) < NEAR
        return near

    def _graph(self, lines: list[Floats]) -> csr_array:
        """The graph of the places; for laps with dear steps away from where the way came from."""
        if not self.laps or len(lines) < 2:
            return self.places.graph
        from scipy.sparse import diags_array

        way = np.concatenate(lines[-20:])
        away = np.hypot(*(way - way[-1]).T)
        far = np.flatnonzero(away > BACK)
        behind = self._near(way[far[-1]]) if len(far) else np.zeros(len(self.places.points), bool)
        dearer: csr_array = (diags_array(np.where(behind, AGAIN, 1.0)) @ self.places.graph).tocsr()
        return dearer


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
