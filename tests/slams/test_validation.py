"""Numbers that no robot records: said and refused at the door, or survived; never a warning."""

import math
from dataclasses import replace

import numpy as np
import pytest

import slams
from slams import LiveSlam, Pose2
from slams.scanlog import ScanLog, TimeSeries
from tests.rooms import drive, fields_of, push_fields, rewritten, scan_at

LIVE = "hector"


def changed(path, **arrays):
    """The same npz with other arrays."""
    drive(n=12, rate=40.0).save(path)
    return rewritten(path, path, **arrays)


T = np.arange(12) / 40.0


def test_milliseconds_from_the_start_are_suspected(tmp_path):
    slow = slams.load(changed(tmp_path / "log.npz", t=1e3 * T))
    assert any("a scan every 25 s; milliseconds?" in note for note in slow.notes)
    seldom = slams.load(changed(tmp_path / "log.npz", t=100.0 * T))  # keyframes
    assert not any("milliseconds" in note for note in seldom.notes)


@pytest.mark.parametrize("value", [1e300, -1e300, 1e39])
def test_ranges_beyond_float32_are_nothing_seen(value, tmp_path):
    ranges = np.full((12, 361), 2.0)
    ranges[:, 3] = value
    log = slams.load(changed(tmp_path / "log.npz", ranges=ranges))
    assert (np.isinf if value > 0.0 else np.isnan)(log.ranges[:, 3]).all()


def test_a_truth_from_another_file_is_looked_at_too(tmp_path):
    path = changed(tmp_path / "log.npz")
    (tmp_path / "truth.tum").write_text("0 0 0 0 0 0 0 1\n1 1e300 0 0 0 0 0 1\n")
    with pytest.raises(ValueError, match=r"truth: got values as great as 1e[+]300"):
        slams.load(path, truth=str(tmp_path / "truth.tum"))


def test_a_log_made_in_python_is_looked_at_too():
    log = drive(n=3)
    with pytest.raises(ValueError, match="odom: got values as great as"):
        ScanLog(log.t, log.ranges, log.laser, TimeSeries(log.t, np.full((3, 3), 1e8)))


@pytest.fixture
def live():
    live = LiveSlam(LIVE, warm_up=False)
    push(live, 0.0)
    return live


def push(live, t, x=0.0, **changes):
    scan = scan_at((x, 0.0, 0.0), t=t, odometry=Pose2(x, 0.0, 0.0))
    return push_fields(live, **(fields_of(scan) | changes))


@pytest.mark.parametrize(
    ("t", "changes", "sentence"),
    [
        (1e300, {}, "stamp: got stamps as great as 1e[+]300"),
        (1.7e18, {}, "they look like nanoseconds"),
        (math.nan, {}, "stamps that are not finite"),
        (0.1, {"range_max": 1e9}, "range_min, range_max: got"),
        (0.1, {"range_max": 0.0}, r"range_min, range_max: got \(0.1, 0.0\)"),
        (0.1, {"range_max": math.inf}, "the laser's geometry: got .*inf.*, expected finite"),
        (0.1, {"angle_min": 1e300}, "angle_min: got"),
        (0.1, {"angle_min": math.nan}, "the laser's geometry: got .*nan.*, expected finite"),
        (0.1, {"angle_increment": 1e-310}, "angle_increment: got"),
        (0.1, {"angle_increment": 0.0}, "angle_increment: got 0.0, expected a step between"),
        (0.1, {"odometry": (1.0, 2.0)}, "odometry: got 2 numbers, expected x, y, theta"),
        (0.1, {"ranges": []}, r"ranges: got shape \(0,\)"),
        (0.1, {"ranges": [[1.0]]}, r"ranges: got shape \(1, 1\)"),
        (0.1, {"ranges": np.ones(1 << 17)}, "ranges: got 131072 beams"),
    ],
)
def test_a_push_of_such_numbers_leaves_the_robot_running(t, changes, sentence, live):
    for _ in range(2):
        with pytest.raises(ValueError, match=sentence):
            push(live, t, 0.05, **changes)
    estimate = push(live, 0.1, 0.05)
    assert estimate.used
    assert estimate.pose.x == pytest.approx(0.05, abs=0.01)
    assert live.report()["scans"] == 2


@pytest.mark.parametrize("wrong", [1e9, -1e300, math.inf, math.nan])
def test_odometry_that_cannot_be_is_none(wrong, live):
    estimate = push(live, 0.1, 0.05, odometry=(0.05, wrong, 0.0))
    assert estimate.map_to_odom is None
    estimate = push(live, 0.2, 0.1, odometry=(0.1, 0.0, wrong))
    assert estimate.map_to_odom is None
    assert estimate.pose.x == pytest.approx(0.1, abs=0.02)


def test_a_scan_made_in_python_passes_the_same_door(live):
    good = scan_at((0.05, 0.0, 0.0), t=0.1, odometry=Pose2(0.05, 0.0, 0.0), yaw=0.0)
    for wrong, sentence in (
        (replace(good, t=1e300), "stamps as great as"),
        (replace(good, ranges=good.ranges[:5]), r"ranges: got shape \(5,\), expected \(361,\)"),
        (replace(good, laser=replace(good.laser, range_max=1e300)), "range_min, range_max"),
    ):
        with pytest.raises(ValueError, match=sentence):
            live.push_scan(wrong)
    live.push_scan(replace(good, odometry=Pose2(1e12, 0.0, 0.0), yaw=math.nan))
    assert live.last.map_to_odom is None
    assert live.last.pose.x == pytest.approx(0.05, abs=0.01)
