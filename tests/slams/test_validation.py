"""Numbers that no robot records: said and refused at the door, or survived; never a warning."""

import math

import numpy as np
import pytest

import slams
from slams import LiveSlam, Pose2
from slams.scanlog import ScanLog, Track
from slams.test_world import scan_at
from tests import bags
from tests.rooms import drive, fields_of, rewritten

LIVE = "hector"


def changed(path, **arrays):
    """The same npz with other arrays."""
    drive(n=12, rate=40.0).save(path)
    return rewritten(path, path, **arrays)


T = np.arange(12) / 40.0


@pytest.mark.parametrize(
    ("arrays", "sentence"),
    [
        ({"t": 1e9 * (1.7e9 + T)}, "they look like nanoseconds: divide by 1e[+]09"),
        ({"t": (1e9 * (1.7e9 + T)).astype(np.int64)}, "they look like nanoseconds"),
        ({"t": 1e6 * (1.7e9 + T)}, "they look like microseconds: divide by 1e[+]06"),
        ({"t": 1e3 * (1.7e9 + T)}, "they look like milliseconds: divide by 1000"),
        ({"t": 1e9 * T}, "a scan every 2.5e[+]07 s, expected seconds"),
        ({"t": 1e300 * T}, "stamps as great as 2.75e[+]299, expected seconds"),
        ({"range_max": 1e9}, r"range_min, range_max: got \(0.1, 1000000000.0\)"),
        ({"range_max": np.finfo(np.float64).max}, "range_min, range_max"),
        ({"mount": [1e9, 0.0, 0.0]}, "mount: got .*, expected at most 100 m from the base"),
        ({"mount": [0.0, 0.0, 1e300]}, "mount: got"),
        ({"angle_min": 1e300}, "angle_min: got 1e[+]300, expected radians"),
        ({"angle_increment": 1e-310}, "angle_increment: got"),
        ({"time_increment": 1e300}, "time_increment: got"),
        ({"time_increment": 1.0}, "time_increment: got 1.0, expected .* a sweep of at most 60 s"),
        ({"odom": np.full((12, 3), 1e9)}, "odom: got values as great as 1e[+]09"),
        ({"truth": np.full((12, 3), 1e300)}, "truth: got values as great as 1e[+]300"),
        ({"yaw_rate": np.full(12, -1e300)}, "yaw_rate: got values as great as 1e[+]300"),
        ({"odom_t": 1e9 * (1.7e9 + T)}, "odom_t: got stamps as great as .* nanoseconds"),
    ],
)
def test_a_log_with_such_numbers_is_refused_by_their_name(arrays, sentence, tmp_path):
    path = changed(tmp_path / "log.npz", **arrays)
    with pytest.raises(ValueError, match=sentence) as caught:
        slams.load(path)
    assert str(path) in str(caught.value)


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
    (tmp_path / "truth.csv").write_text("t,x,y,theta\n0,0,0,0\n1,1e300,0,0\n")
    with pytest.raises(ValueError, match=r"truth: got values as great as 1e[+]300"):
        slams.load(path, truth=str(tmp_path / "truth.csv"))


@pytest.mark.parametrize("limit", [0.0, 1e9, 3e38, math.inf])
def test_a_driver_that_knows_no_limit_gets_the_longest_reading(limit, tmp_path):
    def messages(make):
        return [("/scan", t, make.scan(t, [1.0, 7.0, 1e10], limits=(0.1, limit))) for t in T]

    log = slams.load(bags.write(tmp_path, "mcap", messages))
    assert log.laser.range_max == pytest.approx(7.0, rel=0.01)
    assert "are taken instead" in " ".join(log.notes)


def test_a_laser_far_from_its_base_is_told_with_the_file(tmp_path):
    def messages(make):
        far = make.tf(0.0, ("base_link", "laser", (1e6, 0.0, 0.0), 0.0, 0.0))
        return [("/tf_static", 0.0, far), *(("/scan", t, make.scan(t, [1.0, 2.0])) for t in T)]

    path = bags.write(tmp_path, "bag", messages)
    with pytest.raises(ValueError, match=r"mount: got \(1000000.0") as caught:
        slams.load(path)
    assert str(path) in str(caught.value)


def test_the_recorders_clock_can_be_broken_too(tmp_path):
    def messages(make):
        return [("/scan", 1e10 + t, make.scan(0.0, [1.0, 2.0])) for t in T]

    path = bags.write(tmp_path, "mcap", messages)
    with pytest.raises(ValueError, match=r"stamps as great as 1e[+]10, expected seconds"):
        slams.load(path)


def test_a_log_made_in_python_is_looked_at_too():
    log = drive(n=3)
    with pytest.raises(ValueError, match="odom: got values as great as"):
        ScanLog(log.t, log.ranges, log.laser, Track(log.t, np.full((3, 3), 1e8)))


@pytest.fixture
def live():
    live = LiveSlam(LIVE, warm_up=False)
    push(live, 0.0)
    return live


def push(live, t, x=0.0, **changes):
    scan = scan_at((x, 0.0, 0.0), t=t, odometry=Pose2(x, 0.0, 0.0))
    return live.push(**(fields_of(scan) | changes))


@pytest.mark.parametrize(
    ("t", "changes", "sentence"),
    [
        (1e300, {}, "stamp: got stamps as great as 1e[+]300"),
        (1.7e18, {}, "they look like nanoseconds"),
        (math.nan, {}, "stamps that are not finite"),
        (math.inf, {}, "stamps that are not finite"),
        (0.1, {"range_max": 1e9}, "range_min, range_max: got"),
        (0.1, {"range_max": 1e300}, "range_min, range_max: got"),
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
    assert push(live, 0.2, 0.1, odometry=(0.1, 0.0, wrong)).pose.x == pytest.approx(0.1, abs=0.02)
    assert live.report()["bad_odometry"] == 2


def test_a_gyro_that_cannot_be_is_not_believed(live):
    for k, rate in enumerate((0.0, 1e300, -1e300, 0.0)):
        estimate = push(live, 0.1 + 0.1 * k, yaw_rate=rate)
    live.push_yaw_rate(1e300, 0.0)
    estimate = push(live, 0.5, yaw_rate=0.0)
    assert abs(estimate.pose.theta) < 0.01


def test_a_sweep_of_an_hour_is_taken_as_instantaneous(live):
    assert push(live, 0.1, 0.05, time_increment=1e300).pose.x == pytest.approx(0.05, abs=0.01)


def test_a_scan_made_in_python_passes_the_same_door(live):
    from dataclasses import replace

    good = scan_at((0.05, 0.0, 0.0), t=0.1, odometry=Pose2(0.05, 0.0, 0.0), yaw=0.0)
    for wrong, sentence in (
        (replace(good, t=1e300), "stamps as great as"),
        (replace(good, ranges=good.ranges[:5]), r"ranges: got shape \(5,\), expected \(361,\)"),
        (replace(good, laser=replace(good.laser, range_max=1e300)), "range_min, range_max"),
    ):
        with pytest.raises(ValueError, match=sentence):
            live.push_scan(wrong)
    live.push_scan(replace(good, odometry=Pose2(1e12, 0.0, 0.0), yaw=math.nan))
    assert live.report()["bad_odometry"] == 1
    assert live.last.pose.x == pytest.approx(0.05, abs=0.01)
