"""The pose from scan to scan: what predictions count for, and what comes without a match."""

import math

import numpy as np
import pytest

from slams.geometry import FREEDOM, add_prior
from slams.motion.belief_kernels import evenness
from slams.motion.params import MotionParams
from slams.motion.sight import CLEAR
from slams.motion.track import INDEPENDENT, LOST_AFTER, Track
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import laser

CLUTTER = np.random.default_rng(4).uniform(1.0, 9.0, 400).astype(np.float32)
BEAM = (CLUTTER, laser(400))  # no walls: what is seen is what the matcher says
ROOM = np.diag([1e6, 1e6, 1e7])  # 1/m^2, 1/rad^2: what a scan says that sees all directions
CORRIDOR = np.diag([1e2, 1e6, 1e7])
STEP = 0.05  # m in 0.1 s


def stamped(k, wheels=True):
    return Scan(0.1 * k, *BEAM, Pose2(STEP * k, 0.0, 0.0) if wheels else None)


def driven(seen, n=30, wheels=True):
    """A track after `n` scans that were all matched where the robot is."""
    track = Track(MotionParams())
    for k in range(n):
        track.predict(stamped(k, wheels))
        track.matched(Pose2(STEP * k, 0.0, 0.0), seen, stamped(k, wheels))
    return track


def twins(seen):
    """Two tracks that went the same way, one of them without caution from now on."""
    careful, plain = driven(seen), driven(seen)
    plain._params = plain._params.replace(caution=1.0)
    for track in (careful, plain):
        track.predict(stamped(30))
    return careful, plain


def test_a_prediction_counts_less_where_the_scan_sees_all_directions():
    for seen, times in ((ROOM, 50.0), (CORRIDOR, 1.0)):
        careful, plain = twins(seen)
        assert careful.expected == pytest.approx(times * plain.expected, rel=0.01)


def test_wheels_count_as_they_are_where_few_beams_make_a_map_with_gaps():
    few = np.where(np.arange(400) % 9 == 0, CLUTTER, np.inf).astype(np.float32)
    for wheels, least, most in ((True, 1.5, 2.0), (False, 49.0, 51.0)):
        track = driven(ROOM, wheels=wheels)
        full = stamped(30, wheels)
        track.predict(Scan(full.t, few, full.laser, full.odometry))
        assert least < track.expected[0, 0] / track.predicted[0, 0] < most


@pytest.mark.parametrize(("share", "times"), [(1.0, 4.0), (0.0, 1.0)])
def test_surprises_widen_what_is_predicted_only_where_the_scan_sees_something(share, times):
    """Else a deviation that no scan brings down would be multiplied again at every scan."""
    track, plain = driven(ROOM), driven(ROOM)
    track._scale = 4.0
    for each in (track, plain):
        each._sight = CLEAR._replace(share=share)
        each.predict(stamped(30))
    along, across = np.diagonal(track.predicted)[:2] / np.diagonal(plain.predicted)[:2]
    assert along == pytest.approx(times, rel=0.01) and across == pytest.approx(4.0, rel=0.01)


def test_what_is_missed_is_as_sure_as_the_prediction_not_as_its_prior():
    careful, plain = twins(ROOM)
    for track in (careful, plain):
        track.missed(stamped(30))
    assert careful.pose == pytest.approx((STEP * 30, 0.0, 0.0), abs=1e-3)
    assert careful.covariance == pytest.approx(plain.covariance)


@pytest.mark.parametrize("wheels", [True, False])
def test_a_second_without_a_match_is_lost_unless_wheels_hold_the_pose(wheels):
    track = driven(ROOM, wheels=wheels)
    for k in range(30, 50):
        track.predict(stamped(k, wheels))
        track.missed(stamped(k, wheels))
        since = 0.1 * (k - 29)
        if since < LOST_AFTER - 0.05:
            assert track.state == "predicted" and not track.held
        elif since > LOST_AFTER + 0.05:
            assert track.state == ("predicted" if wheels else "lost") and track.held is wheels
    assert (track.lost > 0) is not wheels


def test_a_given_pose_stands_and_the_motion_before_it_means_nothing():
    track, given = driven(ROOM), Pose2(7.0, -3.0, 1.0)
    track.placed(given, stamped(30, wheels=False))
    assert track.pose == given and track.state == "matched"
    assert track.covariance[0, 0] < 1e-6
    predicted = track.predict(stamped(31, wheels=False))
    assert predicted.pose == pytest.approx(given, abs=1e-6)


def test_another_pose_costs_more_the_farther_it_is_but_not_without_end():
    track = driven(CORRIDOR)
    track.predict(stamped(30))
    price = [track.charge(Pose2(STEP * 30 + off, 0.0, 0.0)) for off in (0.0, 0.01, 0.1, 1.0)]
    assert price[0] == pytest.approx(0.0, abs=1e-3)
    assert price[0] < price[1] < price[2] < price[3]
    assert price[3] - price[2] < (FREEDOM + 3.0) * math.log(10.0) / INDEPENDENT  # heavy tails
    assert track.reachable(Pose2(STEP * 30, 0.3, 0.0))
    assert not track.reachable(Pose2(STEP * 30 + 3.0, 0.0, 0.0))


def test_evenness_is_the_ratio_of_the_axes_however_they_are_turned():
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    assert evenness(turn @ np.diag([4.0, 1.0, 9.0]) @ turn.T) == pytest.approx(0.25)
    assert evenness(np.eye(3)) == pytest.approx(1.0)


@pytest.mark.parametrize("deviations", [0.5, 3.0, 30.0])
def test_a_prior_has_the_tails_of_students_law(deviations):
    H, out, b = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    prior = np.diag([4.0, 1.0, 1.0])
    off = Pose2(deviations / 2.0, 0.0, 0.0)
    add_prior(H, prior, 2.0, off, out, b)
    w = 2.0 * (FREEDOM + 3.0) / (FREEDOM + deviations**2)
    assert out == pytest.approx(w * prior)
    assert b == pytest.approx([w * 4.0 * off.x, 0.0, 0.0])
    assert off != IDENTITY


@pytest.mark.parametrize("years", [0.0, 0.3, 54.0])
def test_a_covariance_stays_one_after_a_break_of_years(years):
    """A scan of one wall, whose information is not quite singular, as sums are rounded."""
    track, wall = driven(ROOM, wheels=False), np.diag([-3e-14, 10.0, 400.0])
    later = Scan(3.0 + years * 3e7, *BEAM)
    track.predict(later)
    track.matched(track._prediction.pose, wall, later)
    assert np.linalg.eigvalsh(track.covariance).min() > 0.0
    track.predict(Scan(later.t + 0.1, *BEAM))
    assert np.linalg.eigvalsh(track.expected).min() > 0.0


def test_the_room_for_accelerations_grows_with_the_time_since_a_match():
    p = MotionParams()
    for blind in (1, 6):
        track = driven(ROOM)
        for k in range(30, 30 + blind):
            track.predict(stamped(k))
            if k < 29 + blind:
                track.missed(stamped(k))
        assert track.room == pytest.approx(p.top_acceleration * (0.1 * blind) ** 2 + p.leap)
