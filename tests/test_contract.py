"""The contract of `update`, each clause over every registered algorithm and preset."""

import math

import numpy as np
import pytest

from slams.player import replay
from slams.registry import find, names
from slams.types import IDENTITY, Laser, OccupancyGrid, Pose2, Scan, Slam
from tests.rooms import drive, laser, scan_at

LABELS = [
    f"{name}@{preset}" if preset != "default" else name
    for name in names()
    for preset in find(name).cls.Params.presets()
]
SHORT = 12


def make(label):
    entry = find(label)
    return entry.cls(entry.params())


@pytest.fixture(scope="module")
def log():
    return drive(n=SHORT)


@pytest.fixture(params=LABELS)
def label(request):
    return request.param


def poses_of(slam, scans):
    return [tuple(slam.update(scan)) for scan in scans]


def test_it_is_a_slam(label):
    assert isinstance(make(label), Slam)


def test_1_the_first_pose_is_the_origin(label, log):
    assert make(label).update(next(iter(log))) == IDENTITY


def odd_scans():
    lidar = laser()
    good = scan_at((0.0, 0.0, 0.0), lidar)

    def scan(t, ranges, geometry=lidar, odometry=None):
        ranges = np.asarray(ranges, np.float32)
        ranges.flags.writeable = False
        return Scan(t, ranges, geometry, odometry)

    n = lidar.n_beams
    return {
        "nothing but inf": scan(1.0, np.full(n, np.inf)),
        "nothing but nan": scan(2.0, np.full(n, np.nan)),
        "one beam": scan(3.0, [2.0], Laser(0.0, 0.0, 1, 0.1, 30.0)),
        "two beams": scan(3.1, [2.0, np.nan], Laser(0.0, 0.1, 2, 0.1, 30.0)),
        "zeros": scan(4.0, np.zeros(n)),
        "another beam count": scan_at((0.0, 0.0, 0.0), laser(91), t=5.0),
        "clockwise": scan_at((0.0, 0.0, 0.0), Laser(2.0, -0.02, 200, 0.1, 30.0), t=6.0),
        "stamp jumps back": scan(0.5, good.ranges),
        "same stamp": scan(0.5, good.ranges),
        "far jump of odometry": scan(7.0, good.ranges, odometry=Pose2(1e3, -1e3, 3.0)),
        "many more beams": scan_at((0.0, 0.0, 0.0), laser(1441), t=8.0),
    }


@pytest.mark.parametrize("first", ["good scan first", "odd scan first"])
@pytest.mark.parametrize("kind", [*odd_scans(), "all of them"])
def test_2_every_pose_is_finite_whatever_comes(label, kind, first):
    slam = make(label)
    scans = list(odd_scans().values()) if kind == "all of them" else [odd_scans()[kind]]
    good = [scan_at((0.01 * k, 0.0, 0.0), t=0.05 * k) for k in range(3)]
    stream = [*good, *scans, *good] if first == "good scan first" else [*scans, *good]
    for scan in stream:
        pose = slam.update(scan)
        assert all(math.isfinite(value) for value in pose), scan.t
    assert isinstance(slam.map(), OccupancyGrid)


def test_3_the_scan_is_not_written_to(label, log):
    scans = list(log)
    before = [scan.ranges.copy() for scan in scans]
    poses_of(make(label), scans)
    for scan, ranges in zip(scans, before, strict=True):
        assert np.array_equal(scan.ranges, ranges, equal_nan=True)


def test_4_same_scans_same_poses_bit_for_bit(label, log):
    assert poses_of(make(label), log) == poses_of(make(label), log)


def test_5_it_runs_without_odometry_and_says_what_it_used(label, log):
    slam = make(label)
    poses_of(slam, log.select(odometry=False))
    assert slam.report()["odometry"] == 0


def test_6_two_instances_do_not_disturb_each_other(label, log):
    alone = poses_of(make(label), log)
    first, second = make(label), make(label)
    together = []
    for scan, other in zip(log, reversed(list(log)), strict=True):
        together.append(tuple(first.update(scan)))
        second.update(other)
    assert together == alone


def test_7_the_odom_frame_is_arbitrary(label, log):
    motion = Pose2(-7.0, 4.0, 2.0)
    moved = [Scan(s.t, s.ranges, s.laser, motion @ s.odometry, s.yaw + 2.0) for s in log]
    assert np.array(poses_of(make(label), moved)) == pytest.approx(
        np.array(poses_of(make(label), log)), abs=1e-6
    )


def test_8_a_changing_laser_is_handled(label):
    slam = make(label)
    for k in range(6):
        pose = slam.update(scan_at((0.02 * k, 0.0, 0.0), laser(361 if k % 2 else 181), t=0.05 * k))
    assert all(math.isfinite(value) for value in pose)


def test_map_lies_in_the_frame_of_the_first_scan(label, log):
    slam = make(label)
    replay(slam, log)
    grid = slam.map()
    height, width = grid.p.shape
    x, y = grid.origin
    assert x < 0.0 < x + width * grid.resolution or label == "odometry"
    assert y < 0.0 < y + height * grid.resolution or label == "odometry"
    known = grid.p[~np.isnan(grid.p)]
    assert known.size
    assert known.min() >= 0.0
    assert known.max() <= 1.0
    assert grid.p.dtype == np.float32
