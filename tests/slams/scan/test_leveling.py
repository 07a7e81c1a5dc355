"""Tilted scans: end points in the plane, the floor left out, and what is wrong with an attitude."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slams.scan.end_points import EndPoints
from slams.scan.params import ScanParams
from slams.types import IDENTITY, Attitude, Laser, Pose2, Scan

HEIGHT, SIDE = 0.35, 3.0  # m: of the laser above the floor, from the base to each wall of a room
DRIVING = Pose2(0.3, 0.0, 0.0)
LEVEL = Attitude(0.0, 0.0)
LIDAR = Laser(-math.pi, math.radians(1.0), 360, 0.05, 30.0, Pose2(0.1, -0.05, 0.3), mount_z=HEIGHT)


def room(attitude, lidar=LIDAR, rates=(0.0, 0.0)):
    """Ranges of a tilted laser in a square room, by the equation of each wall and of the floor."""
    angles, seconds = lidar.angles + lidar.mount.theta, lidar.time_increment
    tilts = np.array(attitude) + np.outer(np.arange(lidar.n_beams) * seconds, rates)
    R = np.array([Attitude(*tilt).rotation() for tilt in tilts])
    starts = R @ (lidar.mount.x, lidar.mount.y, lidar.mount_z)
    ways = np.einsum("nij,jn->ni", R, [np.cos(angles), np.sin(angles), 0.0 * angles])
    axes, planes = [0, 0, 1, 1, 2], [SIDE, -SIDE, SIDE, -SIDE, 0.0]
    with np.errstate(divide="ignore"):
        ranges = (planes - starts[:, axes]) / ways[:, axes]
    return np.where(ranges > 0.0, ranges, np.inf).min(axis=1).astype(np.float32)


def scan(t, truth, said=None, lidar=LIDAR, rates=(0.0, 0.0)):
    return Scan(t, room(truth, lidar, rates), lidar, attitude=truth if said is None else said)


def off_the_walls(points):
    """The greatest distance [m] of an end point from the nearest wall."""
    ends = np.abs(points.points[:2, : points.n])
    return float(np.abs(ends.max(axis=0) - SIDE).max())


def rocking(t):
    return Attitude(0.22 * math.sin(2.0 * t), 0.2 * math.sin(1.3 * t + 1.0))


def replayed(said, seconds=20.0, truth=rocking, speed=DRIVING, lidar=LIDAR):
    """The end points' counts after a drive with the attitudes `said` (t) and the true ones."""
    points = EndPoints(ScanParams())
    for t in np.arange(0.0, seconds, 0.1).tolist():
        points.read(scan(t, truth(t), said(t), lidar), speed)
    return points.counts


def test_rotation_turns_by_roll_first_seen_from_the_base_then_by_pitch():
    roll, pitch = 0.3, -0.2
    cos, sin = np.cos((roll, pitch)), np.sin((roll, pitch))
    about_x = np.array([[1, 0, 0], [0, cos[0], -sin[0]], [0, sin[0], cos[0]]])
    about_y = np.array([[cos[1], 0, sin[1]], [0, 1, 0], [-sin[1], 0, cos[1]]])
    np.testing.assert_allclose(Attitude(roll, pitch).rotation(), about_y @ about_x, atol=1e-15)
    assert (Attitude(0.1, 0.0).rotation() @ (0, 1, 0))[2] > 0.0  # the left side is up
    assert (Attitude(0.0, 0.1).rotation() @ (1, 0, 0))[2] < 0.0  # the front is down


@pytest.mark.parametrize("tilt", [(0.2, 0.0), (0.0, -0.25), (-0.1, 0.2)])
def test_a_tilted_scan_ends_on_the_walls_and_nowhere_on_the_floor(tilt):
    attitude = Attitude(*tilt)
    points = EndPoints(ScanParams()).read(scan(0.0, attitude), IDENTITY)
    assert points.n > 100 and off_the_walls(points) < 1e-5
    x, y, _ = attitude.rotation() @ (LIDAR.mount.x, LIDAR.mount.y, HEIGHT)
    assert points.mount == pytest.approx((x, y, LIDAR.mount.theta))
    as_scanned = EndPoints(ScanParams()).read(replace(scan(0.0, attitude), attitude=None), IDENTITY)
    assert as_scanned.mount == LIDAR.mount and off_the_walls(as_scanned) > 0.2


def test_without_a_height_nothing_is_taken_for_floor():
    lidar = replace(LIDAR, mount_z=0.0)
    points = EndPoints(ScanParams()).read(scan(0.0, Attitude(0.1, 0.0), lidar=lidar), IDENTITY)
    assert points.n > 100 and points.counts["leveled"] == 1
    assert replace(lidar, height=0.2).above_floor == 0.2 and lidar.above_floor is None


def test_a_sweep_takes_the_rate_of_the_attitude_out():
    lidar, rates = replace(LIDAR, time_increment=0.1 / 360), (0.4, -0.3)
    points = EndPoints(ScanParams())
    points.read(scan(0.0, Attitude(0.06, 0.08), lidar=lidar, rates=rates), IDENTITY)
    points.read(scan(0.1, Attitude(0.1, 0.05), lidar=lidar, rates=rates), IDENTITY)
    assert points.n > 100 and off_the_walls(points) < 6e-3
    still = EndPoints(ScanParams())
    still.read(scan(0.1, Attitude(0.1, 0.05), lidar=lidar, rates=rates), IDENTITY)
    assert off_the_walls(still) > 0.02


def test_a_good_attitude_is_used_all_the_time():
    errors = np.random.default_rng(0).normal(0.0, math.radians(0.3), (1000, 2))
    counts = replayed(lambda t: Attitude(*(np.array(rocking(t)) + errors[round(10 * t)])))
    assert counts["leveled"] == 200
    assert not any(count for name, count in counts.items() if name != "leveled")
    assert EndPoints(ScanParams()).counts == {}


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("beyond", lambda t: Attitude(math.pi - 0.1, rocking(t).pitch)),
        ("contradicted", lambda t: Attitude(-rocking(t).roll, -rocking(t).pitch)),
        ("stuck", lambda t: rocking(min(t, 7.0))),
        ("jumped", lambda t: Attitude(rocking(t).roll + 0.3 * (t > 7.0), rocking(t).pitch)),
    ],
)
def test_a_wrong_attitude_is_counted_and_not_used(fault, said):
    counts = replayed(said)
    assert counts[f"attitude_{fault}"] > 100
    assert counts["leveled"] + counts[f"attitude_{fault}"] == 200


@pytest.mark.parametrize(("seen", "jumped"), [(1, 130), (40, 100)])
def test_after_a_jump_a_few_ends_at_the_floor_confirm_nothing(seen, jumped):
    """A narrow fan meets the floor as it is said to be, in as many scans after the jump."""

    def truth(t):
        return Attitude(0.01 * math.sin(2.0 * t), 0.13 if 7.95 < t < 7.95 + 0.1 * seen else 0.0)

    narrow = replace(LIDAR, angle_min=math.radians(-3.0), n_beams=7, mount=IDENTITY)
    said = replayed(
        lambda t: Attitude(truth(t).roll + 0.3 * (t > 6.95), truth(t).pitch),
        truth=truth,
        lidar=narrow,
    )
    assert said["attitude_jumped"] == jumped and said["leveled"] == 200 - jumped


def test_a_late_attitude_is_used_and_told():
    counts = replayed(lambda t: rocking(t - 0.05), 40.0)
    assert counts["leveled"] == 400 and 35 <= counts["attitude_late_ms"] <= 65


def test_a_single_wrong_attitude_is_left_out():
    counts = replayed(lambda t: Attitude(0.9 if t == 5.0 else rocking(t).roll, rocking(t).pitch))
    assert counts["attitude_beyond"] + counts["attitude_jumped"] == 1 and counts["leveled"] == 199


def test_a_robot_that_stands_on_a_slope_is_not_taken_for_a_stuck_attitude():
    slope = Attitude(0.0, 0.15)
    assert replayed(lambda t: slope, 5.0, lambda t: slope, IDENTITY)["leveled"] == 50
    assert replayed(lambda t: LEVEL, 5.0, lambda t: LEVEL)["leveled"] == 50
