"""Odometry and gyro looked up as they come; a log as a robot publishes it."""

import math
import threading

import numpy as np
import pytest

import slams
from slams.live import series
from slams.live.estimate import MAX_CONSECUTIVE_LATE
from slams.live.options import NodeOptions, topic_names
from slams.live.robot import Robot
from slams.live.series import IntegralSeries, PoseSeries, Series
from slams.play import until_last_scan
from slams.ros.messages import seconds
from slams.time_series import MAX_ATTITUDE_GAP, TimeSeries
from slams.types import Pose2, wrap_angle
from tests.rooms import drive, laser
from tests.slams.live.robots import Bus, planar


def test_poses_and_headings_are_bit_for_bit_those_of_the_recorded_track():
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.choice([0.01, 0.06, 0.7], 300, p=[0.5, 0.48, 0.02]))
    turns = wrap_angle(np.cumsum(rng.normal(0.4, 1.0, 300)))  # round and round, both ways
    track = TimeSeries(t, np.column_stack([rng.normal(size=(300, 2)), turns]))
    rate = TimeSeries(t, rng.normal(size=300))
    poses, heading = PoseSeries(), IntegralSeries()
    tilts = Series(MAX_ATTITUDE_GAP)
    for stamp, row, turn in zip(t.tolist(), track.values.tolist(), rate.values, strict=True):
        poses.push(stamp, *row)
        heading.push(stamp, float(turn))
        tilts.push(stamp, *row[:2])
    asked = np.concatenate([rng.uniform(t[0], t[-1], 500), t])
    found = np.array([poses.pose_at(one) for one in asked.tolist()])
    assert np.array_equal(found, track.poses_at(asked))
    angles = [heading.at(one)[0] for one in asked.tolist()]
    assert np.array_equal(angles, rate.integral_at(asked))
    found = np.array([tilts.at(one) or (np.nan, np.nan) for one in asked.tolist()])
    known = TimeSeries(t, track.values[:, :2]).attitudes_at(asked)
    assert np.array_equal(found, known, equal_nan=True) and np.isnan(known).any()
    for outside in (t[0] - 1e-6, t[-1] + 1e-6):
        assert poses.pose_at(outside) is None
        assert heading.at(outside) is None


def test_a_long_drive_keeps_only_the_last_samples():
    line = PoseSeries()
    for k in range(3 * series.MIN_KEPT_SAMPLES):
        line.push(0.01 * k, 0.01 * k, 0.0, 0.0)
    assert series.MIN_KEPT_SAMPLES <= len(line.t) <= 2 * series.MIN_KEPT_SAMPLES
    assert line.pose_at(line.t[-1]).x == pytest.approx(0.01 * (3 * series.MIN_KEPT_SAMPLES - 1))


def test_late_samples_are_left_out_until_the_clock_was_set_back():
    line = IntegralSeries()
    for t in (10.0, 10.1, 10.05, 10.1, 10.2):
        line.push(t, 1.0)
    assert line.t == [10.0, 10.1, 10.2]
    for k in range(MAX_CONSECUTIVE_LATE + 3):
        line.push(1.0 + 0.1 * k, 1.0)
    assert line.t[0] == pytest.approx(1.0 + 0.1 * MAX_CONSECUTIVE_LATE)
    assert line.at(line.t[-1])[0] == pytest.approx(0.2)


@pytest.mark.parametrize("wrong", [Pose2(math.nan, 0, 0), Pose2(0, 0, math.inf), Pose2(1e9, 0, 0)])
def test_what_no_robot_has_is_left_out(wrong):
    line = PoseSeries()
    line.push(0.0, 0.0, 0.0, 0.0)
    line.push(1.0, *wrong)
    line.push(2.0, 2.0, 0.0, 0.0)
    assert line.pose_at(1.0) == Pose2(1.0, 0.0, 0.0)


def test_nobody_waits_for_what_has_fallen_silent(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(series.time, "monotonic", lambda: now[0])
    line, never = IntegralSeries(), IntegralSeries()
    line.push(1.0, 0.0)
    assert not line.is_behind(1.0) and line.is_behind(1.5) and not never.is_behind(1.5)
    now[0] += series.SAMPLE_TIMEOUT + 0.1
    assert not line.is_behind(1.5)


@pytest.fixture
def sweeping():
    return drive(n=4, rate=10.0, lidar=laser(11, time_increment=0.005))


def test_a_scan_is_sent_when_its_last_beam_is_measured_and_odometry_when_it_is(sweeping):
    bus, order = Bus(), []
    robot = Robot(sweeping, bus.transport(), topic_names())
    for moment in robot.schedule:
        before = {topic: len(sent) for topic, sent in bus.raw.items()}
        robot.send(moment)
        new = [topic for topic, sent in bus.raw.items() if len(sent) > before.get(topic, 0)]
        order.append((round(moment.t, 3), *new))
        assert moment.topic == new[0]
    first = [(0.0, "/odom", "/tf"), (0.0, "/imu"), (0.05, "/scan"), (0.1, "/odom", "/tf")]
    assert order[:4] == first
    assert len(order) == 12
    scan, odometry, moved = (bus.sent(topic)[2] for topic in ("/scan", "/odom", "/tf"))
    first, other = (seconds(message.header.stamp) for message in (scan, odometry))
    assert first == other == pytest.approx(0.2)  # stamped with the first beam
    assert scan.time_increment == pytest.approx(0.005)
    at, edge = odometry.pose.pose, moved.transforms[0]
    assert planar(at.position, at.orientation) == pytest.approx(sweeping.odom.values[2])
    assert edge.transform.translation.x == at.position.x
    assert (edge.header.frame_id, edge.child_frame_id) == ("odom", odometry.child_frame_id)
    assert bus.sent("/imu")[2].angular_velocity.z == pytest.approx(sweeping.yaw_rate.values[2])


def test_stamps_that_ros_cannot_hold_begin_at_zero(sweeping):
    bus = Bus()
    early = slams.ScanLog(sweeping.t - 50.0, sweeping.ranges, sweeping.laser)
    robot = Robot(early, bus.transport(), topic_names(["/scan:=/front/scan"]))
    for moment in robot.schedule:
        robot.send(moment)
    stamps = [seconds(scan.header.stamp) for scan in bus.sent("/front/scan")]
    assert stamps == pytest.approx([0, 0.1, 0.2, 0.3])
    assert set(bus.raw) == {"/front/scan", "/tf_static"}


def test_somebody_is_waited_for(sweeping):
    wire = Bus().transport()
    robot = Robot(sweeping, wire, topic_names())
    ending = threading.Event()
    robot._publishers["/scan"].subscribers = 0
    assert robot.await_subscriber(0.1, ending) is False
    robot._publishers["/scan"].subscribers = 1
    ending.set()
    assert robot.await_subscriber(0.1, ending) is True


def test_the_first_scans_of_a_log_are_sent_with_their_odometry_alone():
    robot = Robot(drive(n=20, rate=10.0).select(2), Bus().transport(), topic_names())
    kept = until_last_scan(robot.schedule)
    assert [due.topic for due in kept].count("/scan") == 2 and robot.schedule[-1].t > 1.8
    assert kept[-1].t == pytest.approx(0.1 + NodeOptions.wait)
