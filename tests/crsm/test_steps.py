"""The steps of `Crsm.update`, one by one: each is taken where it is due, and only there."""

import dataclasses

import numpy as np
import pytest

from bench.sim.degrade import degrade
from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from crsm import Crsm, CrsmParams
from slams.frontend.estimator import BEGIN_BEAMS
from slams.types import Pose2
from tests.rooms import calls, laser, scan_at, still


def settled(n=12, **changes):
    """CRSM after `n` scans of a robot that stands still."""
    slam = Crsm(CrsmParams(max_cells=1 << 18, **changes))
    for k in range(n):
        slam.update(still(k))
    return slam


def test_only_a_sweep_that_takes_time_is_read_and_matched_twice(monkeypatch):
    for time_increment, times in ((0.0, 1), (0.08 / 181, 2)):
        lidar = laser(181, time_increment=time_increment)
        slam = settled(6)
        read = calls(monkeypatch, slam._scan, "take")
        climbed = calls(monkeypatch, slam._matcher, "climb")
        slam.update(scan_at((0.0, 0.0, 0.0), lidar, t=0.6))
        assert len(read) == len(climbed) == times


def test_the_pose_that_is_returned_is_that_of_a_sweeps_first_beam():
    lidar = laser(181, time_increment=0.08 / 181)
    slam = Crsm(CrsmParams(max_cells=1 << 18))
    for k in range(5):
        pose = Pose2(0.05 * k, 0.0, 0.0)
        found = slam.update(scan_at(pose, lidar, t=0.1 * k, odometry=pose))
    ahead = found.between(slam._estimator.pose).x  # half of 0.08 s at half a meter a second
    assert ahead == pytest.approx(0.02, abs=0.004)


def test_a_map_is_entered_at_rest_until_it_has_settled_and_then_no_more():
    assert [settled(n).report()["inserted"] for n in (10, 20)] == [10, 10]


def test_a_frozen_map_takes_no_scan_whose_pose_is_given():
    slam = settled(11)
    for frozen, more in ((True, 0), (False, 1)):
        slam.frozen = frozen
        slam.insert_at(still(11), Pose2(1.0, 0.0, 0.0))
        assert slam.report()["inserted"] == 10 + more


def test_the_climb_alone_keeps_no_lines_and_fits_nothing(monkeypatch):
    slam = settled(refine=False)
    assert slam._map.lines.surface.slot.max() == 0
    fitted = calls(monkeypatch, slam._map.lines, "fit")
    slam.update(still(12))
    assert not fitted and slam.state == "matched"


@pytest.mark.parametrize("hits", [BEGIN_BEAMS - 1, BEGIN_BEAMS + 2])
def test_a_map_begins_with_enough_end_points(hits):
    slam, scan = Crsm(CrsmParams(max_cells=1 << 18)), still(0)
    ranges = np.where(np.abs(np.arange(181) - 90) <= hits // 2, scan.ranges, np.inf)
    slam.update(dataclasses.replace(scan, ranges=ranges.astype(np.float32)))
    assert slam._map.empty == (hits < BEGIN_BEAMS)


@pytest.mark.parametrize("kind", ["stall=3", "jitter=50"])
def test_a_long_corridor_moves_on_though_wheels_say_otherwise(kind):
    """A prior that weighs too much against few critical rays along the corridor held the robot."""
    name, level = kind.split("=")
    log = degrade(simulate(Setting("ring", seed=102, duration=30.0)), name, float(level), 102)
    slam = Crsm(CrsmParams())
    scans = list(log.select(every=4))
    found = [slam.update(scan) for scan in scans]
    truth = log.truth_at(np.array([scan.t for scan in scans]))
    there = Pose2(*truth[0])
    off = [there.between(Pose2(*t)).between(p) for t, p in zip(truth, found, strict=True)]
    assert max(np.hypot(o.x, o.y) for o in off) < 0.2
