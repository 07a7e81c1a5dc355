"""Places of a large world: regions of about a metre, so that planning takes time with the way only.

A grid fine enough for doors has millions of nodes in a large building. Here it is cut into squares,
and the nodes of a square that hang together are one region. A route is found over the regions, then
the way over the nodes of those regions and their neighbors: what hangs together in the grid does so
here, and each leg looks only at the nodes around it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bench.sim.places import NEIGHBORS, Nodes, Numbers, graph_of, pairs, price, route_of
from bench.sim.world import Mask
from slams.types import Floats

SIDE = 1.0  # m, about, of the squares that are cut
CHOICE = 6 / 400.0  # m^-2, goals to choose from: as many as in the smaller worlds for their area


class Regions:
    """Each region of a part of the grid is a place: the node there with most room."""

    anywhere = 0.05  # in large worlds such legs are long

    def __init__(self, nodes: Nodes, part: Mask) -> None:
        part = np.pad(part[1:-1, 1:-1], 1)  # no node lies at an edge: neighbors by offsets
        side = max(2, round(SIDE / nodes.pitch))
        self.nodes = nodes
        self.step = side * nodes.pitch
        self.room = nodes.clearance.ravel()
        self.number = np.full(part.size, -1, np.int32)
        region = _cut(part, side)
        self._members(region.ravel())
        self.choice = math.ceil(CHOICE * self.step**2 * len(self.middle))
        self.points = nodes.points(*np.divmod(self.middle, part.shape[1]))
        self.clearance = self.room[self.middle].astype(np.float64)
        self.least = float(self.clearance.min())
        self.graph = graph_of(self._borders(region), price(self.clearance, self.least))

    def line(self, route: list[int]) -> Floats:
        """The shortest polyline (k, 2) [m] over nodes in a route's regions and those beside."""
        from scipy.sparse.csgraph import dijkstra

        channel = np.unique(np.concatenate([route, self.graph[route].indices]))
        nodes = np.concatenate([self.member[a:b] for a, b in self._spans(channel)])
        ends = self.middle[[route[0], route[-1]]]
        self.number[nodes] = np.arange(len(nodes))
        start, goal = self.number[ends].tolist()
        graph = graph_of(self._steps(nodes), price(self.room[nodes].astype(np.float64), self.least))
        self.number[nodes] = -1
        _, before = dijkstra(graph, indices=start, return_predecessors=True)
        way = nodes[route_of(before, start, goal)]
        return self.nodes.points(*np.divmod(way, self.nodes.open.shape[1]))

    def _members(self, region: Numbers) -> None:
        """Nodes by region, and of each region the one with most room."""
        nodes = np.flatnonzero(region >= 0).astype(np.int32)
        roomy = nodes[np.argsort(self.room[nodes], kind="stable")]
        self.middle = np.empty(int(region.max()) + 1, np.int32)
        self.middle[region[roomy]] = roomy  # the last one stays
        self.member = nodes[np.argsort(region[nodes], kind="stable")]
        self.ends = np.cumsum(np.bincount(region[nodes]))

    def _spans(self, regions: Numbers) -> list[tuple[int, int]]:
        """Where the members of regions stand."""
        ends = self.ends[regions]
        starts = np.where(regions > 0, self.ends[regions - 1], 0)
        return list(zip(starts.tolist(), ends.tolist(), strict=True))

    def _borders(self, region: Numbers) -> list[tuple[Numbers, Numbers, Floats | float]]:
        """Pairs of regions that touch, and the distance of their places."""
        n, found = len(self.middle), []
        for dy, dx in NEIGHBORS:
            a, b = pairs(region, dy, dx)
            apart = a != b
            low, high = np.minimum(a[apart], b[apart]), np.maximum(a[apart], b[apart])
            found.append(np.unique(low.astype(np.int64) * n + high))
        a, b = np.divmod(np.unique(np.concatenate(found)), n)
        return [(a, b, np.hypot(*(self.points[a] - self.points[b]).T))]

    def _steps(self, nodes: Numbers) -> list[tuple[Numbers, Numbers, Floats | float]]:
        """Steps between numbered nodes."""
        found: list[tuple[Numbers, Numbers, Floats | float]] = []
        for dy, dx in NEIGHBORS:
            there = self.number[nodes + dy * self.nodes.open.shape[1] + dx]
            a = np.flatnonzero(there >= 0)
            found.append((a, there[a], math.hypot(dy, dx)))
        return found


def _cut(part: Mask, side: int) -> NDArray[np.int32]:
    """Regions (my, mx) from 0 on, -1 for none: a line of nothing between squares parts them."""
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
