"""The steps of `Tsd.update`, each where it is due, and corridors, where scans are degenerate."""

import math
from functools import partial

import numpy as np
import pytest

from slams.geometry import Prior
from slams.refine.lines import Match
from slams.types import IDENTITY, Pose2
from tests.rooms import CORRIDOR, NOTHING, box, calls, laser, scan_at, still
from tests.rooms import settled as after
from tests.tsd.cases import PILLARS, default
from tsd.registration import MAX_ICP_START_STD

FAR = Pose2(1.0, 0.0, 0.0)


settled = partial(after, "tsd")


@pytest.mark.parametrize(
    ("coarse", "fits", "found"),
    [
        (0.02, {0.0: 0.0}, [0.0]),  # ICP confirms the fit from the prediction
        (0.2, {0.0: 0.0, 0.2: 0.18}, [0.0, 0.18]),  # else both compete
    ],
)
def test_the_field_is_fitted_from_the_start_and_a_far_icp_pose(coarse, fits, found, monkeypatch):
    slam = settled(3)

    def align(scan, start, prior):
        return Match(Pose2(fits[round(start.x, 3)], 0.0, 0.0))

    monkeypatch.setattr(slam._map, "align", align)
    tried = slam._refine(IDENTITY, Match(Pose2(coarse, 0.0, 0.0)), Prior(IDENTITY, np.eye(3)))
    assert [one.pose.x for one in tried] == found


def prediction(slam, deviation):
    made = slam._estimator.predict(still(5))
    covariance = np.diag([deviation**2, 1e-8, 1e-8])
    return made._replace(covariance=covariance, information=np.zeros((3, 3)))


def registered(slam, shares, deviation, monkeypatch, start=None):
    """How often RANSAC is tried in a match whose ICP finds these shares, and the best share."""
    registration, left = slam._registration, list(shares)
    monkeypatch.setattr(registration, "icp", lambda *_: Match(IDENTITY, left.pop(0)))
    tried = calls(monkeypatch, registration, "ransac")
    prior = prediction(slam, deviation)
    found = registration.match(slam._scan, start or prior.pose, prior)
    return len(tried), found.inlier_ratio


@pytest.mark.parametrize(
    ("shares", "deviation", "times", "best"),
    [
        ([1.0], 0.5 * MAX_ICP_START_STD, 0, 1.0),  # as the mean
        ([1.0, 0.9], 1.5 * MAX_ICP_START_STD, 1, 1.0),  # an uncertain prediction
        ([0.7, 0.99], 0.01, 1, 0.99),  # an inlier ratio below the mean
        ([0.1, 0.2], 0.01, 1, 0.2),  # hardly any inliers
    ],
)
def test_ransac_is_tried_once_if_uncertain(shares, deviation, times, best, monkeypatch):
    slam = settled(5)
    assert slam._registration._mean_inlier_ratio > 0.9
    assert registered(slam, shares, deviation, monkeypatch) == (times, best)


def test_ransac_starts_only_from_the_prediction(monkeypatch):
    """The estimator's own search brings other starts."""
    slam, mean = settled(5), settled(5)._registration._mean_inlier_ratio
    assert registered(slam, [0.1], 1.0, monkeypatch, start=FAR) == (0, 0.1)
    assert slam._registration._mean_inlier_ratio == mean  # its ratio is not averaged either


@pytest.mark.parametrize(("least", "posed"), [(0.8, True), (1.0, False)])
def test_too_few_pairs_are_no_pose(least, posed):
    slam = settled(5, min_known=least)
    start = Pose2(0.01, 0.0, 0.0)
    found = slam._registration.icp(slam._scan, start, NOTHING)
    assert (found.inlier_ratio > 0.9 and found.pose != start) == posed
    away = Pose2(30.0, 0.0, 0.0)
    assert slam._registration.icp(slam._scan, away, NOTHING).pose == away


def test_things_that_moved_are_left_out_as_the_gate_closes():
    slam = settled(5, refine=False)
    elements = slam._scan.elements[: slam._scan.count]
    moved = np.arange(len(elements)) % 10 == 0
    elements[moved, :2] += 0.3 * elements[moved, 2:4]  # toward the laser
    found = slam._registration.icp(slam._scan, IDENTITY, NOTHING)
    assert math.hypot(found.pose.x, found.pose.y) < 1e-3


@pytest.mark.parametrize("n_beams", [361, 1081])
def test_pillars_of_a_corridor_are_enough_without_odometry(n_beams):
    pillars = [side for x, y in PILLARS for side in box(x, y, x + 0.5, y + 0.3)]
    slam, lidar, rng = default(), laser(n_beams), np.random.default_rng(3)
    for i in range(60):
        walls = np.array([*CORRIDOR, *pillars])
        found = slam.update(scan_at((0.03 * i, 0.0, 0.0), lidar, walls, 0.01, rng, 0.1 * i))
    assert found.x == pytest.approx(1.77, abs=0.2)


def test_wheels_keep_the_pose_of_few_beams_in_a_bare_ring():
    """Around a corner of a bare ring: along a corridor 45 beams constrain nothing."""
    ring = np.array([*box(-13.0, -8.0, 13.0, 8.0), *box(-15.0, -10.0, 15.0, 10.0)])
    steps = [Pose2(0.08, 0.0, 0.0)] * 168 + [Pose2(0.08, 0.0, -0.08)] * 20
    slam, lidar, rng = default(), laser(45), np.random.default_rng(2)
    at, wheels = Pose2(0.0, 9.0, 0.0), IDENTITY
    off = []
    for i, step in enumerate([IDENTITY, *steps, *[Pose2(0.08, 0.0, 0.0)] * 90]):
        at, wheels = at @ step, wheels @ Pose2(1.005 * step.x, 0.0, 1.01 * step.theta)
        scan = scan_at(at, lidar, ring, noise=0.01, rng=rng, t=0.1 * i, odometry=wheels)
        found = slam.update(scan)
        off.append(math.hypot(found.x - at.x, found.y + 9.0 - at.y))
    assert max(off) < 0.25


@pytest.mark.parametrize("refine", [True, False])
def test_without_refinement_the_match_is_that_of_icp(refine, monkeypatch):
    slam = settled(5, refine=refine)
    decided = calls(monkeypatch, slam._estimator, "decide")
    slam.update(still(5))
    matches = decided[0][1]
    assert all(match.coarse is not None for match in matches)
    assert (matches[0].pose == matches[0].coarse) == (not refine)


def test_the_window_of_ransac_is_that_of_the_parameters(monkeypatch):
    slam, rules = settled(5), []
    monkeypatch.setattr("tsd.registration.try_pairs", lambda *args: rules.append(args[6]))
    assert slam._registration.ransac(slam._scan, FAR) == FAR
    assert rules[0].max_distance == pytest.approx(0.6)
    assert rules[0].min_cosine == pytest.approx(math.cos(0.6))


def test_the_gate_of_a_noisy_laser_is_wider(monkeypatch):
    slam, rules = settled(5), []
    monkeypatch.setattr("tsd.registration.icp", lambda *args: rules.append(args[5]) or (0, 0, 0))
    for noise in (0.01, 0.03):
        monkeypatch.setattr(type(slam._scan), "noise", noise)
        slam._registration.icp(slam._scan, IDENTITY, NOTHING)
    assert [rule.min_gate for rule in rules] == pytest.approx([0.05, 0.09])


@pytest.mark.parametrize("fov", [1.5 * math.pi, 2.0 * math.pi * 720 / 721])
def test_the_rays_of_a_model_scan_fill_the_field_of_view(fov):
    slam, lidar = default(), laser(721, fov=fov)
    fan = slam._registration._fan(lidar)
    last = fan.first + (fan.rays - 1) * fan.gap
    assert fan.rays == 90 and fan.first + last == pytest.approx(0.0)
    full = fov > 1.6 * math.pi
    assert last - fan.first == pytest.approx(2.0 * math.pi * 89 / 90 if full else fov)
    assert fan.per_circle == (90 if full else 0)
    assert fan.reach == 30.0
    far = slam._registration._fan(laser(721, fov=fov, range_max=200.0))
    assert far.reach == slam.params.max_range > 30.0
