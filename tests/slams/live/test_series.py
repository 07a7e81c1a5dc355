"""Odometry and gyro looked up as they come, against the recorded track looked up as a whole."""

import math

import numpy as np
import pytest

from slams.live import series
from slams.live.estimate import LATE_IN_A_ROW
from slams.live.series import IntegralSeries, PoseSeries, Series
from slams.track import MAX_ATTITUDE_GAP, Track
from slams.types import Pose2, wrap_angle


def test_poses_and_headings_are_bit_for_bit_those_of_the_recorded_track():
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.choice([0.01, 0.06, 0.7], 300, p=[0.5, 0.48, 0.02]))
    turns = wrap_angle(np.cumsum(rng.normal(0.4, 1.0, 300)))  # round and round, both ways
    track = Track(t, np.column_stack([rng.normal(size=(300, 2)), turns]))
    rate = Track(t, rng.normal(size=300))
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
    known = Track(t, track.values[:, :2]).attitudes_at(asked)
    assert np.array_equal(found, known, equal_nan=True) and np.isnan(known).any()
    for outside in (t[0] - 1e-6, t[-1] + 1e-6):
        assert poses.pose_at(outside) is None
        assert heading.at(outside) is None


def test_a_long_drive_keeps_only_the_last_samples():
    line = PoseSeries()
    for k in range(3 * series.MAX_SAMPLES):
        line.push(0.01 * k, 0.01 * k, 0.0, 0.0)
    assert series.MAX_SAMPLES <= len(line.t) <= 2 * series.MAX_SAMPLES
    assert line.pose_at(line.t[-1]).x == pytest.approx(0.01 * (3 * series.MAX_SAMPLES - 1))


def test_late_samples_are_left_out_until_the_clock_was_set_back():
    line = IntegralSeries()
    for t in (10.0, 10.1, 10.05, 10.1, 10.2):
        line.push(t, 1.0)
    assert line.t == [10.0, 10.1, 10.2]
    for k in range(LATE_IN_A_ROW + 3):
        line.push(1.0 + 0.1 * k, 1.0)
    assert line.t[0] == pytest.approx(1.0 + 0.1 * LATE_IN_A_ROW)
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
    assert not line.holds_up(1.0) and line.holds_up(1.5) and not never.holds_up(1.5)
    now[0] += series.MAX_SILENCE + 0.1
    assert not line.holds_up(1.5)
