"""hector in noise, among walkers, with few beams: what it measures, and who decides."""

import math

import numpy as np
import pytest

from hector import Hector, HectorParams, match_kernels
from hector.map import LogOddsPyramid
from slams.player import replay
from slams.refine import line_kernels, surface_kernels
from slams.refine.lines import ONCE
from slams.refine.surface_kernels import Splat, Surface
from slams.registry import find
from slams.scan import scan_kernels
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import CORRIDOR, ROOM, cast, laser, scan_at

SIZE, CELL = 100, 0.05


def surface():
    shape, half = (SIZE, SIZE), -0.5 * SIZE * CELL
    pool = np.zeros((999, 14), np.float32), np.zeros((999, 8), np.float32), np.zeros(1, np.int64)
    return Surface(np.zeros(shape, np.int32), *pool, np.zeros(shape, np.float32), half, half, CELL)


def wall(x=1.0, n=20):
    points = np.stack([np.full(n, x), np.linspace(-0.3, 0.3, n)])
    return points, np.stack([np.full(n, -1.0), np.zeros(n), np.zeros(n)])


def noisy(pose, sigma, lidar, seed, share=0.0, **known):
    """A scan of the room with noise, a share of its beams short."""
    rng = np.random.default_rng(seed)
    ranges = cast(ROOM, pose, lidar) + rng.normal(0.0, sigma, lidar.n_beams)
    short = rng.random(lidar.n_beams) < share
    ranges = np.where(short, rng.uniform(0.2, 1.0, lidar.n_beams) * ranges, ranges)
    ranges = ranges.astype(np.float32)
    ranges.flags.writeable = False
    return Scan(ranges=ranges, laser=lidar, **known)


# what a scan tells of itself


@pytest.mark.parametrize("sigma", [0.005, 0.02, 0.06])
def test_the_noise_of_the_ranges_is_measured(sigma):
    points = EndPoints(HectorParams())
    for k in range(10):
        points.take(noisy(IDENTITY, sigma, laser(1081), k, t=0.1 * k), IDENTITY)
    assert points.noise == pytest.approx(sigma, rel=0.2)


def test_beams_far_apart_tell_no_noise():
    points = EndPoints(HectorParams())
    points.take(noisy(IDENTITY, 0.06, laser(31), 0, t=0.0), IDENTITY)
    assert points.noise == HectorParams().range_noise


def test_a_straight_wall_is_straight_however_flat_it_is_met():
    points = np.array([[1.0, 4.0, 9.0], [1.0, 1.0, 1.0]])
    assert scan_kernels.beyond_chord(points, 0, 1, 2, IDENTITY) == pytest.approx(0.0, abs=1e-12)
    points[:, 1] *= 1.1
    behind = scan_kernels.beyond_chord(points, 0, 1, 2, IDENTITY)
    assert behind == pytest.approx(0.1 * math.hypot(4.0, 1.0))


def test_lone_beams_are_left_out_and_surfaces_are_not():
    points = EndPoints(HectorParams())
    whole = points.take(scan_at(IDENTITY, laser(361)), IDENTITY).n
    ranges = scan_at(IDENTITY, laser(361)).ranges.copy()
    ranges[[50, 120, 250]] *= 0.5
    ranges.flags.writeable = False
    left = points.take(Scan(0.0, ranges, laser(361)), IDENTITY)
    assert left.n == whole - 3
    assert not {50.0, 120.0, 250.0} & set(left.points[2, : left.n])


def test_a_noisy_wall_still_has_normals():
    points = EndPoints(HectorParams())
    for k in range(10):
        points.take(noisy(IDENTITY, 0.05, laser(1081), k, t=0.1 * k), IDENTITY)
    normals = points.normals[:2, : points.n]
    found = np.hypot(*normals) > 0.0
    assert found.mean() > 0.6
    straight = np.abs(normals[:, found]).max(axis=0)
    assert np.median(straight) > 0.98  # the room's walls are along the axes


def test_a_beam_counts_half_where_the_noise_makes_that_usual():
    params = HectorParams()
    lines, points = LogOddsPyramid(params).lines, EndPoints(params)
    assert lines._softness(points) == pytest.approx(0.06)  # of the noise that is assumed, 0.02
    points._noise.value = 0.05
    assert lines._softness(points) == pytest.approx(0.15)
    points._noise.value = 0.001
    assert lines._softness(points) == params.softness


# what the lines believe


def test_what_one_scan_alone_saw_counts_little():
    lines, trust = surface(), []
    for number in (1, 1, 2, 3):
        surface_kernels.add_scan(lines, *wall(), 20, IDENTITY, Splat(0, 0, 1e6, number, ONCE))
        trust.append(lines.lines[1, 3])
    assert trust[1] < 0.11
    assert trust[0] < trust[1] < 0.5 < 2.0 * trust[2]
    assert trust[3] > 1.2 * trust[2]


def test_what_stands_where_it_was_free_is_no_wall():
    lines = surface()
    lines.seen[:] = -1.0
    surface_kernels.add_scan(lines, *wall(), 20, IDENTITY, Splat(1, 0, 1e6, 1, ONCE))
    assert lines.used[0] == 0
    lines.seen[:] = 1.0
    surface_kernels.add_scan(lines, *wall(), 20, IDENTITY, Splat(1, 0, 1e6, 1, ONCE))
    assert lines.used[0] > 0


def test_a_wall_near_its_cells_border_is_not_pushed_away():
    lines, border = surface(), 60 * CELL - 2.5 + 0.5 * CELL
    lines.seen[:] = -1.0
    lines.seen[:, 61] = 1.0  # the wall's cells; noise puts a third of the hits in front of them
    x = border + np.array([-0.004, 0.004, 0.012] * 10)
    hits = np.stack([x, np.linspace(-0.1, 0.1, 30)])
    normals = np.stack([np.full(30, -1.0), np.zeros(30), np.zeros(30)])
    surface_kernels.add_scan(lines, hits, normals, 30, IDENTITY, Splat(2, 0, 1e6, 1, ONCE))
    found = lines.lines[lines.slot[50, 61]]
    assert -found[2] == pytest.approx(border + 0.004, abs=5e-4)


def test_each_beam_is_an_inlier_in_conflict_or_neither():
    lines = surface()
    surface_kernels.add_scan(lines, *wall(), 20, IDENTITY, Splat(1, 0, 1e6, 1, ONCE))
    lines.seen[:, 60] = -1.0
    ends = np.array([[1.0, 60 * CELL - 2.5, -1.0], [0.1, 0.1, 0.1]])
    for k, said in enumerate([(1.0, 0.0), (0.0, 1.0), (0.0, 0.0)]):
        one, here = np.ascontiguousarray(ends[:, k : k + 1]), tuple(IDENTITY)
        found = line_kernels.evaluate(tuple(lines), one, 1, 1, here, here, 400.0)
        assert found == pytest.approx(said, abs=1e-6)


def test_the_occupancy_speaks_for_the_mechanism_alone():
    params = find("hector@paper").params()
    grids, points = LogOddsPyramid(params), EndPoints(params)
    points.take(scan_at(IDENTITY, laser(361)), IDENTITY)
    assert grids.evaluate(points, IDENTITY) == (0.0, 0.0)
    for _ in range(4):
        grids.insert(points, IDENTITY)
    here, there = (grids.evaluate(points, pose) for pose in (IDENTITY, Pose2(0.5, 0.3, 0.2)))
    assert here == (1.0, 0.0)
    assert there[1] > there[0]
    assert grids.lines.surface.used[0] == 0  # nothing of ours is kept


# who decides


# the whole


def test_every_scan_is_posed_by_the_pyramid(room_log):
    run = replay(Hector(HectorParams()), room_log.select(50, odometry=False))
    assert run.report["posed"] == 49  # the first makes the map
    assert run.report["kept"] == run.report["refined"] == 49
    alone = replay(Hector(find("hector@paper").params()), room_log.select(50, odometry=False))
    assert alone.report["posed"] == alone.report["kept"] == 49
    assert alone.report["refined"] == 0
    truth = room_log.truth_at(alone.t)
    assert np.hypot(*(alone.poses - truth)[:, :2].T).max() < 0.03


@pytest.mark.parametrize(("sigma", "share"), [(0.08, 0.0), (0.01, 0.3)])
def test_noise_and_short_beams_do_not_lose_the_pose(sigma, share):
    slam, lidar = Hector(HectorParams()), laser(721)
    for k in range(60):
        pose = Pose2(0.02 * k, 0.01 * k, 0.01 * k)
        found = slam.update(noisy(pose, sigma, lidar, k, share, t=0.1 * k))
        assert slam.state == "matched"
    assert found == pytest.approx(pose, abs=0.04)
    assert slam.report()["searched"] == 0


def test_a_walker_does_not_drag_the_pose_along_a_bare_corridor():
    slam, lidar = Hector(HectorParams()), laser(361, range_max=10.0)
    for k in range(80):
        pose = Pose2(0.05 * k, 0.0, 0.0)
        body = pose.x + 1.5 + 0.08 * k  # walks ahead, faster than the robot
        legs = [[body, -0.4, body, -0.1], [body + 0.1, 0.1, body + 0.1, 0.4]]
        walls = np.concatenate([CORRIDOR, np.array(legs)])
        found = slam.update(scan_at(pose, lidar, walls, t=0.05 * k, odometry=pose))
    assert found.x == pytest.approx(pose.x, abs=0.05)
    assert found.y == pytest.approx(pose.y, abs=0.02)


def test_a_scan_enters_the_map_where_it_is_told_and_a_frozen_map_stays():
    slam = Hector(HectorParams())
    for x in np.linspace(0.0, 0.5, 6):
        slam.insert_at(scan_at((x, 0.1, 0.0), laser(721)), Pose2(x, 0.1, 0.0))
    before = slam.map().p.copy()
    slam.frozen = True
    for k in range(5):
        slam.update(scan_at((0.05 * k, 0.02, 0.01), laser(721), t=0.2 * k))
    assert slam.state == "matched"
    assert np.array_equal(slam.map().p, before, equal_nan=True)
    slam.frozen = False
    slam.update(scan_at((0.3, 0.02, 0.01), laser(721), t=1.2))
    assert not np.array_equal(slam.map().p, before, equal_nan=True)


def test_every_few_beams_are_enough_for_a_coarse_level():
    params = HectorParams()
    grids, points = LogOddsPyramid(params), EndPoints(params)
    points.take(scan_at(IDENTITY, laser(1081)), IDENTITY)
    grids.insert(points, IDENTITY)
    H, b, sums = np.zeros((3, 3)), np.zeros(3), []
    for ends, n, stride in ((points.points, points.n, 4), (points.points[:, ::4].copy(), -1, 1)):
        n = n if n > 0 else ends[:, : -(-points.n // 4)].shape[1]
        found = match_kernels.normal_equations(grids.levels[2], ends, n, stride, IDENTITY, H, b)
        sums.append((*found, *H.ravel(), *b))
    assert sums[0] == pytest.approx(sums[1])
