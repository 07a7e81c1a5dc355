import math

import numpy as np
import pytest

from gmapping.choice import believed, foreseen
from gmapping.match import FIRM, Match
from gmapping.surfaces import FOUND, GAIN
from slams import load
from slams.geometry import Prior
from slams.motion.track import INDEPENDENT, Track
from slams.types import IDENTITY, Pose2
from tests.gmapping.scenes import LASER, make_scan, run

AWAY = Pose2(-0.8, 0.0, 0.0)
SECOND = 1.0


@pytest.fixture
def track():
    """A robot whose wheels say 1 m."""
    track = Track(run([])[0].params)
    for i in range(2):
        at = Pose2(1.0 * i, 0.0, 0.0)
        track.predict(make_scan(at, SECOND * i, LASER, odometry=at))
        if i == 0:
            track.matched(at, 1e6 * np.eye(3), make_scan(at, 0.0, LASER, odometry=at))
    return track


def match(cost, off=IDENTITY, old=0.0):
    return Match(Pose2(1.0, 0.0, 0.0) @ off, 0.5, np.eye(3), cost, old)


def test_what_contradicts_the_prediction_has_to_explain_more(track):
    ahead, behind = match(50.0), match(50.0, AWAY)
    price = INDEPENDENT * track.charge(behind.pose)
    assert 5.0 < price < 30.0  # of a hundred independent beams
    for less, goes in ((1.0, False), (price - 0.1, False), (price + 0.1, True)):
        behind = behind._replace(cost=ahead.cost - less)
        assert believed([ahead, behind], track) is (behind if goes else ahead)


class Cheaper:
    """A matcher that finds the robot `off` where it explains more, unless it is held firmly."""

    def __init__(self, off, gain):
        self.off, self.gain, self.priors = off, gain, []

    def match(self, _view, _owner, prior, start):
        self.priors.append(prior)
        if len(self.priors) == 1:
            return Match(start @ Pose2(self.off, 0.0, 0.0), 1.0, np.eye(3), 50.0 - self.gain)
        return Match(start, 1.0, np.eye(3), 50.0)


@pytest.mark.parametrize(
    ("off", "gain", "asked", "goes"),
    [(0.09, 0.0, 1, True), (0.11, 1.0, 2, False), (0.9, 10.0, 2, False), (0.9, 30.0, 2, True)],
)
def test_a_match_where_no_robot_accelerates_to_has_to_explain_more(off, gain, asked, goes):
    known, matcher = Prior(Pose2(2.0, 1.0, 0.0), 1e4 * np.eye(3)), Cheaper(off, gain)
    found = foreseen(matcher, None, 0, known, 0.1)
    assert found.pose.x == pytest.approx(2.0 + (off if goes else 0.0))
    assert len(matcher.priors) == asked and matcher.priors[0] is known
    assert asked == 1 or (matcher.priors[1].information == FIRM * known.information).all()


@pytest.mark.parametrize(("preset", "asked"), [("default", 2), ("paper", 1)])
def test_the_default_asks_where_a_robot_can_have_accelerated_to(monkeypatch, preset, asked):
    scans = [make_scan(IDENTITY, 0.1 * i) for i in range(20)]
    slam, _ = run(scans[:-1], preset, n_particles=1)
    start = slam._track.predict(scans[-1])
    view, matcher = slam._view.take(scans[-1], IDENTITY), Cheaper(0.15, 0.0)  # 0.1 m: possible
    monkeypatch.setattr(slam, "_matcher", matcher)
    slam._tracked(view, start)
    assert len(matcher.priors) == asked


def test_a_loop_that_closes_is_not_charged_for_the_last_step(track):
    ahead, home = match(50.0, old=0.2), match(45.0, AWAY, old=FOUND + 0.01)
    assert believed([ahead, home], track) is home
    assert believed([ahead, home._replace(old=FOUND - 0.01)], track) is ahead
    known = ahead._replace(old=FOUND + 0.02 - GAIN)  # what is predicted is explained by it, too
    assert believed([known, home], track) is known


def test_where_no_robot_can_be_there_is_none(track):
    ahead, far = match(90.0), match(0.0, Pose2(30.0, 0.0, 0.0), old=1.0)
    assert believed([ahead, far], track) is ahead


def test_a_robot_with_good_wheels_does_not_stand_still_in_a_bare_corridor(shared_data):
    log = load(shared_data("data/keyscans/acapulco.npz")).select(162)
    _, poses = run(log, n_particles=1)
    wheels = np.array([scan.odometry for scan in log])
    for i in range(150, 161):  # at 155 the scan seems to say 0.2 m, the wheels 1 m
        way = math.dist(poses[i, :2], poses[i + 1, :2])
        assert way == pytest.approx(math.dist(wheels[i, :2], wheels[i + 1, :2]), abs=0.3)
