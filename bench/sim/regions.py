"""Places of a large world: regions of about a meter, to plan fast in large buildings.

A grid that resolves doors has millions of nodes in a large building. Here the connected nodes in
each square of the grid are one region. A route is planned over the regions, then refined over the
nodes of these regions and their neighbors. Regions are connected exactly where nodes are.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bench.sim.places import HALF_NEIGHBORS, Nodes, Numbers, graph_of, pairs, price, route_of
from bench.sim.world import Mask
from slams.types import Floats

REGION_SIZE = 1.0  # m, approximate edge of the squares
GOALS_PER_AREA = 6 / 400.0  # m^-2, random goals to choose from, as in smaller worlds


class Regions:
    """Each region of a part of the grid is a place, at its node with the largest clearance."""

    anywhere = 0.05  # share of goals that may lie anywhere; such legs are long

    def __init__(self, nodes: Nodes, part: Mask) -> None:
        part = np.pad(part[1:-1, 1:-1], 1)  # no node at an edge, so that offsets give neighbors
        side = max(2, round(REGION_SIZE / nodes.pitch))
        self.nodes = nodes
        self.step = side * nodes.pitch
        self.node_clearance = nodes.clearance.ravel()
        self.number = np.full(part.size, -1, np.int32)
        region = _cut(part, side)
        self._members(region.ravel())
        self.choice = math.ceil(GOALS_PER_AREA * self.step**2 * len(self.middle))
        self.points = nodes.points(*np.divmod(self.middle, part.shape[1]))
        self.clearance = self.node_clearance[self.middle].astype(np.float64)
        self.least = float(self.clearance.min())
        self.graph = graph_of(self._borders(region), price(self.clearance, self.least))

    def line(self, route: list[int]) -> Floats:
        """The shortest polyline (k, 2) [m] over nodes in a route's regions and their neighbors."""
        from scipy.sparse.csgraph import dijkstra

        channel = np.unique(np.concatenate([route, self.graph[route].indices]))
        nodes = np.concatenate([self.member[a:b] for a, b in self._spans(channel)])
        ends = self.middle[[route[0], route[-1]]]
        self.number[nodes] = np.arange(len(nodes))
        start, goal = self.number[ends].tolist()
        prices = price(self.node_clearance[nodes].astype(np.float64), self.least)
        graph = graph_of(self._steps(nodes), prices)
        self.number[nodes] = -1
        _, before = dijkstra(graph, indices=start, return_predecessors=True)
        path = nodes[route_of(before, start, goal)]
        return self.nodes.points(*np.divmod(path, self.nodes.open.shape[1]))

    def _members(self, region: Numbers) -> None:
        """Nodes by region, and the node of each region with the largest clearance."""
        nodes = np.flatnonzero(region >= 0).astype(np.int32)
        by_clearance = nodes[np.argsort(self.node_clearance[nodes], kind="stable")]
        self.middle = np.empty(int(region.max()) + 1, np.int32)
        self.middle[region[by_clearance]] = by_clearance  # the last one remains
        self.member = nodes[np.argsort(region[nodes], kind="stable")]
        self.ends = np.cumsum(np.bincount(region[nodes]))

    def _spans(self, regions: Numbers) -> list[tuple[int, int]]:
        """First and last index of the members of regions."""
        ends = self.ends[regions]
        starts = np.where(regions > 0, self.ends[regions - 1], 0)
        return list(zip(starts.tolist(), ends.tolist(), strict=True))

    def _borders(self, region: Numbers) -> list[tuple[Numbers, Numbers, Floats | float]]:
        """Pairs of regions that touch, and the distance of their places."""
        n, found = len(self.middle), []
        for dy, dx in HALF_NEIGHBORS:
            a, b = pairs(region, dy, dx)
            border = a != b
            low, high = np.minimum(a[border], b[border]), np.maximum(a[border], b[border])
            found.append(np.unique(low.astype(np.int64) * n + high))
        a, b = np.divmod(np.unique(np.concatenate(found)), n)
        return [(a, b, np.hypot(*(self.points[a] - self.points[b]).T))]

    def _steps(self, nodes: Numbers) -> list[tuple[Numbers, Numbers, Floats | float]]:
        """Steps between numbered nodes."""
        found: list[tuple[Numbers, Numbers, Floats | float]] = []
        for dy, dx in HALF_NEIGHBORS:
            there = self.number[nodes + dy * self.nodes.open.shape[1] + dx]
            a = np.flatnonzero(there >= 0)
            found.append((a, there[a], math.hypot(dy, dx)))
        return found


def _cut(part: Mask, side: int) -> NDArray[np.int32]:
    """Region numbers (my, mx) from 0 on, -1 for none; empty lines separate the squares."""
    import cv2

    (my, mx), by, bx = part.shape, -(-part.shape[0] // side), -(-part.shape[1] // side)
    squares = np.zeros((by, side + 1, bx, side + 1), np.uint8)
    whole = np.pad(part, ((0, by * side - my), (0, bx * side - mx)))
    squares[:, :side, :, :side] = whole.reshape(by, side, bx, side)
    flat = squares.reshape(by * (side + 1), bx * (side + 1))
    _, label = cv2.connectedComponents(flat, connectivity=8)
    region = label.reshape(by, side + 1, bx, side + 1)[:, :side, :, :side]
    cells = region.reshape(by * side, bx * side)[:my, :mx]
    return np.ascontiguousarray(cells, np.int32) - np.int32(1)
