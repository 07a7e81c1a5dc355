"""What a track learns from a match or its lack, and when it is held, adrift or unproven."""

import math

import numpy as np
import pytest

from slams.geometry import FREEDOM
from slams.motion.chord import FAR, with_the_same_error
from slams.motion.params import MotionParams, without_wheels
from slams.motion.sight import CLEAR
from slams.motion.sight_kernels import N_FACES, faces
from slams.motion.slip import BETWEEN, SHIFTS, Slip, slip
from slams.motion.track import (
    INDEPENDENT,
    LOST_AFTER,
    Track,
)
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import CORRIDOR, cast, laser

P = MotionParams()
CLUTTER = np.random.default_rng(4).uniform(1.0, 9.0, 400).astype(np.float32)
BEAM = (CLUTTER, laser(400))  # no walls: what is seen is what the matcher says
ROOM = np.diag([1e6, 1e6, 1e7])  # 1/m^2, 1/rad^2
STEP = 0.05  # m in 0.1 s


def stamped(k, wheels=True):
    return Scan(0.1 * k, *BEAM, Pose2(STEP * k, 0.0, 0.0) if wheels else None)


def driven(n=30, wheels=True, **more):
    """A track after `n` scans that were all matched where the robot is."""
    track = Track(P, **more)
    for k in range(n):
        track.predict(stamped(k, wheels))
        track.matched(Pose2(STEP * k, 0.0, 0.0), ROOM, stamped(k, wheels))
    return track


def surprised(track, k, wheels, off=0.3):
    """The track's scale after a match off the prediction."""
    found = track.predict(stamped(k, wheels)).pose
    track.matched(found @ Pose2(off, 0.0, 0.0), ROOM, stamped(k, wheels))
    return track._scale


def test_a_surprise_widens_what_is_expected_but_not_after_a_blind_drive():
    assert surprised(driven(wheels=False), 30, wheels=False) > 1.2
    track = driven(wheels=False)
    track.predict(stamped(30, wheels=False))
    track.missed(stamped(30, wheels=False))
    assert surprised(track, 31, wheels=False) == 1.0


def test_a_surprise_against_the_wheels_counts_only_where_that_was_asked_for():
    for widen in (True, False):
        track = driven(widen_wheels=widen)
        assert (surprised(track, 30, wheels=True) > 1.2) == widen


def test_what_was_widened_narrows_ten_times_as_slowly_and_never_below_what_is_known():
    track = driven(wheels=False)
    track._seconds = 0.1
    widths = []
    for by_scan in (np.full(3, 100.0), np.zeros(3)):
        track._scale = 2.0
        track._learn(by_scan, np.eye(3))
        widths.append(math.log(track._scale / 2.0))
    assert widths == pytest.approx([0.1 * 9.0, -0.1 / 10.0])
    track._scale = 1.0
    track._learn(np.zeros(3), np.eye(3))
    assert track._scale == 1.0


def test_the_pose_of_a_missed_scan_is_the_prediction():
    track = driven()
    found = track.predict(stamped(30))
    track.missed(stamped(30))
    assert track.pose == found.pose
    assert track.covariance is track.predicted
    assert track._sight == CLEAR


@pytest.mark.parametrize(("deviation", "held"), [(0.01, True), (0.6, False)])
def test_wheels_hold_a_pose_only_while_they_are_sure(deviation, held):
    track = driven()
    track.predict(stamped(30))
    track._seconds, track.predicted = 1.5, deviation**2 * np.eye(3)
    track.missed(stamped(30))
    assert track.held == held
    assert track.state == ("predicted" if held else "lost")


def test_how_far_a_robot_can_have_come_grows_with_the_time_since_the_last_match():
    track = driven()
    track.predict(stamped(30))
    for k, ways in ((30, (0.3, 0.9)), (40, (3.0, 9.0))):
        track._seconds = 0.1 * (k - 29)
        can, cannot = (track.pose @ Pose2(way * P.top_speed / 3.0, 0.0, 0.0) for way in ways)
        assert track.reachable(can), k
        assert not track.reachable(cannot @ Pose2(P.leap + P.top_speed, 0.0, 0.0)), k


def test_a_charge_is_the_logarithm_of_students_law_shared_by_independent_beams():
    track = driven()
    track.predict(stamped(30))
    off = 2.0 / math.sqrt(track._information[0, 0])
    pose = track._prediction.pose
    moved = Pose2(pose.x + off, pose.y, pose.theta)
    d2 = off * off * track._information[0, 0]
    expected = 0.5 * (FREEDOM + 3.0) * math.log1p(d2 / FREEDOM) / INDEPENDENT
    assert track.charge(moved) == pytest.approx(expected)


def test_a_start_that_is_elsewhere_is_held_less():
    track = driven()
    track.predict(stamped(30))
    pose = track._prediction.pose
    assert track.prior(pose) == pytest.approx(track._information)
    held = track.prior(Pose2(pose.x + 1.0, pose.y, pose.theta))
    assert held[0, 0] < 1.01 and held[1, 1] == pytest.approx(track._information[1, 1], rel=1e-3)


def test_the_first_scan_is_where_the_map_begins_and_as_sure():
    track = Track(P)
    track.predict(stamped(0))
    track.matched(IDENTITY, np.zeros((3, 3)), stamped(0))
    assert np.diag(track.covariance).max() < 1e-9


def test_a_laser_that_begins_without_wheels_may_be_carried_sideways():
    for wheels in (True, False):
        track = Track(P)
        track.predict(stamped(0, wheels))
        aside = P.acceleration_aside if wheels else P.acceleration
        assert track.motion._motion.axes["first"][1] == aside**2
    assert without_wheels(P).acceleration == P.acceleration


def test_the_same_error_adds_deviations_until_the_pose_is_anywhere():
    a, b = 4.0 * np.eye(3), 1.0 * np.eye(3)
    assert with_the_same_error(a, b) + b == pytest.approx((2.0 + 1.0) ** 2 * np.eye(3))
    anywhere = FAR**2 * np.eye(3)
    assert with_the_same_error(anywhere, b) is anywhere


def after_a_gap(wheels, missed):
    """A track whose first match comes two seconds after the last."""
    track = driven(wheels=wheels)
    for k in range(30, 50):
        if missed or k == 49:
            track.predict(stamped(k, wheels))
        if missed and k < 49:
            track.missed(stamped(k, wheels))
    track.predicted = 9.0 * np.eye(3)
    track.matched(track._prediction.pose, ROOM, stamped(49, wheels))
    return track


@pytest.mark.parametrize("missed", [True, False])
def test_the_first_match_after_a_gap_has_to_stand_for_a_second_unless_wheels_led_there(missed):
    assert after_a_gap(wheels=True, missed=missed).state == "matched"
    track = after_a_gap(wheels=False, missed=missed)
    assert track.state == "lost" and track.unproven and not track.adrift
    k = 50
    while track.state == "lost":
        track.predict(stamped(k, wheels=False))
        track.matched(track._prediction.pose, ROOM, stamped(k, wheels=False))
        k += 1
    assert 0.1 * (k - 50) == pytest.approx(LOST_AFTER, abs=0.11)


def test_what_noise_turns_a_wall_by_is_taken_off():
    lidar, seen = laser(721), []
    ranges = cast(CORRIDOR, (0.0, 0.2, 0.0), lidar).astype(np.float32)
    for noise in (0.0, 0.005, 0.01):
        out = np.zeros(N_FACES)
        faces(ranges, lidar.directions, 1, 5.0, noise, out)
        seen.append(out[:3])
    assert seen[0][0] == pytest.approx(0.0, abs=1e-3) and seen[0][2] > 100.0
    assert seen[2][0] == pytest.approx(4.0 * seen[1][0], rel=1e-2)
    assert seen[2][0] < -0.1


def test_a_scan_alone_has_the_pose_farther_off_than_what_lies_between_it_and_the_prediction():
    track = driven(wheels=False)
    track.predict(stamped(30, wheels=False))
    known = track._information
    pose = track._prediction.pose @ Pose2(0.02, -0.01, 0.0)
    off = track._off(pose)
    assert track._by_scan(pose, known) == pytest.approx(2.0 * off, rel=1e-2, abs=1e-6)
    assert track._by_scan(pose, 1e6 * known) == pytest.approx(off, rel=1e-3, abs=1e-6)


def test_a_slip_is_the_mean_of_all_places_by_what_leads_beyond_chance():
    leads, variance = np.zeros((len(SHIFTS), 2)), 0.04
    leads[12] = 1.0, 4.0  # a lead of one, where half of two is chance
    found = slip(leads, variance)
    assert found.moved == pytest.approx(0.0, abs=1e-12)
    assert found.information == pytest.approx(0.0, abs=1e-9)
    leads[12], leads[3] = (6.0, 4.0), (-2.0, 4.0)
    before = np.exp(-0.5 * SHIFTS**2 / variance)
    after = before * np.exp(np.where(np.arange(len(SHIFTS)) == 12, 5.0, 0.0))
    after[3] *= np.exp(-1.0)
    places = [weight / weight.sum() for weight in (before, after)]
    means = [float(place @ SHIFTS) for place in places]
    doubts = [
        float(place @ (SHIFTS - mean) ** 2) + BETWEEN
        for place, mean in zip(places, means, strict=True)
    ]
    found = slip(leads, variance)
    assert found.moved == pytest.approx(means[1])
    assert found.information == pytest.approx(1.0 / doubts[1] - 1.0 / doubts[0])


def test_a_slip_is_looked_for_as_far_as_scan_and_prediction_leave_it_open(monkeypatch):
    track, told = driven(wheels=False), []
    track.predict(stamped(30, wheels=False))
    track._sight = CLEAR._replace(x=0.6, y=0.8, share=0.1)
    monkeypatch.setattr(
        "slams.motion.track.slip", lambda leads, doubt: told.append(doubt) or Slip(0.1, 7.0)
    )
    honest, pose = np.diag([4.0, 9.0, 1.0]), track._prediction.pose
    moved, worth = track._looked_along(pose, honest, lambda pose, offsets: offsets)
    axis = np.array([0.6, 0.8, 0.0])
    assert told[0] == pytest.approx(axis @ np.linalg.inv(honest + track.prior(pose)) @ axis)
    assert moved == pytest.approx(Pose2(pose.x + 0.06, pose.y + 0.08, pose.theta))
    assert worth == pytest.approx(honest + 7.0 * np.outer(axis, axis))
