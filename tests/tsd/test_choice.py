"""tsd: what poses are believed, and when others are looked for."""

import copy
import math

import numpy as np
import pytest

from slams.types import IDENTITY, Pose2
from tests.rooms import box, drive, laser, scan_at
from tests.tsd.cases import (
    default,
    error,
    scanned,
)
from tsd.evidence import GAIN, Match
from tsd.map_kernels import (
    facing,
    read_field,
)
from tsd.match_kernels import explain


def test_kidnapped_within_view():
    rng = np.random.default_rng(5)
    lidar = laser(361)
    recovered = 0
    for _ in range(200):
        start = np.array([*rng.uniform((-1.5, -1.0), (1.5, 1.0)), rng.uniform(-3, 3)])
        slam = default()
        for i in range(3):
            slam.update(scan_at(start, lidar, noise=0.01, rng=rng, t=0.05 * i))
        radius, side = 0.5 * math.sqrt(rng.random()), rng.uniform(-np.pi, np.pi)
        jump = Pose2(
            radius * math.cos(side), radius * math.sin(side), rng.uniform(-1, 1) * math.radians(30)
        )
        moved = Pose2(*start) @ jump
        for i in range(3):
            found = slam.update(scan_at(moved, lidar, noise=0.01, rng=rng, t=0.2 + 0.05 * i))
        distance, turn = error(jump, found)
        recovered += distance < 0.02 and turn < 0.01
    assert recovered >= 190


def test_a_scan_that_fits_nowhere_is_refused_and_not_pushed():
    slam = default()
    for i in range(5):
        slam.update(scan_at((0.0, 0.0, 0.0), t=0.1 * i))
    before = slam.report()["pushed"]
    elsewhere = np.array(box(-0.6, -0.7, 0.4, 0.9))
    pose = slam.update(scan_at((0.0, 0.0, 0.2), segments=elsewhere, t=0.6))
    assert error(IDENTITY, pose)[0] < 0.05
    report = slam.report()
    assert (report["rejected"], report["lost"], report["pushed"]) == (1, 0, before)
    assert slam.state == "predicted"
    slam.update(scan_at((0.0, 0.0, 0.0), t=0.7))
    assert slam.report()["recovered"] == 1


def test_no_other_pose_is_taken_for_what_noise_prefers():
    slam, _ = scanned()
    evidence, pose = slam._evidence, slam._track.pose
    base = evidence.weigh(pose, np.zeros((3, 3)))
    for off, more, wins in ((0.02, 1.0, False), (0.2, 1.0, True), (0.2, 0.5 * GAIN, False)):
        other = base._replace(pose=pose @ Pose2(off, 0.0, 0.0), worth=base.worth + more)
        assert (evidence.best([base, other]) is other) == wins


def test_evidence_counts_what_is_explained_and_what_is_contradicted():
    slam, elements = scanned()
    evidence, pose = slam._evidence, slam._track.pose
    there = evidence.weigh(pose, np.zeros((3, 3)))
    assert there.close > 0.9 and there.known > 0.9
    values = []
    for x, y, nx, ny, *_ in elements:
        p = pose.transform(np.array([[x, y]]))[0]
        n = Pose2(0.0, 0.0, pose.theta).transform(np.array([[nx, ny]]))[0]
        values.append(read_field(slam._field.kernel, facing(*n), *p)[0])
    known = np.array(values)[np.isfinite(values)]
    assert there.known == pytest.approx(len(known) / len(elements))
    robust = evidence.robust
    assert there.close * len(elements) == pytest.approx((1 / (1 + (known / robust) ** 2)).sum())
    kernel, at = slam._field.kernel, np.array(pose @ Pose2(0.5, 0.4, 0.3))
    known, close, against, _ = explain(kernel, elements, len(elements), at, robust)
    assert against > 0.2 * len(elements)
    off = evidence.weigh(Pose2(*at), np.zeros((3, 3)))
    assert off.worth < (close - 0.4 * against) / len(elements)


def test_what_is_usual_falls_faster_when_nothing_better_was_found():
    slam, _ = scanned()
    evidence = slam._evidence
    poor = Match(IDENTITY, 1.0, 0.5, 0.5, 0.01, np.zeros((3, 3)))
    for k in range(100):
        evidence.learn(poor._replace(close=0.7), searched=False, t=0.1 * k)
    usual, falls = evidence.usual.value, []
    for searched in (False, True):
        after = copy.deepcopy(evidence.usual)
        evidence.usual, kept = after, evidence.usual
        evidence.learn(poor, searched, t=10.0)
        falls.append(usual - after.value)
        evidence.usual = kept
    assert falls == pytest.approx([0.2 * (1.0 - math.exp(-0.1)), 0.1], rel=1e-3)


def test_a_noisy_laser_is_followed_without_searching():
    log = drive(n=60, lidar=laser(721), noise=0.05, odometry=False, gyro=False)
    truth, slam = log.truth_at(log.t), default()
    for p, scan in zip(truth, log, strict=True):
        assert error(Pose2(*truth[0]).between(Pose2(*p)), slam.update(scan))[0] < 0.06
    report = slam.report()
    assert report["searched"] + report["rejected"] + report["lost"] == 0


def test_a_fruitless_search_rests_longer_each_time_and_success_ends_that():
    slam, _ = scanned()
    search, evidence = slam._search, slam._evidence
    poor = Match(IDENTITY, 0.1, 0.05, 0.0, 0.1, np.zeros((3, 3)))
    fine = Match(IDENTITY, 1.0, 1.0, 1.0, 0.01, np.zeros((3, 3)))
    assert evidence.as_usual(fine) and not evidence.as_usual(poor)
    tried = []
    for i in range(200):
        search.begin(0.025)
        wanted = search.wanted(poor, 1.0)
        search.end(poor, wanted, better=False)
        tried += [i] if wanted else []
    assert np.diff(tried).tolist() == sorted(np.diff(tried)) and 5 <= len(tried) <= 9
    search.end(fine, searched=True, better=True)
    search.begin(0.025)
    assert search.wanted(poor, 1.0) and search.wanted(poor, 2.0)
    assert not search.wanted(fine, 2.0)


def test_what_may_be_chance_is_no_reason_to_search_where_the_prediction_is_sure():
    slam, _ = scanned()
    evidence, track = slam._evidence, slam._track
    evidence.usual.value = 0.7
    chance = math.sqrt(0.7 * 0.3 / slam._view.count)
    for less, sure, usual in (
        (0.015, False, True),
        (1.8 * chance, True, True),
        (1.8 * chance, False, False),
        (2.2 * chance, True, False),
    ):
        track.expected = np.diag([(0.02 if sure else 0.2) ** 2, 1e-6, 1e-6])
        match = Match(IDENTITY, 0.8, 0.7 - less, 0.5, 0.01, np.zeros((3, 3)))
        assert evidence.as_usual(match) == usual, (less, sure)
