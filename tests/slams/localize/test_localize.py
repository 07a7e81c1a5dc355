"""Global localization in a map, and what is reported while it is ambiguous."""

import math

import numpy as np
import pytest

from slams.localize import GlobalLocalizer, map_index
from slams.localize.distance_map import DistanceMap
from slams.localize.map_index import Candidate, MapIndex, Search, Work, end_points, merged
from slams.types import Laser, OccupancyGrid, Pose2
from tests.floors import ALIKE, grid_of, noisy, searched
from tests.rooms import ROOM, box, error, laser

POSES = [(-1.0, 0.5, 0.3), (1.5, -2.0, 2.0), (4.2, 3.1, -1.0), (-3.2, 3.0, -2.8), (1.0, 3.2, 0.0)]


def test_a_beam_is_an_inlier_in_conflict_or_neither():
    segments = np.array([*box(0.0, 0.0, 6.0, 4.0), (4.0, 0.0, 4.0, 4.0)])
    distances = DistanceMap(grid_of(segments, inside=(1.0, 1.0)))
    pose = Pose2(2.0, 2.0, math.pi / 2)  # +x is to its right
    ends = {
        (0.0, -2.0): (1.0, 0.0),  # on the wall
        (0.0, -4.0): (0.0, 1.0),  # on the wall behind it
        (0.0, -1.0): (0.0, 0.0),  # somebody in the way
        (0.0, -2.1): (1.0, 0.0),  # a bit too long
        (0.0, -9.0): (0.0, 1.0),  # out of the map
    }
    for end, expected in ends.items():
        assert distances.evaluate(np.array([end]), pose) == expected, end
    assert distances.evaluate(np.array(list(ends)), pose) == (2 / 5, 2 / 5)
    assert distances.evaluate(np.zeros((0, 2)), pose) == (0.0, 0.0)


def test_a_gap_between_far_beams_is_no_wall_but_the_unseen_is_none_either():
    grid = grid_of(ROOM)
    grid.p[80, 60] = np.nan
    distances = DistanceMap(grid)
    assert distances.free[80, 60]
    assert not distances.free[:, 0].any() and not distances.occupied[:, 0].any()


@pytest.mark.parametrize("pose", POSES)
def test_a_fit_comes_back_to_the_walls(pose, room):
    start = Pose2(*pose) @ Pose2(0.12, -0.1, 0.04)
    assert room.distances.resolution == 0.05
    found = room.distances.fit(end_points(noisy(pose)), start)
    assert error(found, pose)[0] < 0.04 and error(found, pose)[1] < 0.01


@pytest.mark.parametrize("seed", range(12))
def test_any_place_of_a_room_is_found_by_one_scan(seed, room):
    rng = np.random.default_rng(seed)
    cells = np.argwhere(room.distances.gap > 6)
    iy, ix = cells[rng.integers(len(cells))]
    x, y = room.distances.origin + (np.array([ix, iy]) + rng.random(2)) * room.distances.resolution
    pose = (float(x), float(y), float(rng.uniform(-math.pi, math.pi)))
    first, *others = searched(room, noisy(pose, seed))
    assert error(first.pose, pose)[0] < 0.1 and error(first.pose, pose)[1] < math.radians(3.0)
    assert first.probability + sum(c.probability for c in others) <= 1.0 + 1e-9
    assert first.score > 0.8


LASERS = {
    "mounted": Laser(-2.0, 0.01, 401, 0.1, 30.0, Pose2(0.3, -0.1, 0.7)),
    "clockwise": Laser(2.2, -0.02, 221, 0.1, 30.0),
    "all around": Laser(-math.pi, 2 * math.pi / 360, 360, 0.1, 12.0),
    "few beams": Laser(-2.0, 0.1, 41, 0.1, 30.0),
}


@pytest.mark.parametrize("kind", LASERS)
def test_every_laser_is_served(kind, room):
    pose = Pose2(-1.0, 0.5, 0.3)
    scan = noisy(pose, 1, LASERS[kind])
    for found in (searched(room, scan)[0], room.match(scan, [pose])[0]):
        assert error(found.pose, pose)[0] < 0.06


def test_probabilities_follow_from_scores_and_what_was_before():
    scored = ((0, 0.9), (3, 0.88), (6, 0.3))
    a, b, c = (Candidate(Pose2(x, 0.0, 0.0), e, 0.0, 1.0) for x, e in scored)
    same = merged([], [b, a, c])
    assert [x.probability for x in same] == pytest.approx([0.5, 0.5])  # as good as equal; c is out
    known = [a._replace(probability=0.1), b._replace(probability=0.9)]
    first, second = merged(known, [c])
    assert first == b._replace(probability=pytest.approx(0.9), searches=2)
    assert second == a._replace(probability=pytest.approx(0.1), searches=2)
    assert merged([], []) == []


def test_a_square_room_is_in_doubt_for_ever():
    square = np.array(box(0.0, 0.0, 4.0, 4.0))
    localizer = GlobalLocalizer(grid_of(square, inside=(1.0, 1.0)))
    for k in range(12):
        pose = (1.0 + 0.1 * k, 1.5, 0.4)
        assert localizer.add(noisy(pose, k, segments=square)) is None
    turns = [(c.pose.theta - 0.4) / (math.pi / 2) for c in localizer.candidates[:4]]
    assert sorted(round(turn) % 4 for turn in turns) == [0, 1, 2, 3]
    assert max(c.probability for c in localizer.candidates) < 0.6


@pytest.mark.parametrize("wheels", [True, False])
def test_alike_rooms_are_told_apart_by_driving_on(wheels):
    localizer = GlobalLocalizer(grid_of(ALIKE, inside=(0.0, -1.0)))
    near = laser(541, range_max=3.0)
    way = [(-4.5 + 0.01 * k, 2.5 - 0.08 * k, -1.5) for k in range(48)]
    sure = []
    for k, pose in enumerate(way):
        odometry = Pose2(5.0, 1.0, 2.0) @ Pose2(*way[0]).between(Pose2(*pose)) if wheels else None
        found = localizer.add(noisy(pose, k, near, ALIKE, odometry=odometry))
        sure += [(k, error(found.pose, pose)[0])] if found else []
        if k == 0:
            places = sorted(round(c.pose.x, 1) for c in localizer.candidates[:2])
            assert places == pytest.approx([-4.5, 4.5], abs=0.15)
    assert sure and sure[0][0] > 10
    assert max(error for _, error in sure) < 0.1
    assert localizer.candidates[0].probability > 0.95


def test_the_squares_of_a_search_are_those_in_which_a_laser_has_room(room):
    """A house at either end of a map of 60 m, nothing in between."""
    p = np.full((300, 1200), np.nan, np.float32)
    ny, nx = room.grid.p.shape
    p[10 : ny + 10, 20 : nx + 20] = p[-ny:, -nx:] = room.grid.p
    index = MapIndex(OccupancyGrid(p, 0.05, (-3.0, 2.0)))
    middles = np.array(index.tiles)[:, :2]
    iy, ix = np.nonzero(index.distances.gap > 2)
    places = np.stack([ix, iy], axis=1) * 0.05 + (-2.975, 2.025)
    off = np.abs(places[:, None] - middles).max(axis=2)
    assert off.min(axis=1).max() <= map_index.TILE_HALF_WIDTH + 1e-9  # everywhere is in one of them
    assert off.min(axis=0).max() < map_index.TILE_HALF_WIDTH + 0.3  # and in none is nothing
    assert len(middles) < 0.5 * 60.0 * 15.0 / (2.0 * map_index.TILE_HALF_WIDTH) ** 2


def test_of_likely_poses_the_best_of_each_place_are_kept():
    poses = np.array([(0.0, 0.0, 3.1, 0.7), (0.1, 0.1, -3.1, 0.9), (0.1, 0.1, 0.0, 0.6),
                      (0.4, 0.1, 3.1, 0.8)])  # fmt: skip
    assert map_index.distinct_poses(poses)[:, 3].tolist() == [0.9, 0.8, 0.6]
    many = np.column_stack([np.arange(99.0), np.zeros((99, 2)), np.linspace(0.1, 0.9, 99)])
    assert (map_index.distinct_poses(many) == many[::-1][: map_index.MAX_FITTED_POSES]).all()


def test_a_laser_whose_back_was_never_seen_has_room(room):
    """A laser of 270 degrees at (1, 0.5) that maps what it sees from there."""
    p = room.grid.p.copy()
    p[:, : round((1.0 - room.grid.origin[0]) / 0.05) - 1] = np.nan
    index = MapIndex(OccupancyGrid(p, 0.05, room.grid.origin))
    poses = np.array([(1.0, 0.5, 0.0, 1.0), (0.9, 0.5, 0.0, 1.0), (0.5, 0.5, 0.0, 1.0)])
    assert index.in_free_space(poses).tolist() == [True, True, False]
    assert error(searched(index, noisy((1.0, 0.5, 0.0)))[0].pose, (1.0, 0.5, 0.0))[0] < 0.1


@pytest.mark.parametrize("cell", [0.02, 0.05, 0.1])
def test_the_likelihood_of_a_wall_falls_off_around_it(cell):
    p = np.zeros((round(4.0 / cell), round(6.0 / cell)), np.float32)
    p[:, round(3.0 / cell)] = 1.0  # at x = 3 m
    index = MapIndex(OccupancyGrid(p, cell, (1.0, -2.0)))
    grid, x0, y0, edge, pooled, block = index.likelihood_field[:6]
    assert edge == pytest.approx(0.1) and y0 < -2.0 + edge
    x = x0 + edge * np.arange(grid.shape[1])
    expected = np.maximum(1.0 - np.abs(x - 4.0 - 0.5 * cell) / 0.3, 0.0)
    assert grid[20] == pytest.approx(expected, abs=1e-5)
    wall = int(np.argmax(grid[20]))
    for j, i in ((20, wall - 5), (20, wall - 1), (0, wall + 2), (10, len(x) - 2)):
        assert pooled[j, i] == grid[j : j + block, i : i + block].max()


def test_beams_through_walls_are_taken_off_the_likelihood(room):
    search = Search(room, noisy(POSES[3]))
    assert search.advance(Work())
    ends, (grid, x0, y0, edge, *_) = search._ends, room.likelihood_field
    through, off = [], []
    for *pose, score in search._likely.tolist():
        i, j = np.round((Pose2(*pose).transform(ends) - (x0, y0)) / edge).astype(int).T
        inside = (i >= 0) & (j >= 0) & (i < grid.shape[1]) & (j < grid.shape[0])
        through.append(room.distances.evaluate(ends, Pose2(*pose))[1])
        off.append(score + through[-1] - grid[j[inside], i[inside]].sum() / len(ends))
    assert len(through) > 10 and max(through) > 0.2
    assert room.in_free_space(search._likely).all()
    assert max(off) < 0.05 and np.median(off) == pytest.approx(0.0, abs=0.01)  # some are given up


def test_likely_poses_outside_of_free_space_are_left_out(room, monkeypatch):
    poses = np.array([(50.0, 50.0, 0.0, 0.9), (1.0, 0.5, 0.0, 0.8)])
    monkeypatch.setattr(map_index, "search", lambda *_: (poses.copy(), 100))
    search = Search(room, noisy(POSES[0]))
    search._search_tile(room.tiles[0])
    assert search._likely[:, :2].tolist() == [[1.0, 0.5]]


def test_a_map_without_walls_is_refused():
    for p in (np.zeros((9, 9)), np.ones((9, 9)), np.full((9, 9), np.nan)):
        with pytest.raises(ValueError, match="expected a floor with walls"):
            GlobalLocalizer(OccupancyGrid(p.astype(np.float32), 0.05, (0.0, 0.0)))
