"""Paths through a world from place to place, with clearance to its walls."""

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

PATH_SPACING = 0.02  # m between two points of a path
VISITED_RADIUS = 1.8  # m from the path; places within it count as visited
MAX_NODES = 200_000  # of the grid; larger worlds are planned by regions
TURN_BACK_DISTANCE = 2.5  # m behind the robot, where laps must not return
TURN_BACK_COST = 50.0  # factor of the cost of steps from there


class Routes:
    """Shortest paths with a preference for clearance, in the largest open part of a world.

    With `laps` a path does not turn back if possible: it goes around a ring.

    Raises:
        ValueError: the world has no room for a path.
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
        self.large = int(self.part.sum()) > MAX_NODES
        places = Regions if self.large else EveryNode
        self.places: EveryNode | Regions = places(nodes, self.part)

    def path(self, length: float, rng: Generator) -> Floats:
        """A path (m, 2) of at least `length` [m] from place to place, evenly sampled."""
        points = self.places.points
        here = int(np.argmax(self.places.clearance))
        lines, visited = [points[[here]]], np.zeros(len(points), np.bool_)
        total = 0.0
        while total < length:
            route = self._route(here, visited, self._graph(lines), rng)
            for place in route[:: max(1, math.floor(0.3 * VISITED_RADIUS / self.places.step))]:
                visited |= self._near(points[place])
            if visited.mean() > 0.9:
                visited[:] = False
            line = self.places.line(route)
            total += float(np.hypot(*np.diff(line, axis=0).T).sum())
            lines.append(line[1:])
            here = route[-1]
        return _smooth(np.concatenate(lines))

    def _route(self, start: int, visited: Mask, graph: csr_array, rng: Generator) -> list[int]:
        """The shortest route to the nearest of a few unvisited places; sometimes to any place."""
        from scipy.sparse.csgraph import dijkstra

        costs, befores = dijkstra(graph, indices=[start], return_predecessors=True)
        unvisited = np.flatnonzero(~visited)
        if rng.random() < 1.0 - self.places.anywhere:
            goals = rng.choice(unvisited, self.places.choice)
        else:
            goals = rng.integers(0, len(visited), 1)
        return route_of(befores[0], start, int(goals[np.argmin(costs[0][goals])]))

    def _near(self, point: Floats) -> Mask:
        near: Mask = np.hypot(*(self.places.points - point).T) < VISITED_RADIUS
        return near

    def _graph(self, lines: list[Floats]) -> csr_array:
        """The graph of the places; for laps, steps from the path behind the robot cost more."""
        if not self.laps or len(lines) < 2:
            return self.places.graph
        from scipy.sparse import diags_array

        path = np.concatenate(lines[-20:])
        distance = np.hypot(*(path - path[-1]).T)
        far = np.flatnonzero(distance > TURN_BACK_DISTANCE)
        behind = self._near(path[far[-1]]) if len(far) else np.zeros(len(self.places.points), bool)
        factors = diags_array(np.where(behind, TURN_BACK_COST, 1.0))
        graph: csr_array = (factors @ self.places.graph).tocsr()
        return graph


def _smooth(corners: Floats, width: float = 0.12) -> Floats:
    """The polyline (k, 2), evenly resampled and smoothed by a Gaussian of `width` [m]."""
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    even = np.arange(0.0, s[-1], PATH_SPACING)
    points = np.stack([np.interp(even, s, c) for c in corners.T], axis=1)
    n = math.ceil(3.0 * width / PATH_SPACING)
    kernel = np.exp(-0.5 * (np.arange(-n, n + 1) * PATH_SPACING / width) ** 2)
    padded = np.pad(points, ((n, n), (0, 0)), mode="edge")
    columns = [np.convolve(column, kernel / kernel.sum(), mode="valid") for column in padded.T]
    return np.stack(columns, axis=1)
