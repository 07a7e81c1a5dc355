"""Drives, odometry, gyro, sensors, whole simulated logs, and the command."""

import dataclasses
import hashlib
import math
from functools import cache

import cv2
import numpy as np
import pytest

from bench import simulate as command
from bench.sim.drive import Drive, Robot, drive
from bench.sim.people import legs
from bench.sim.range_errors import Errors
from bench.sim.setting import Setting
from bench.sim.simulation import simulate, world_of
from bench.sim.wheels import gyro, odometry
from slams import load
from slams.formats.occupancy import write_map
from slams.types import Pose2, wrap_angle
from tests.processes import python

SHORT = Setting(size=8.0, duration=3.0, noise=0.0)


@cache
def log_of(**changes):
    return simulate(dataclasses.replace(SHORT, **changes))


@cache
def small_drive():
    world = world_of(log_of())
    return world, drive(world, Robot(), np.random.default_rng(5), 120.0, 400.0)


def test_drive_keeps_its_limits():
    _, true = small_drive()
    v, w = true.rates.T
    dt = np.diff(true.t)
    assert v.min() >= 0.0 and v.max() <= 0.5 + 1e-12 and np.abs(w).max() <= 0.8 + 1e-12
    assert np.abs(np.diff(v) / dt).max() <= 0.5 + 1e-9
    assert np.abs(np.diff(w) / dt).max() <= 1.5 + 1e-9
    assert v[0] == w[0] == 0.0


def test_drive_rates_are_the_derivative_of_its_poses():
    _, true = small_drive()
    steps, dt = np.diff(true.poses, axis=0), np.diff(true.t)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    np.testing.assert_allclose(lengths, true.rates[1:, 0] * dt, atol=1e-8)
    np.testing.assert_allclose(steps[:, 2], true.rates[1:, 1] * dt, atol=1e-12)
    direction = np.arctan2(steps[:, 1], steps[:, 0])
    sideways = wrap_angle(direction - 0.5 * (true.poses[1:, 2] + true.poses[:-1, 2]))
    assert np.abs(sideways[true.rates[1:, 0] > 0.01]).max() < 1e-6


def relative(poses, gap):
    """Motion of each pose (n, 3) over the next `gap` poses."""
    pairs = zip(poses[:-gap:gap], poses[gap::gap], strict=False)
    return np.array([Pose2(*a).between(Pose2(*b)) for a, b in pairs])


def test_odometry_drifts_as_wheels_do():
    _, true = small_drive()
    t = np.arange(0.0, 120.0, 0.02)
    errors = []
    for seed in range(4):
        counted = odometry(true, t, np.random.default_rng(seed))
        np.testing.assert_allclose(counted[0], 0.0, atol=1e-12)
        errors.append(relative(counted, 50) - relative(true.poses_at(t), 50))
    scale = [1.0 + error[:, 0].mean() / 0.4 for error in errors]
    assert 0.002 < np.std(scale) < 0.03  # the wheels' own, the whole drive long
    per_second = np.abs(np.concatenate(errors)).mean(axis=0)
    assert 0.001 < per_second[0] < 0.01 and per_second[1] < 0.02 and 0.002 < per_second[2] < 0.03


def test_gyro_measures_the_turning():
    _, true = small_drive()
    t = np.arange(0.0, 120.0, 0.01)
    error = gyro(true, t, np.random.default_rng(1)) - np.interp(t, true.t, true.rates[:, 1])
    assert 0.003 < np.std(np.diff(error)) / math.sqrt(2.0) < 0.005
    assert abs(error.mean()) < 0.01


def test_range_errors_have_the_size_asked_for():
    true = np.tile(np.array([1.0, 4.0, np.inf]), (20000, 1))
    measured = Errors(0.01, 0.02, 0.001).apply(true, np.random.default_rng(0))
    np.testing.assert_allclose(measured[:, :2].std(axis=0), [0.03, 0.09], rtol=0.03)
    np.testing.assert_allclose(measured[:, :2].mean(axis=0), [1.0, 4.0], atol=0.003)
    assert np.isinf(measured[:, 2]).all()
    np.testing.assert_allclose(measured[:, 0] * 1000, np.round(measured[:, 0] * 1000), atol=1e-6)


def test_log_has_all_of_it():
    log = log_of()
    assert len(log) == 120 and log.laser.n_beams == 1081
    for track, rate in ((log.odom, 50.0), (log.truth, 200.0), (log.yaw_rate, 100.0)):
        assert track.t[0] == 0.0 and track.t[-1] == 3.0
        assert np.median(np.diff(track.t)) == pytest.approx(1.0 / rate)
    scan = next(iter(log))
    assert scan.odometry is not None and scan.yaw is not None


def naive_distances(log, i):
    """Scan i cast from the truth at each beam's stamp."""
    laser = log.laser
    stamps = log.t[i] + laser.time_increment * np.arange(laser.n_beams)
    rays = log.truth_at(stamps)
    rays[:, 2] += laser.angles
    return world_of(log).cast(rays)


def test_a_scan_is_what_is_seen_from_its_truth():
    log = log_of()
    for i in (0, 60, 119):
        np.testing.assert_allclose(log.ranges[i], naive_distances(log, i), atol=0.0005 + 1e-6)


@pytest.mark.parametrize("sensor", ["utm30lx", "rplidar-a1"])
def test_sweep_measures_each_beam_at_its_own_time(sensor):
    log = log_of(sweep=True, sensor=sensor)
    i = len(log) - 1
    expected = naive_distances(log, i)
    off = np.abs(log.ranges[i] - expected) > 0.002  # an edge may be hit or missed
    assert log.laser.time_increment > 0.0 and off.mean() < 0.01
    still = np.abs(log.ranges[i] - log_of(sensor=sensor).ranges[i])
    assert np.nanmean(still[np.isfinite(still)]) > 0.002


def test_stdr_ranges_are_multiples_of_the_cell():
    log = log_of(stdr=True, resolution=0.03, noise=None)
    cells = log.ranges[np.isfinite(log.ranges)].astype(float) / 0.03
    np.testing.assert_allclose(cells, np.round(cells), atol=1e-4)


def test_people_hide_what_is_behind_and_change_nothing_else():
    empty, crowded = log_of(), log_of(people=3)
    assert (crowded.ranges <= empty.ranges + 1e-6).all()
    assert 0.001 < (crowded.ranges < empty.ranges - 0.05).mean() < 0.2
    np.testing.assert_array_equal(crowded.truth.values, empty.truth.values)


def test_people_walk_clear_of_walls_and_robot():
    world, robot = small_drive()
    walking = legs(world, robot, 1, np.random.default_rng(2))
    middle = walking.mean(axis=1)
    assert np.hypot(*(middle - robot.poses[:, :2]).T).min() >= 0.6 - 1e-9
    assert np.hypot(*np.diff(middle, axis=0).T).sum() > 0.5 * 120.0
    iy, ix = world.cells_of(walking.reshape(-1, 2))
    assert world.occupied[iy, ix].mean() < 0.02  # only when the robot pushes one aside


def test_noise_leaves_arena_drive_and_wheels_alone():
    quiet, noisy = log_of(), log_of(noise=0.05)
    for key in ("truth", "odom", "yaw_rate"):
        np.testing.assert_array_equal(getattr(quiet, key).values, getattr(noisy, key).values)
    assert world_of(quiet).fingerprint == world_of(noisy).fingerprint
    error = (noisy.ranges - quiet.ranges)[np.isfinite(noisy.ranges)]
    assert error.std() == pytest.approx(0.05, rel=0.03)


def test_length_ends_the_drive():
    log = log_of(length=2.0)
    way = np.hypot(*np.diff(log.truth.values[:, :2], axis=0).T).sum()
    assert way == pytest.approx(2.0, abs=0.02)
    assert log.t[-1] <= log.truth.t[-1]


def test_world_comes_back_from_a_saved_log(tmp_path):
    log_of().save(tmp_path / "scans.npz")
    saved = load(tmp_path / "scans.npz")
    saved.meta["simulated"]["gone"] = 0.5  # an option that there was once
    assert world_of(saved).fingerprint == saved.meta["simulated"]["world"]
    assert world_of(dataclasses.replace(saved, meta={"name": "other"})) is None


def test_a_map_is_driven_through_and_found_again_until_it_changes(tmp_path):
    write_map(tmp_path, world_of(log_of()).grid())
    path = tmp_path / "map.yaml"
    log = simulate(dataclasses.replace(SHORT, arena=str(path)))
    np.testing.assert_array_equal(log.truth.values, log_of().truth.values)
    assert world_of(log).fingerprint == world_of(log_of()).fingerprint
    path.write_text(path.read_text().replace("0.02", "0.03"))
    assert world_of(log) is None
    path.unlink()
    assert world_of(log) is None


def test_command_writes_the_same_bytes_twice(tmp_path):
    digests = []
    for name, salt in (("a.npz", "1"), ("b.npz", "2")):
        options = ["--duration", 2, "--size", 8, "--people", 1, "--dropout", 0.01, "--seed", 3]
        done = python("-m", "bench.simulate", tmp_path / name, *options, PYTHONHASHSEED=salt)
        assert (done.returncode, done.stderr) == (0, "")
        assert "80 scans of 1081 beams" in done.stdout
        digests.append(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
    assert digests[0] == digests[1]


def test_picture_is_drawn_and_quiet_is_quiet(tmp_path, capsys):
    line = ["--duration", "1", "--size", "8", "--picture", str(tmp_path / "arena.png"), "-q"]
    assert command.main([str(tmp_path / "scans.npz"), *line]) == 0
    assert cv2.imread(str(tmp_path / "arena.png")) is not None
    assert capsys.readouterr() == ("", "")


def test_gyro_bias_drifts():
    t = np.arange(0.0, 1000.0, 0.01)
    standing = Drive(t[[0, -1]], np.zeros((2, 3)), np.zeros((2, 2)))
    rates = gyro(standing, t, np.random.default_rng(1))
    assert 1e-3 < np.ptp(rates.reshape(10, -1).mean(axis=1)) < 1e-2
