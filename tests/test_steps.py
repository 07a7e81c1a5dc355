"""Steps that `update` takes alike in hector, tsd and crsm: where they are due, and only there."""

import numpy as np
import pytest

from slams.frontend.estimator import MIN_FIRST_POINTS
from slams.types import Pose2, Scan
from tests.rooms import LIDAR, calls, laser, scan_at, settled

pytestmark = pytest.mark.parametrize("name", ["hector", "tsd", "crsm"])


@pytest.mark.parametrize(("time_increment", "times"), [(0.0, 1), (0.08 / 181, 2)])
def test_only_a_slow_sweep_is_read_and_matched_twice(name, time_increment, times, monkeypatch):
    slam = settled(name, 3)
    read, matched = (calls(monkeypatch, *of) for of in ((slam._scan, "read"), (slam, "_match")))
    slam.update(scan_at((0.0, 0.0, 0.0), laser(181, time_increment=time_increment), t=0.3))
    assert len(read) == len(matched) == times


def test_the_pose_that_is_returned_is_that_of_a_sweeps_first_beam(name):
    lidar, slam = laser(181, time_increment=0.08 / 181), settled(name, 0)
    for k in range(5):
        pose = Pose2(0.05 * k, 0.0, 0.0)
        found = slam.update(scan_at(pose, lidar, t=0.1 * k, odometry=pose))
    ahead = found.between(slam._estimator.pose).x  # half of 0.08 s at half a meter a second
    assert ahead == pytest.approx(0.02, abs=0.004)


def test_at_rest_the_map_is_entered_by_the_first_scans_alone(name):
    first = 1 if name == "tsd" else 10
    assert [settled(name, n).report()["inserted"] for n in (first, 20)] == [first, first]


@pytest.mark.parametrize(("missing", "begins"), [(1, False), (0, True)])
def test_a_map_begins_with_a_scan_that_has_enough_end_points(name, missing, begins):
    slam = settled(name, 0)
    ranges = np.full(LIDAR.n_beams, np.inf, np.float32)
    ranges[: MIN_FIRST_POINTS - missing] = 2.0
    slam.update(Scan(0.0, ranges, LIDAR))
    report = slam.report()
    assert (report["inserted"], report["lost"], report["empty"]) == (int(begins), 0, 0)
    assert slam.state == ("matched" if begins else "predicted")
