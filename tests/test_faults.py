"""Greatest error with odometry that restarts, jumps or stalls, and with scans of another place."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from bench.sim.degrade import degrade
from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from slams import metrics
from slams.player import replay
from slams.registry import find
from slams.scanlog import TimeSeries
from slams.types import Pose2
from tests.rooms import ALGORITHMS, CORRIDOR, box, drive, laser, made, scan_at

ALLOWED = 1.5  # times the error without odometry
MORE = 0.005  # m, more than that
SEEDS = (3, 4, 5, 6)  # of drives; one alone is chance


@cache
def slow_sweep(seed):
    return simulate(Setting(sensor="lds01", sweep=True, duration=20.0, seed=seed))


@cache
def alone(algorithm):
    """Error without odometry [m]."""
    return error(algorithm, [slow_sweep(seed).select(odometry=False) for seed in SEEDS])


def error(algorithm, logs):
    entry = find(algorithm)
    errors = []
    for log in logs:
        run = replay(entry.cls(entry.params().for_sensor("lds01")), log)
        assert np.isfinite(run.poses).all()
        errors.append(metrics.ate(run.poses, log.truth_at(run.t)))
    return np.mean(errors)


def jumped(seed, *jumps):
    """The log with odometry moved by (x, y, theta) from a share of the log on."""
    log = slow_sweep(seed)
    odom = log.odom.values.copy()
    for share, motion in jumps:
        first = int(share * len(odom))
        if motion is None:
            motion = -odom[first]
        odom[first:] += motion
    return dataclasses.replace(log, odom=TimeSeries(log.odom.t, odom))


FAULTS = {
    "2 m": [(0.4, (2.0, 0.0, 0.0))],
    "1 km": [(0.4, (1e3, -1e3, 0.0))],
    "heading": [(0.4, (0.0, 0.0, 2.0))],
    "30 m and a restart": [(0.3, (30.0, 5.0, 1.0)), (0.6, None)],
}


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("fault", FAULTS)
def test_odometry_that_jumps_does_no_harm(algorithm, fault):
    logs = [jumped(seed, *FAULTS[fault]) for seed in SEEDS]
    assert error(algorithm, logs) < ALLOWED * alone(algorithm) + MORE


@cache
def simulated(arena, seed, stall):
    """A log of 12 s at 10 Hz, of which the wheels stall for `stall` seconds."""
    log = degrade(simulate(Setting(arena=arena, duration=12.0, seed=seed)), "stall", stall, 0)
    return log.select(every=round(0.1 / log.scan_period))


@pytest.mark.parametrize(("wheels", "back"), [(True, 8), (True, 4), (False, 4)])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_scans_and_odometry_held_back_and_stamped_later_do_no_harm(algorithm, wheels, back):
    log, poses = simulated("office", 158, 0.0).select(odometry=wheels), []
    slam, scans = made(algorithm), list(log)
    source = [i - back - i % 20 if i > 50 and i % 20 in (0, 2, 4) else i for i in range(120)]
    for i, k in enumerate(source):
        poses.append(slam.update(dataclasses.replace(scans[k], t=scans[i].t)))
    on_time = np.array(source) == np.arange(len(scans))
    assert metrics.ate(np.array(poses)[on_time], log.truth_at(log.t)[on_time]) < 0.005


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_wheels_that_stall_do_no_harm_where_few_beams_see_the_motion(algorithm):
    log = simulated("ring", 130, 3.0)
    run = replay(made(algorithm), log)
    assert metrics.ate(run.poses, log.truth_at(run.t)) < 0.01


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_wheels_hold_the_pose_where_the_laser_is_blind(algorithm):
    slam, log = made(algorithm), drive(n=100)
    blind = np.full(361, np.nan, np.float32)
    for i, scan in enumerate(log):
        slam.update(dataclasses.replace(scan, ranges=blind) if 40 <= i < 80 else scan)
        assert slam.state == ("predicted" if 40 <= i < 80 else "matched")
    assert slam.report()["lost"] == 0


def noise_scan(k, lidar):
    ranges = np.random.default_rng(k).uniform(0.3, 8.0, lidar.n_beams).astype(np.float32)
    ranges.flags.writeable = False
    return dataclasses.replace(scan_at((0.0, 0.0, 0.0), lidar), ranges=ranges)


def closet_scan(k, lidar):
    return scan_at((0.0, 0.0, 0.2), lidar, np.array(box(-0.6, -0.7, 0.4, 0.9)))


@pytest.mark.parametrize("foreign", [noise_scan, closet_scan])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_scans_of_another_place_are_called_lost_and_leave_the_map_alone(algorithm, foreign):
    lidar = laser(181)
    slam, states = made(algorithm), []
    for k in range(90):
        t, here = 0.1 * k, (0.005 * min(k, 30), 0.0, 0.0)
        foreign_scan = 30 <= k < 60
        scan = foreign(k, lidar) if foreign_scan else scan_at(here, lidar)
        pose = slam.update(dataclasses.replace(scan, t=t))
        states.append(slam.state)
        assert 0.0 <= slam.quality <= 1.0
        assert np.linalg.eigvalsh(slam.covariance).min() > 0.0
        if k == 29:
            entered, variance = slam.map().p.copy(), slam.covariance[0, 0]
        if k == 59:
            assert np.array_equal(slam.map().p, entered, equal_nan=True)
            assert slam.covariance[0, 0] > 100.0 * variance
    assert set(states[:30]) == {"matched"}
    assert states[30] == "predicted"
    assert set(states[42:60]) == {"lost"}  # at the latest a second after the last match
    assert slam.report()["lost"] == states.count("lost")
    assert set(states[61:]) == {"matched"}
    assert pose == pytest.approx((0.15, 0.0, 0.0), abs=0.01)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_log_that_begins_blind_goes_on_by_the_wheels(algorithm):
    lidar = laser(181)
    slam, start = made(algorithm), None
    for k in range(40):
        at = Pose2(0.02 * k, 0.0, 0.0)
        scan = scan_at(at, lidar, t=0.1 * k, odometry=at)
        if k < 20:
            scan = dataclasses.replace(scan, ranges=np.full_like(scan.ranges, np.nan))
        start = start or at
        pose = slam.update(scan)
        assert pose == pytest.approx(start.between(at), abs=0.004)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_robot_that_reverses_at_once_in_a_bare_corridor_is_followed(algorithm):
    """Only the wheels measure it, and the motion so far contradicts them."""
    slam, at, rng = made(algorithm), Pose2(0.0, 0.0, 0.0), np.random.default_rng(1)
    for k in range(60):
        pose = slam.update(scan_at(at, laser(361), CORRIDOR, 0.01, rng, 0.1 * k, odometry=at))
        assert pose == pytest.approx(at, abs=0.08)
        at = at @ Pose2(0.05 if k < 30 else -0.05, 0.0, 0.0)
