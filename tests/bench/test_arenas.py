"""Arenas: what stands there, robots come everywhere; planning large worlds."""

import math
from functools import cache

import cv2
import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from bench.sim import furniture, routes
from bench.sim.drive import Robot, drive
from bench.sim.places import EveryNode, largest_part, nodes_of, price, route_of
from bench.sim.regions import Regions
from bench.sim.routes import Routes
from bench.sim.setting import ARENAS, Setting
from bench.sim.simulation import build_arena, simulate, world_of
from slams.metrics import driven
from tests.rooms import calls

CASES = [(name, seed) for name in ARENAS for seed in range(3)]
DRIVES = {"rescue": (60.0, 0.5), "office": (150.0, 1.0), "hall": (60.0, 0.5), "ring": (260.0, 0.5)}


@cache
def arena(name, seed, size=None, resolution=None):
    return build_arena(name, np.random.default_rng(seed), resolution, size)


@cache
def drive_of(name, seed):
    seconds, v = DRIVES[name]  # s, m/s
    robot = Robot(v, laps=ARENAS[name].laps)
    return drive(arena(name, seed), robot, np.random.default_rng(seed), seconds, 40.0)


def around(world, points, beams=360):
    """Distances (n, beams) [m] to what stands around points (n, 2)."""
    angles = np.linspace(0.0, 2.0 * math.pi, beams, endpoint=False)
    rays = np.column_stack([np.repeat(points, beams, axis=0), np.tile(angles, len(points))])
    return world.cast(rays).reshape(-1, beams)


PIECES = "desk cupboard table bin_or_plant copier pallets crates machine"


@pytest.mark.parametrize("name", PIECES.split())
def test_furniture_stands_in_its_footprint_and_fills_it(name):
    for seed in range(20):
        piece = getattr(furniture, name)(np.random.default_rng(seed))
        for quarters in range(4):
            outlines = np.vstack(piece.at(3.0, -2.0, quarters))
            low = outlines.min(axis=0) - (3.0, -2.0)
            high = outlines.max(axis=0) - (3.0, -2.0) - piece.sides(quarters)
            assert np.maximum(-low, high).max() < 0.05
            assert np.maximum(low, -high).max() < 0.5


@pytest.mark.parametrize(("name", "seed"), CASES)
def test_a_robot_comes_within_reach_of_every_place(name, seed):
    """One piece for the robot, and no free place is far from where it can stand."""
    world = arena(name, seed)
    nodes = nodes_of(world, 0.4)
    part = largest_part(nodes.open)
    assert part.sum() > 0.995 * nodes.open.sum()
    k = nodes.cells
    free = world.free[k // 2 :: k, k // 2 :: k]
    away = cv2.distanceTransform((~part).astype(np.uint8), cv2.DIST_L2, 5) * nodes.pitch
    assert (away[free] > 1.2).mean() < 0.007
    assert around(world, nodes.points(*np.nonzero(part))[::997], 36).max() < np.inf


@pytest.mark.parametrize(("name", "seed"), CASES)
def test_a_drive_keeps_its_clearance(name, seed):
    true = drive_of(name, seed)
    assert around(arena(name, seed), true.poses[::10, :2]).min() >= 0.3
    assert driven(true.poses)[-1] > 0.35 * true.t[-1]


def test_even_a_fast_drive_touches_nothing():
    world, robot = arena("rescue", 1, 8.0), Robot(v=1.5, w=1.0, clearance=0.3)
    fast = drive(world, robot, np.random.default_rng(1), 60.0, 200.0)
    assert around(world, fast.poses[::40, :2]).min() >= 0.3


@pytest.mark.parametrize("name", ARENAS)
def test_same_seed_same_log_and_another_seed_another(name, tmp_path):
    written = []
    for k, seed in enumerate((1, 1, 2)):
        small = {"duration": 0.5, "sensor": "lds01", "resolution": 0.05, "size": 24.0}
        log = simulate(Setting(arena=name, seed=seed, **small))
        log.save(tmp_path / f"{k}.npz")
        written.append((tmp_path / f"{k}.npz").read_bytes())
        assert world_of(log).fingerprint == log.meta["simulated"]["world"]
    assert written[0] == written[1] != written[2]
    assert len({arena(name, seed).fingerprint for seed in range(3)}) == 3


def test_a_log_tells_the_size_it_was_made_with():
    log = simulate(Setting(arena="ring", duration=0.5, sensor="lds01"))
    assert log.meta["simulated"]["size"] == ARENAS["ring"].size


@pytest.mark.parametrize(
    ("name", "ratio"), [("rescue", 1.0), ("office", 0.625), ("hall", 0.67), ("ring", 0.68)]
)
@pytest.mark.parametrize("scale", [1.0, 0.6])
def test_size_is_the_longer_side(name, ratio, scale):
    size = scale * ARENAS[name].size
    left, right, bottom, top = arena(name, 0, size, 0.05).extent
    assert right - left == pytest.approx(size, rel=0.1, abs=0.5)
    assert (top - bottom) / (right - left) == pytest.approx(ratio, abs=0.1)


@pytest.mark.parametrize("name", ARENAS)
def test_sizes_and_cells_an_arena_cannot_have_are_refused(name):
    for size in (ARENAS[name].least - 0.1, ARENAS[name].most + 0.1):
        with pytest.raises(ValueError, match=rf"^size: got {size:g}\b.*expected .* {name} arena$"):
            arena(name, 0, size)
    with pytest.raises(ValueError, match=r"resolution: got 0\.2 m"):
        arena(name, 0, None, 0.2)


@pytest.mark.parametrize("seed", range(3))
def test_the_ring_is_a_bare_corridor(seed):
    """As wide on all four sides, walls straight from corner to corner, nothing else."""
    world = arena("ring", seed)
    left, right, bottom, top = world.extent
    inner = 0.2 + 0.2 + 1.0  # m: margin, wall, half a corridor
    west, east, south, north = left + inner, right - inner, bottom + inner, top - inner
    u = np.linspace(0.1, 0.9, 50)
    sides = [
        np.column_stack([west + u * (east - west), np.full(50, y)]) for y in (south, north)
    ] + [np.column_stack([np.full(50, x), south + u * (north - south)]) for x in (west, east)]
    widths = []
    for k, side in enumerate(sides):
        here = around(world, side, 4)
        widths.append((here[:, 1] + here[:, 3]) if k < 2 else (here[:, 0] + here[:, 2]))
    widths = np.array(widths)
    assert widths.min() >= 1.78 and widths.max() <= 2.22
    assert np.ptp(widths) <= world.resolution + 1e-9
    pieces = cv2.connectedComponents(world.occupied.astype(np.uint8))[0] - 1
    assert pieces == 2  # the outer walls and the block


@pytest.mark.parametrize("seed", range(2))
def test_a_drive_in_the_ring_goes_around_and_on(seed):
    left, right, bottom, top = arena("ring", seed).extent
    middle = np.array([0.5 * (left + right), 0.5 * (bottom + top)])
    away = drive_of("ring", seed).poses[:, :2] - middle
    angle = np.unwrap(np.arctan2(away[:, 1], away[:, 0]))
    assert abs(angle[-1] - angle[0]) > 2.2 * math.pi
    on = np.diff(angle) * np.sign(angle[-1] - angle[0])
    assert on[on < 0].sum() > -0.2  # never back by more than the steps into a goal


def grid(size=12.0, seed=1):
    """A maze's nodes and their largest part, its border closed as the regions do."""
    nodes = nodes_of(arena("rescue", seed, size), 0.4)
    return nodes, largest_part(nodes.open)


def cost(world, line):
    """What a polyline (n, 2) costs when room is worth a detour."""
    prices = price(world.clearance[world.cells_of(line)].astype(float), 0.4)
    return (np.hypot(*np.diff(line, axis=0).T) * 0.5 * (prices[1:] + prices[:-1])).sum()


def test_ways_over_regions_are_nearly_the_best():
    nodes, part = grid()
    regions, exact = Regions(nodes, part), EveryNode(nodes, part)
    number = np.cumsum(part.ravel()) - 1
    rng = np.random.default_rng(0)
    costs = []
    for start, goal in rng.integers(0, len(regions.points), (12, 2)).tolist():
        _, before = dijkstra(regions.graph, indices=start, return_predecessors=True)
        line = regions.line(route_of(before, start, goal))
        np.testing.assert_array_equal(line[[0, -1]], regions.points[[start, goal]])
        steps = np.hypot(*np.diff(line, axis=0).T)
        assert (steps <= 1.5 * nodes.pitch).all()
        assert nodes.world.clearance[nodes.world.cells_of(line)].min() >= 0.4
        ends = number[regions.middle[[start, goal]]].tolist()
        _, before = dijkstra(exact.graph, indices=ends[0], return_predecessors=True)
        best = exact.line(route_of(before, *ends))
        costs.append((cost(nodes.world, line), cost(nodes.world, best)))
    found, best = np.array(costs).sum(axis=0)
    assert best <= found * 1.0001 and found < 1.02 * best


def test_a_large_world_is_planned_by_looking_around_only(monkeypatch):
    """The search of a leg takes the nodes near it, whatever the size of the world."""
    world = arena("office", 0, 60.0, 0.05)
    searched = calls(monkeypatch, Regions, "_steps")
    large = Routes(world, 0.4)
    assert large.large and large.part.sum() > 400_000
    path = large.path(150.0, np.random.default_rng(0))
    assert len(large.places.points) < 8000 and len(searched) > 5
    assert np.median([len(nodes) for _, nodes in searched]) < 0.05 * large.part.sum()
    assert world.clearance[world.cells_of(path)].min() > 0.3
    np.testing.assert_array_equal(path, Routes(world, 0.4).path(150.0, np.random.default_rng(0)))


@pytest.mark.parametrize("many", [100, routes.MAX_NODES], ids=["over regions", "over nodes"])
def test_a_drive_goes_about(many, monkeypatch):
    """Far, into most of the arena, and over places it has seen before."""
    monkeypatch.setattr(routes, "MAX_NODES", many)
    world = arena("rescue", 1, 10.0)
    true = drive(world, Robot(), np.random.default_rng(0), 150.0, 40.0)
    assert around(world, true.poses[::20, :2]).min() >= 0.3
    assert driven(true.poses)[-1] > 0.3 * 150.0
    far = np.ones(world.occupied.shape, np.uint8)
    far[world.cells_of(true.poses[:, :2])] = 0
    away = cv2.distanceTransform(far, cv2.DIST_L2, 5) * world.resolution
    assert (away[world.free] < 2.0).mean() > 0.8
    seconds = true.poses[::40, :2]
    again = np.hypot(*(seconds[:, None] - seconds[None, :]).T) < 0.3
    assert np.triu(again, 20).any()
