"""Odometry that lies, scans of another place: what they cost, and what is said about it."""

import dataclasses
import math

import numpy as np
import pytest

from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from slams.metrics import ate
from slams.registry import find
from slams.room import drive, laser, scan_at
from slams.types import Pose2

NAMES = ("hector", "tsd", "crsm")
FEW = {"gmapping": {"n_particles": 3}}


def new(name):
    entry = find(name)
    return entry.cls(entry.params().replace(**FEW.get(name, {})))


@pytest.fixture(scope="module")
def turning():
    """A log of a 5 Hz laser that turns while the robot drives."""
    return simulate(Setting(sensor="lds01", sweep=True, duration=20.0, seed=1))


def error(name, log, scans):
    """Root mean square error of the positions [m], aligned."""
    slam = new(name)
    poses = np.array([slam.update(scan) for scan in scans])
    assert np.isfinite(poses).all()
    return ate(poses, log.truth_at(log.t))


def leaping(scans, leaps):
    """The scans with odometry that leaps by a pose at some of them, in its own frame."""
    off, told = Pose2(0.0, 0.0, 0.0), []
    for k, scan in enumerate(scans):
        off = leaps[k](scan.odometry) if k in leaps else off
        told.append(dataclasses.replace(scan, odometry=off @ scan.odometry))
    return told


def restart(odometry):
    return odometry.inverse()


LEAPS = {
    "restart": {40: restart},
    "2 m": {40: lambda o: Pose2(2.0, 0.0, 0.0)},
    "30 m": {40: lambda o: Pose2(-20.0, 22.0, 1.0)},
    "1 km": {40: lambda o: Pose2(1000.0, 0.0, 0.0)},
    "heading": {40: lambda o: Pose2(o.x, o.y, 2.0) @ Pose2(-o.x, -o.y, 0.0)},
    "twice": {40: restart, 60: lambda o: Pose2(30.0, 0.0, -1.0)},
}


@pytest.mark.parametrize("name", NAMES)
def test_odometry_that_leaps_costs_no_more_than_none(name, turning):
    scans = list(turning)
    alone = error(name, turning, [dataclasses.replace(s, odometry=None, yaw=None) for s in scans])
    cost = {kind: error(name, turning, leaping(scans, leaps)) for kind, leaps in LEAPS.items()}
    assert max(cost.values()) < 1.5 * alone, (cost, alone)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_odometry_and_gyro_that_are_no_numbers_count_as_none(name, bad):
    log = list(drive(n=24))
    fields = [Pose2(bad, 0.0, 0.0), Pose2(0.0, 0.0, bad), Pose2(bad, bad, bad)]
    for k, odometry in enumerate(fields):
        log[6 + 3 * k] = dataclasses.replace(log[6 + 3 * k], odometry=odometry, yaw=bad)
    log[20] = dataclasses.replace(log[20], yaw=bad)
    slam, whole = new(name), new(name)
    for scan, good in zip(log, drive(n=24), strict=True):
        assert slam.update(scan) == pytest.approx(whole.update(good), abs=0.01)
        assert slam.state == "matched"


@pytest.mark.parametrize("name", NAMES)
def test_scans_of_another_place_are_called_lost_and_leave_the_map_alone(name):
    lidar = laser(181)
    rng = np.random.default_rng(5)

    def foreign(t):
        ranges = rng.uniform(0.3, 8.0, lidar.n_beams).astype(np.float32)
        ranges.flags.writeable = False
        return dataclasses.replace(scan_at((0.0, 0.0, 0.0), lidar, t=t), ranges=ranges)

    slam, said = new(name), []
    for k in range(90):
        t, here = 0.1 * k, (0.005 * min(k, 30), 0.0, 0.0)
        strange = 30 <= k < 60
        pose = slam.update(foreign(t) if strange else scan_at(here, lidar, t=t))
        said.append(slam.state)
        assert 0.0 <= slam.quality <= 1.0
        assert np.linalg.eigvalsh(slam.covariance).min() > 0.0
        if k == 29:
            inserted, sure = slam.report()["inserted"], slam.covariance[0, 0]
        if k == 59:
            assert slam.report()["inserted"] == inserted
            assert slam.covariance[0, 0] > 100.0 * sure
    assert set(said[:30]) == {"matched"}
    assert set(said[30:39]) == {"predicted"}  # until a second after the last match
    assert set(said[42:60]) == {"lost"}
    assert slam.report()["lost"] == said.count("lost")
    assert set(said[61:]) == {"matched"}
    assert pose == pytest.approx((0.15, 0.0, 0.0), abs=0.01)
