import numpy as np
import pytest

from gmapping import GMappingParams
from gmapping.key import FEW, SELDOM, SETTLE, KeyScans
from slams.types import IDENTITY, Pose2


def test_a_robot_returns_where_it_was_long_ago_and_looks_seldom():
    keys = KeyScans(GMappingParams())
    for i in range(30):
        keys.done(Pose2(0.5 * i, 0.0, 0.0))
        assert not keys.returns(IDENTITY)
    for i in range(30, 42):
        keys.done(Pose2(0.5 * i, 0.0, 0.0))
    assert keys.driven == pytest.approx(21.5, abs=0.1)
    assert not keys.returns(Pose2(20.5, 0.0, 0.0))
    assert not keys.returns(Pose2(10.0, 0.0, 0.0))  # not so long ago
    assert not keys.returns(Pose2(2.0, 4.0, 0.0))
    assert keys.returns(Pose2(2.0, 1.0, 0.0))
    assert keys.returns(Pose2(2.0, 1.0, 0.0))  # to ask changes nothing
    for behind in (0.0, 0.5, 1.0):  # the first of these is noted: the next look is SELDOM behind
        keys.done(Pose2(21.0 + behind, 0.0, 0.0))
        assert keys.returns(Pose2(2.0, 1.0, 0.0)) == (behind >= SELDOM)


def test_noise_between_key_scans_is_that_of_the_way_whatever_the_rate():
    p, way, headings = GMappingParams(), Pose2(0.3, -0.4, 0.2), np.array([0.2, 1.3])
    xy = p.tracked_noise * (p.way_per_way * 0.5 + p.way_per_turn * 0.2) + p.key_noise
    theta = p.tracked_noise * (p.turn_per_way * 0.5 + p.turn_per_turn * 0.2) + p.key_noise
    noise, keys = np.diag([xy, xy, theta]) ** 2, KeyScans(p)
    predicted = np.diag([0.04, 0.01, 0.09])

    def covariances():
        return np.linalg.inv(keys.information(way, headings, predicted))

    np.testing.assert_allclose(covariances(), [noise, noise], atol=1e-12)
    keys.missed()  # the way is not tracked
    np.testing.assert_allclose(covariances(), [noise + predicted] * 2, atol=1e-12)
    keys.done(way)
    np.testing.assert_allclose(covariances(), [noise, noise], atol=1e-12)


def test_where_the_map_has_gaps_the_next_key_scan_is_due_the_sooner_the_fewer_beams_there_are():
    p, keys = GMappingParams(), KeyScans(GMappingParams())
    assert keys.due(IDENTITY)  # the first
    for _ in range(SETTLE):
        keys.done(IDENTITY)
    for beams, share in ((np.inf, 1.0), (720.0, 1.0), (360.0, 1.0), (90.0, 0.25), (45.0, 0.125)):
        for way, turn in ((p.linear_update, 0.0), (0.0, p.angular_update)):
            far = Pose2(1.01 * share * way, 0.0, -1.01 * share * turn)
            assert keys.due(far, beams, gaps=True)
            assert keys.due(far, beams) == (share == 1.0)
            assert not keys.due(Pose2(0.99 * share * way, 0.0, -0.99 * share * turn), beams, True)


def test_a_map_begins_with_many_scans_of_few_beams():
    keys = KeyScans(GMappingParams())
    for _ in range(SETTLE):
        assert keys.due(IDENTITY, FEW - 1.0)
        keys.done(IDENTITY)
        assert not keys.due(IDENTITY, FEW)
    assert not keys.due(IDENTITY, FEW - 1.0)
