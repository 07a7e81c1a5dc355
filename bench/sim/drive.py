"""Smooth drives through a world that touch nothing, and people who walk about in it."""

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
MARGIN = 0.1  # m, by which the planned way keeps off more than the drive must
BRAKE = 0.8  # share of the deceleration counted on ahead of bends
# look-ahead [m] and share of the speed, from brisk to careful, until the drive touches nothing
CARE = ((0.4, 1.0), (0.3, 1.0), (0.2, 1.0), (0.1, 1.0), (0.2, 0.5), (0.1, 0.3))
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


@dataclass(frozen=True)
class Drive:
    """True motion at a fine, even rate: t (n,) [s], poses (n, 3), rates (n, 2) v, w."""

    t: Floats
    poses: Floats
    rates: Floats

    def poses_at(self, t: Floats) -> Floats:
        """Poses (m, 3) at stamps t (m,), heading not wrapped."""
        poses: Floats = np.stack([np.interp(t, self.t, c) for c in self.poses.T], axis=1)
        return poses

    @property
    def travelled(self) -> Floats:
        """Length of the way so far (n,) [m]."""
        steps = np.hypot(*np.diff(self.poses[:, :2], axis=0).T)
        return np.concatenate([[0.0], np.cumsum(steps)])


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


@dataclass(frozen=True)
class Robot:
    """How something moves.

    At most `v` [m/s], `w` [rad/s], `dv` [m/s^2] and `dw` [rad/s^2], `clearance` [m] from all walls.
    """

    v: float = 0.5
    w: float = 0.8
    clearance: float = 0.3
    dv: float = 0.5
    dw: float = 1.5


def drive(world: World, robot: Robot, rng: Generator, seconds: float, rate: float) -> Drive:
    """A drive from rest of `seconds` [s], with `rate` samples a second.

    Raises:
        ValueError: the world has no room for it.
    """
    from bench.sim.drive_kernels import Limits, follow

    way = Routes(world, robot.clearance + MARGIN).way(1.2 * robot.v * seconds + 2.0, rng)
    pace = _pace(way, _room(world, way), robot)
    states = np.empty((math.ceil(seconds * rate - 1e-6) + 1, 5))
    for look_ahead, share in CARE:
        limits = Limits(robot.w, robot.dv, robot.dw, look_ahead)
        follow(way, share * pace, limits, 1.0 / rate, states)
        if _room(world, states[:, :2]).min() >= robot.clearance:
            return Drive(np.arange(len(states)) / rate, states[:, :3], states[:, 3:])
    raise ValueError(
        f"no drive keeps {robot.clearance:.2f} m to every wall; give a smaller clearance"
    )


def drive_far(world: World, robot: Robot, rng: Generator, metres: float, rate: float) -> Drive:
    """A drive from rest that ends after `metres` [m] of way."""
    seconds, state = 2.0 * metres / robot.v + 60.0, rng.bit_generator.state
    while True:
        rng.bit_generator.state = state
        far = drive(world, robot, rng, seconds, rate)
        if far.travelled[-1] >= metres:
            n = int(np.searchsorted(far.travelled, metres)) + 1
            return Drive(far.t[:n], far.poses[:n], far.rates[:n])
        seconds *= 2.0


def _pace(way: Floats, room: Floats, robot: Robot) -> Floats:
    """Speed (m,) [m/s] at each point of a way (m, 2): less where it is narrow or bends."""
    n, here = round(0.15 / SPACING), np.arange(len(way))
    before = way - way[np.maximum(here - n, 0)]
    after = way[np.minimum(here + n, len(way) - 1)] - way
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    bend = np.abs(np.arctan2(cross, (before * after).sum(axis=1)))
    narrow = robot.v * np.clip(room / 0.6, 0.5, 1.0)
    speed: Floats = np.minimum(narrow, 0.3 * robot.w / np.maximum(bend, 1e-3))
    for i in range(len(speed) - 2, -1, -1):  # brake in time
        speed[i] = min(speed[i], math.sqrt(speed[i + 1] ** 2 + 2.0 * SPACING * BRAKE * robot.dv))
    return speed


def _room(world: World, points: Floats) -> Floats:
    """At least this far [m] are points (n, 2) from the nearest wall's square."""
    half_diagonals = math.sqrt(2.0) * world.resolution  # of the point's own cell and of the wall's
    room = world.clearance[world.cells_of(points)].astype(np.float64)
    return np.asarray(room - half_diagonals)


LEG = 0.06  # m, radius of a leg with trousers


def legs(world: World, robot: Drive, people: int, rng: Generator) -> Floats:
    """Where the legs (n, 2 * people, 2) [m] of walking people are at each sample of the drive.

    People walk 0.8 to 1.2 m/s on ways of their own and step aside when the robot comes near.
    """
    rate, seconds = 1.0 / (robot.t[1] - robot.t[0]), float(robot.t[-1])
    both = []
    for one in rng.spawn(people):
        v = float(one.uniform(0.8, 1.2))
        walk = drive(world, Robot(v, 2.0, 0.25, 2.0, 6.0), one, seconds, rate)
        middle = _aside(walk.poses[:, :2], robot.poses[:, :2], 0.6)
        swing = 0.25 * np.sin(math.pi / 0.7 * walk.travelled)[:, None]
        c, s = np.cos(walk.poses[:, 2]), np.sin(walk.poses[:, 2])
        ahead, left = np.stack([c, s], axis=1), np.stack([-s, c], axis=1)
        both += [middle + swing * ahead + 0.1 * left, middle - swing * ahead - 0.1 * left]
    return np.stack(both, axis=1)


def _aside(points: Floats, robot: Floats, least: float) -> Floats:
    """Points (n, 2) moved straight away from the robot's (n, 2) to at least `least` [m]."""
    away = points - robot
    distance = np.hypot(*away.T)[:, None]
    return np.asarray(robot + away * np.maximum(1.0, least / np.maximum(distance, 1e-6)))
