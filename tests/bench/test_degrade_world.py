"""People, glass, wheels and gyro: what a degradation does to the surroundings and the robot."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

from bench.sim.degrade import degrade
from bench.sim.degrade.people import MIN_PERSON_DISTANCE, legs_near
from bench.sim.degrade.people_kernels import MAX_GOAL_DISTANCE, stroll
from bench.sim.people import LEG_RADIUS
from bench.sim.rays import rays_of
from bench.sim.wheels import integrate, steps
from slams.scanlog import ScanLog, TimeSeries
from slams.types import Pose2, wrap_angle
from tests.rooms import box, cast, drive, laser

MOUNT = Pose2(0.2, -0.1, 0.3)
HALL = np.array(box(-8.0, -6.0, 8.0, 6.0))


@cache
def plain():
    """Twelve seconds in the room, without noise."""
    return drive(240, 20.0, 0.0, lidar=laser(181, mount=MOUNT))


def ends(log, ranges):
    """Where readings end in the world (n, b, 2)."""
    rays = rays_of(log.laser, log.truth_at(log.t))
    c, s = np.cos(rays[..., 2]), np.sin(rays[..., 2])
    return np.stack([rays[..., 0] + ranges * c, rays[..., 1] + ranges * s], axis=-1)


def test_people_only_shorten_and_more_people_shorten_more():
    log = plain()
    before = np.array(log.ranges)
    before[:, :5], before[:, 5:10] = np.inf, np.nan
    log = dataclasses.replace(log, ranges=before)
    three, eight = (degrade(log, "people", level, 1).ranges for level in (3, 8))
    assert (three <= before)[~np.isnan(before)].all() and np.isnan(three[:, 5:10]).all()
    assert (eight <= three)[~np.isnan(before)].all() and (eight < three).mean() > 0.02
    hit = three < before
    assert 0.02 < hit.mean() < 0.4 and hit[:, :5].any()
    assert three[hit].min() >= 0.5 and three[hit].max() < MAX_GOAL_DISTANCE + 2.5
    np.testing.assert_array_equal(degrade(log, "people", 0, 1).ranges, before)


def test_people_stand_where_their_legs_are_seen_from_the_true_pose():
    """Line and circle by hand, for every beam of a few scans."""
    log = plain()
    rng = np.random.default_rng([2, *b"people"])
    legs = legs_near(log, log.truth.values, 4, rng)
    seen = degrade(log, "people", 4, 2).ranges
    for i in (0, 77, 230):
        sensor = Pose2(*log.truth.values[i]) @ log.laser.mount
        expected = log.ranges[i].astype(float)
        angles = sensor.theta + log.laser.angles
        for x, y in legs[i]:
            dx, dy = x - sensor.x, y - sensor.y
            along = dx * np.cos(angles) + dy * np.sin(angles)
            chord = LEG_RADIUS**2 - (dx**2 + dy**2 - along**2)
            entry = along - np.sqrt(np.where(chord > 0.0, chord, np.nan))
            expected = np.where(entry > 0.0, np.fmin(expected, entry), expected)
        np.testing.assert_allclose(seen[i], expected, rtol=1e-5)


def test_people_walk_at_their_pace_near_the_robot_and_keep_off():
    log = plain()
    legs = legs_near(log, log.truth.values, 6, np.random.default_rng(0))
    middle = 0.5 * (legs[:, 0::2] + legs[:, 1::2])
    sensor = rays_of(log.laser, log.truth.values)[:, :1, :2]
    away = np.hypot(*np.moveaxis(middle - sensor, 2, 0))
    assert away.min() >= MIN_PERSON_DISTANCE - 1e-9 and away.max() < 5.1 and np.median(away) < 3.0
    assert np.hypot(*np.moveaxis(legs - sensor, 2, 0)).min() - LEG_RADIUS >= 0.5
    pace = np.hypot(*np.moveaxis(np.diff(middle, axis=0), 2, 0)) / 0.05
    assert 0.8 <= np.median(pace) <= 1.2 and (pace < 2.0).mean() > 0.99
    turned = np.unwrap(np.arctan2(*np.moveaxis(middle - sensor, 2, 0)[::-1]), axis=0)
    assert (np.ptp(turned, axis=0) > 1.0).all()


def test_people_where_the_truth_ends():
    log = plain()
    part = dataclasses.replace(log, truth=TimeSeries(log.truth.t[:100], log.truth.values[:100]))
    degraded = degrade(part, "people", 8, 0)
    hit = (degraded.ranges < log.ranges).any(axis=1)
    assert hit[:100].mean() > 0.8 and not hit[100:].any()


def test_people_before_a_sweeping_laser_are_seen_from_where_the_robot_is_by_then():
    log = plain()
    turning = dataclasses.replace(log.laser, time_increment=0.05 / 181)
    still = degrade(log, "people", 8, 0).ranges
    swept = degrade(dataclasses.replace(log, laser=turning), "people", 8, 0).ranges
    known = np.isfinite(still[:-1]) & (still[:-1] < log.ranges[:-1])
    off = np.where(known, np.abs(swept[:-1] - still[:-1]), 0.0)
    np.testing.assert_allclose(off[:, 0], 0.0, atol=1e-6)
    assert off[:, -30:].max() > 10.0 * off[:, 1:3].max() > 0.0


def hall_log(poses):
    lidar = laser(1081, mount=MOUNT)
    ranges = np.array([cast(HALL, pose, lidar) for pose in poses], np.float32)
    t = np.arange(len(poses)) / 10.0
    return ScanLog(t, ranges, lidar, truth=TimeSeries(t, np.array(poses, float)))


def aslant(log):
    """Beams (n, b) that meet a wall of the hall at 10 to 80 deg, away from the corners."""
    headings = log.truth.values[:, 2:] + log.laser.mount.theta + log.laser.angles
    points = ends(log, log.ranges)
    corner = (np.abs(points[..., 0]) > 7.3) & (np.abs(points[..., 1]) > 5.3)
    return (np.abs(np.sin(2.0 * headings)) > math.sin(math.radians(20.0))) & ~corner


def test_a_place_is_glass_from_wherever_it_is_seen():
    log = hall_log([(-3.0, 1.0, 0.4), (2.0, -2.0, 1.2), (4.0, 3.0, -2.0)])
    through, plainly = np.isinf(degrade(log, "glass", 50, 3).ranges), aslant(log)
    places = np.floor(ends(log, log.ranges) / 0.2).astype(int)[plainly]
    known = {}
    for place, gone in zip(places.tolist(), through[plainly], strict=True):
        known.setdefault(tuple(place), []).append(gone)
    shares = np.array([np.mean(gone) for gone in known.values() if len(gone) > 4])
    assert len(shares) > 130
    assert ((shares == 0.0) | (shares == 1.0)).mean() > 0.8  # others have a pane's border in them
    assert 0.2 < through[plainly].mean() < 0.8
    other = np.isinf(degrade(log, "glass", 50, 4).ranges)
    assert (other != through).mean() > 0.2


def test_the_share_of_glass_and_what_is_glass_at_a_higher_level():
    poses = [
        (x, y, 0.5 * k) for k, (x, y) in enumerate(np.random.default_rng(0).uniform(-4, 4, (20, 2)))
    ]
    log = hall_log(poses)
    shares, before = [], np.zeros(log.ranges.shape, bool)
    for level in (20, 50, 80, 100):
        through = np.isinf(degrade(log, "glass", level, 1).ranges)
        assert through[before].all()
        shares.append(through.mean())
        before = through
    np.testing.assert_allclose(shares, np.array([0.2, 0.5, 0.8, 1.0]) * 0.9, atol=0.17)
    assert not np.isinf(degrade(log, "glass", 0, 1).ranges).any()


def test_glass_met_square_on_throws_the_light_back():
    log = dataclasses.replace(hall_log([(0.0, 0.0, 0.0)]), laser=laser(1081))
    log = dataclasses.replace(log, ranges=cast(HALL, (0.0, 0.0, 0.0), log.laser)[None])
    seen = np.isfinite(degrade(log, "glass", 100, 0).ranges[0])
    angles = np.degrees(log.laser.angles)
    square = np.abs((angles + 45.0) % 90.0 - 45.0)
    assert seen[square < 7.5].all() and not seen[(square > 8.5) & (square < 30.0)].any()


def odometry(log):
    return steps(log.odom.values)


def test_steps_and_integrate_are_inverse_also_where_headings_wrap():
    rng = np.random.default_rng(0)
    poses = np.cumsum(rng.normal(0.0, 0.3, (200, 3)), axis=0)
    poses[:, 2] = wrap_angle(poses[:, 2] + 3.0)
    assert np.abs(np.diff(poses[:, 2])).max() > 6.0 and np.abs(steps(poses)[2]).max() < math.pi
    again = integrate(*steps(poses), poses[0])
    np.testing.assert_allclose(again[:, :2], poses[:, :2], atol=1e-10)
    np.testing.assert_allclose(wrap_angle(again[:, 2] - poses[:, 2]), 0.0, atol=1e-10)


@pytest.mark.parametrize("name", ["slip", "stall", "jump", "wheel_scale", "heading_bias"])
def test_wheels_at_level_zero_are_as_they_were_and_all_else_stays(name):
    log = plain()
    degraded = degrade(log, name, 0, 0)
    np.testing.assert_allclose(degraded.odom.values, log.odom.values, atol=1e-10)
    hard = degrade(log, name, 2, 0)
    np.testing.assert_array_equal(hard.odom.values[0], log.odom.values[0])
    np.testing.assert_array_equal(hard.ranges, log.ranges)
    assert hard.truth is log.truth and hard.yaw_rate is log.yaw_rate


def test_wheel_scale_and_biases_are_recovered():
    log = plain()
    ahead, aside, turn = odometry(log)
    scaled = odometry(degrade(log, "wheel_scale", 15, 0))
    for new, old in zip(scaled, (ahead, aside, turn), strict=True):
        np.testing.assert_allclose(new, 1.15 * old, atol=1e-10)
    bent = odometry(degrade(log, "heading_bias", 5, 0))
    way = np.hypot(ahead, aside)
    np.testing.assert_allclose(bent[2] - turn, math.radians(5.0) * way, atol=1e-10)
    np.testing.assert_allclose(bent[0], ahead, atol=1e-10)
    biased = degrade(log, "gyro_bias", 2, 0)
    np.testing.assert_allclose(biased.yaw_rate.values - log.yaw_rate.values, math.radians(2.0))


def test_wheels_tell_a_pose_again_until_the_next_is_due():
    log = plain()
    known = degrade(log, "wheel_rate", 3, 0).odom
    since = (known.t - known.t[0]) * 3.0
    (new,) = np.nonzero(np.any(np.diff(known.values, axis=0) != 0.0, axis=1))
    assert len(new) == pytest.approx(since[-1], abs=1.0)
    np.testing.assert_array_equal(known.values[new + 1], log.odom.values[new + 1])
    assert np.diff(since[new]).max() < 1.0 + 3.0 * np.diff(known.t).max()
    often = degrade(log, "wheel_rate", 1e6, 0).odom
    np.testing.assert_array_equal(often.values, log.odom.values)


def test_slip_makes_single_sides_turn_too_far_by_spells():
    log = plain()
    sides = [
        (ahead - 0.2 * turn, ahead + 0.2 * turn)
        for ahead, _, turn in (odometry(log), odometry(degrade(log, "slip", 30, 5)))
    ]
    for before, after in zip(*sides, strict=True):
        factor = after / before
        slips = np.abs(factor - 1.3) < 1e-6
        assert (slips | (np.abs(factor - 1.0) < 1e-6)).all()
        assert 0.05 < slips.mean() < 0.7
        changes = np.flatnonzero(np.diff(slips.astype(int)))
        assert len(changes) <= 12 and np.diff(changes).min(initial=20) >= 19


def test_stalled_wheels_count_nothing_for_a_while():
    log = plain()
    before, after = odometry(log), odometry(degrade(log, "stall", 3, 1))
    still = np.abs(after[0]) < 1e-12
    assert abs(still.sum() - 60) <= 1 and np.diff(np.flatnonzero(still)).max() == 1
    for old, new in zip(before, after, strict=True):
        np.testing.assert_allclose(new[~still], old[~still], atol=1e-10)
        np.testing.assert_allclose(new[still], 0.0, atol=1e-12)


def test_odometry_leaps_once():
    log = plain()
    before, after = odometry(log), odometry(degrade(log, "jump", 2, 1))
    jumps = [new - old for old, new in zip(before, after, strict=True)]
    (at,) = np.flatnonzero(np.hypot(jumps[0], jumps[1]) > 1e-9)
    assert math.hypot(jumps[0][at], jumps[1][at]) == pytest.approx(2.0)
    assert 0.0 < abs(jumps[2][at]) <= 0.4 and 0.3 * 239 - 1 <= at <= 0.7 * 239
    np.testing.assert_allclose(np.delete(jumps[2], at), 0.0, atol=1e-10)


def test_somebody_before_a_laser_of_one_beam_walks_to_and_fro_along_it():
    sensors, angles = np.full((400, 3), (50.0, 0.0, 0.0)), np.zeros(1)
    ranges = np.full((400, 1), 2.3, np.float32)
    ranges.flags.writeable = False
    out, strides = np.empty((400, 2)), np.full(400, 0.05)
    stroll(sensors, ranges, angles, strides, MIN_PERSON_DISTANCE, np.random.default_rng(0), out)
    assert np.abs(out[:, 1]).max() == 0.0
    assert MIN_PERSON_DISTANCE <= out[:, 0].min() - 50.0 < MIN_PERSON_DISTANCE + 0.3
    assert 1.7 < out[:, 0].max() - 50.0 <= 2.0 + 1e-6
    went = np.abs(np.diff(out[:, 0]))
    assert went.max() == pytest.approx(0.05) and np.median(went) == pytest.approx(0.05)
    plain_python = np.empty_like(out)
    rng = np.random.default_rng(0)
    stroll.py_func(sensors, ranges, angles, strides, MIN_PERSON_DISTANCE, rng, plain_python)
    np.testing.assert_array_equal(plain_python, out)


def test_somebody_walks_straight_from_place_to_place_that_the_laser_observes():
    angles = np.linspace(-math.pi, math.pi, 60)
    ranges, out = np.full((400, 60), 2.5, np.float32), np.empty((400, 2))
    ranges.flags.writeable = False
    rng = np.random.default_rng(1)
    stroll(np.zeros((400, 3)), ranges, angles, np.full(400, 0.05), MIN_PERSON_DISTANCE, rng, out)
    assert np.hypot(*out.T).max() < 2.5
    turns = np.abs(np.diff(np.unwrap(np.arctan2(*np.diff(out, axis=0).T))))
    assert np.median(turns) < 1e-9 < turns.max()


def test_noise_does_not_blur_the_panes():
    """Walls that run along a border of the grid would flicker."""
    log = hall_log([(-1.0, 0.5, 0.1)] * 20)
    noisy = degrade(log, "noise", 0.01, 0)
    through = np.isinf(degrade(noisy, "glass", 50, 3).ranges)
    share = through.mean(axis=0)
    assert ((share < 0.05) | (share > 0.95)).mean() > 0.85
