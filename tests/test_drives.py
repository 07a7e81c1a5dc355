"""What all algorithms do alike in a small room: known steps, noise, sweeps, jumps, maps."""

import dataclasses
import math

import numpy as np
import pytest

from slams import metrics
from slams.frontend.correlative import search, window_of
from slams.grid_bounds import Box
from slams.player import replay
from slams.test_world import box, drive, laser, scan_at
from slams.types import IDENTITY, Pose2, Scan
from tests.floors import is_wall, noisy
from tests.rooms import ALGORITHMS, CORRIDOR, ORIGINALS, ROOM, driven, made, mirrored

PAPERS = [f"{name}@paper" for name in ALGORITHMS]
MOUNT = Pose2(0.2, -0.1, 0.7)
# turned, so that walls cross their cells at all places
CORNERS = Pose2(0.0, 0.0, 0.1).transform(np.array([s[:2] for s in box(-2.5, -2.0, 3.0, 2.5)]))
WALLS = np.array([(*a, *b) for a, b in zip(CORNERS, np.roll(CORNERS, -1, axis=0), strict=True)])
each = pytest.mark.parametrize("name", ALGORITHMS)


@pytest.mark.parametrize(
    ("segments", "mount", "motion"),
    [
        (ROOM, IDENTITY, Pose2(0.04, 0.02, 0.03)),
        (ROOM, MOUNT, Pose2(-0.05, -0.01, -0.02)),
        (mirrored(ROOM), MOUNT, Pose2(0.04, -0.02, -0.03)),
        (ROOM, IDENTITY, Pose2(-0.15, 0.1, 0.08)),
    ],
    ids=["", "mounted", "mirrored", "large"],
)
@each
def test_a_known_step_is_found_there_and_back(name, segments, mount, motion):
    lidar = laser(361, mount=mount)
    for base in (IDENTITY, motion):
        slam, there = made(name), IDENTITY if base == motion else motion
        slam.update(scan_at(base, lidar, segments))
        found = slam.update(scan_at(there, lidar, segments, t=0.1))
        assert found == pytest.approx(base.between(there), abs=2e-3)


@each
def test_a_laser_that_turns_the_other_way_gives_the_same_poses(name):
    log = drive(n=25)
    last, step = float(log.laser.angles[-1]), log.laser.angle_increment
    clockwise = dataclasses.replace(log.laser, angle_min=last, angle_increment=-step)
    turned = dataclasses.replace(log, ranges=log.ranges[:, ::-1].copy(), laser=clockwise)
    one, other = (replay(made(name), scans).poses for scans in (log, turned))
    assert np.abs(one - other).max() < 2e-3


@pytest.mark.parametrize("label", [*ALGORITHMS, *PAPERS])
def test_the_mechanism_poses_every_scan_and_what_refines_it_is_ours(label):
    log, slam = drive(n=50).select(odometry=False), made(label)
    run = replay(slam, log)
    assert metrics.ate(run.poses, log.truth_at(run.t)) < 0.006
    if "@" in label and hasattr(slam._map, "lines"):
        assert slam._map.lines.cells.used[0] == 0  # of refinement nothing is kept
    refined = 0 if "@" in label else 49
    expected = {"kept": 49, "refined": refined, "odometry": 0, "predicted": 0, "lost": 0}
    for count, number in expected.items():
        assert run.report.get(count, number) == number, count
    assert run.report["posed"] in (49, 50)  # the first makes the map
    assert 1 < run.report["inserted"] < 30  # where the robot has moved on


@each
def test_few_scans_a_second_are_enough(name):
    log = drive(n=60, rate=5.0).select(odometry=False)
    run = replay(made(name), log)
    assert metrics.ate(run.poses, log.truth_at(run.t)) < 0.01
    assert run.report["searched"] == run.report["predicted"] == 0


@pytest.mark.parametrize("turn", [0.8, 2.0, 3.0])
@each
def test_the_second_scan_is_found_however_far_the_robot_turned_meanwhile(name, turn):
    """At one scan a second neither the motion nor the mean match score is known."""
    slam, step = made(name), Pose2(0.3, 0.0, turn)
    for k, pose in enumerate((FIRST, FIRST @ step)):
        found = slam.update(noisy(pose, k, t=float(k)))
    assert found == pytest.approx(step, abs=5e-3)


@each
def test_wheels_and_gyro_are_used_only_if_wanted(name):
    for wheels, gyro in ((True, False), (False, True)):
        report = replay(made(name, wheels=wheels, gyro=gyro), drive(n=12)).report
        assert (report["odometry"], report["gyro"]) == (11 * wheels, 11 * gyro)


@pytest.mark.parametrize(("sigma", "share"), [(0.05, 0.0), (0.01, 0.3)])
@each
def test_noise_and_short_beams_do_not_lose_the_pose(name, sigma, share):
    slam, lidar, rng = made(name), laser(721), np.random.default_rng(0)
    for k in range(40):
        pose = Pose2(0.02 * k, 0.01 * k, 0.01 * k)
        scan = scan_at(pose, lidar, noise=sigma, rng=rng, t=0.1 * k)
        struck = rng.random(721) < share
        ranges = np.where(struck, rng.uniform(0.2, 1.0, 721) * scan.ranges, scan.ranges)
        found = slam.update(dataclasses.replace(scan, ranges=ranges.astype(np.float32)))
        assert slam.state == "matched"
    assert found == pytest.approx(pose, abs=0.04)
    assert slam.report()["searched"] < 4


@pytest.mark.parametrize("label", [*ALGORITHMS, "hector@original"])
def test_a_sweep_that_is_freed_of_its_motion_gives_better_poses(label):
    lidar = laser(181, time_increment=0.19 / 181)
    log = drive(n=40, rate=5.0, noise=0.003, lidar=lidar).select(odometry=False)
    more = {"start": "velocity"} if "@" in label else {}
    with_it, without = (
        metrics.ate(replay(made(label, deskew=on, **more), log).poses, log.truth_at(log.t))
        for on in (True, False)
    )
    assert with_it < 0.7 * without


@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (1.2, -0.8, 2.0)])
@each
def test_a_robot_that_is_carried_within_its_view_is_found(name, start):
    slam, lidar, jump = made(name), laser(361), Pose2(0.4, -0.3, 0.4)
    for k in range(12):
        slam.update(scan_at(start, lidar, t=0.025 * k))
    for k in range(24):
        found = slam.update(scan_at(Pose2(*start) @ jump, lidar, t=0.3 + 0.025 * k))
    assert slam.state == "matched" and found == pytest.approx(jump, abs=0.02)
    assert slam.report()["searched"] >= 1


@pytest.mark.parametrize("faster", [0.03, 0.08])
@pytest.mark.parametrize("n_beams", [181, 1081])
@each
def test_a_bare_corridor_is_driven_by_the_wheels(name, n_beams, faster):
    """Though somebody walks ahead, by so many meters a scan faster than the robot."""
    slam, lidar = made(name), laser(n_beams, range_max=10.0)
    for k in range(60):
        pose = Pose2(0.05 * k, 0.0, 0.0)
        body = pose.x + 1.5 + faster * k
        legs = [(body, -0.4, body, -0.1), (body + 0.1, 0.1, body + 0.1, 0.4)]
        walls = np.concatenate([CORRIDOR, legs])
        found = slam.update(scan_at(pose, lidar, walls, t=0.05 * k, odometry=pose))
    assert found.x == pytest.approx(pose.x, abs=0.1)
    assert found.y == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("label", [*ALGORITHMS, *PAPERS])
def test_the_map_evaluates_poses_and_has_walls_to_search(label):
    slam = driven(label, drive(n=20, lidar=laser(361)))
    points = slam._view if "gmapping" in label else slam._scan
    pose, lookup = slam._estimator.pose, slam._map.likelihood_field()
    inliers, conflicts = slam._map.evaluate(points, pose)
    assert inliers > 0.6 and conflicts < 0.05
    inliers_beside, conflicts_beside = slam._map.evaluate(points, pose @ Pose2(0.5, 0.4, 0.3))
    assert inliers_beside < inliers - 0.2 and conflicts_beside > conflicts + 0.1
    assert slam._map.evaluate(points, Pose2(500.0, 0.0, 0.0)) == (0.0, 0.0)
    ends = pose.transform(points.points[:2, : points.n].T)
    ix, iy = np.floor((ends - (lookup.x0, lookup.y0)).T / lookup.resolution + 0.5).astype(int)
    assert np.mean(lookup.likelihood[iy, ix] > 0.3) > 0.98
    wrong = pose @ Pose2(0.5, -0.3, 0.1)
    ends, spread = points.points[:, : points.n], np.diag([0.04, 0.04, 0.01])
    poses, _ = search(lookup, ends, window_of(wrong, spread))
    assert poses[0, :3] == pytest.approx(pose, abs=1.5 * lookup.resolution)


@each
def test_a_wall_that_went_away_is_erased(name):
    room, wall = np.array(box(-3.0, -3.0, 3.0, 3.0)), np.array([(1.0, -0.5, 1.0, 0.5)])
    slam = made(name)
    for k in range(40):
        pose, segments = (0.02 * k, 0.0, 0.0), room if k >= 3 else np.vstack([room, wall])
        slam.insert_at(scan_at(pose, segments=segments, t=0.2 * k), Pose2(*pose))
        if k in (2, 39):
            assert is_wall(slam.map(), 1.0, 0.0) == (k == 2)
    assert is_wall(slam.map(), 3.0, 0.0)


def part_of(grid, box):
    """The cells [iy, ix] of a grid in a box."""
    x, y = (np.arange(n) + 0.5 for n in grid.p.shape[::-1])
    x, y = grid.origin[0] + grid.resolution * x, grid.origin[1] + grid.resolution * y
    return grid.p[np.ix_((y > box.y0) & (y < box.y1), (x > box.x0) & (x < box.x1))]


@each
def test_a_map_that_grows_keeps_what_it_has_and_a_part_of_it_is_that_of_the_whole(name):
    slam, home = made(name, max_cells=1 << 18), Box(-2.51, -2.51, 4.49, 3.51)
    for k in range(3):
        slam.insert_at(scan_at(IDENTITY, t=0.1 * k), IDENTITY)
    before = part_of(slam.map(), home)
    assert (before > 0.5).sum() > 20
    for k in range(3):  # beyond the room of so many cells around the start
        slam.insert_at(scan_at(IDENTITY, t=1.0 + k), Pose2(-22.0, -1.0, 0.0))
    assert is_wall(slam.map(), *Pose2(-22.0, -1.0, 0.0).transform(np.array([[5.0, 0.0]]))[0])
    np.testing.assert_array_equal(part_of(slam.map(), home), before)
    cut = slam._map.crop(Box(-1.0, -1.5, 2.0, 1.0))
    ny, nx = cut.p.shape
    x, y = cut.origin
    inside = Box(x, y, x + nx * cut.resolution, y + ny * cut.resolution)
    np.testing.assert_array_equal(cut.p, part_of(slam.map(), inside))
    assert slam._map.crop(Box(500.0, 500.0, 501.0, 501.0)) is None


@pytest.mark.parametrize("label", [*ALGORITHMS, *ORIGINALS])
def test_a_map_before_any_scan_is_unknown(label):
    assert np.isnan(made(label).map().p).all()


@pytest.mark.parametrize("label", ORIGINALS)
def test_an_original_is_coarser_and_follows_too(label):
    log = dataclasses.replace(drive(n=40), yaw_rate=None)
    more = {"hold": 5, "iterations": 8000} if label.startswith("crsm") else {}
    run = replay(made(label, **more), log)
    assert 0.001 < metrics.ate(run.poses, log.truth_at(run.t)) < 0.1


def offsets(points):
    """How far [m] points are from the walls that face along x, and along y, on average."""
    found = ([], [])
    for x0, y0, x1, y1 in WALLS:
        length = math.hypot(x1 - x0, y1 - y0)
        along = np.array([x1 - x0, y1 - y0]) / length
        normal = np.array([-along[1], along[0]])
        axis = int(abs(normal[1]) > abs(normal[0]))
        normal *= np.sign(normal[axis])
        distance, offset = (points - (x0, y0)) @ along, (points - (x0, y0)) @ normal
        near = (distance > 0.3) & (distance < length - 0.3) & (np.abs(offset) < 0.1)
        assert near.sum() > 20
        found[axis].append(offset[near].mean())
    return [float(np.mean(each)) for each in found]


@each
def test_walls_stand_where_they_are_and_not_half_a_cell_beside(name):
    slam, rng = made(name), np.random.default_rng(0)
    for k in range(12):
        pose = Pose2(0.04 * k, 0.02 * k, 0.05 * k)
        scan = scan_at(pose, laser(721, fov=2.0 * math.pi * 720 / 721), WALLS, 0.005, rng, 0.1 * k)
        slam.update(scan)
    grid = slam.map()
    iy, ix = np.nonzero(grid.p > 0.5)
    centers = np.stack([ix + 0.5, iy + 0.5], axis=1) * grid.resolution + np.array(grid.origin)
    assert np.abs(offsets(centers)).max() < 0.2 * grid.resolution


FIRST, THERE = Pose2(-3.0, 1.0, 0.0), Pose2(1.5, -2.0, 2.0)


@each
def test_a_robot_that_was_carried_in_the_dark_is_relocalized_if_that_is_wanted(name):
    both = made(name), made(name, relocate=False)
    for k in range(110):
        pose = FIRST @ Pose2(0.05 * k, 0.0, 0.0) if k < 30 else THERE
        scan = noisy(pose, k, t=0.1 * k)
        if 30 <= k < 45:
            scan = Scan(scan.t, np.full(541, np.nan, np.float32), scan.laser)
        found = [slam.update(scan) for slam in both]
    assert [slam.report()["relocalized"] for slam in both] == [1, 0]
    assert found[0] == pytest.approx(FIRST.between(THERE), abs=0.03)
    assert both[0].state == "matched"


@each
def test_wheels_in_conflict_with_the_map_do_not_hold_a_lifted_robot(name):
    slam, wheels, step, pose = made(name), IDENTITY, Pose2(0.05, 0.0, 0.02), FIRST
    for k in range(120):
        slam.update(noisy(pose, k, t=0.1 * k, odometry=wheels))
        wheels = wheels @ step  # they do not measure that the robot is lifted
        pose = THERE if k == 40 else pose @ step
    assert slam.report()["relocalized"] == 1
    assert slam.update(noisy(pose, 120, t=12.0)) == pytest.approx(FIRST.between(pose), abs=0.05)
