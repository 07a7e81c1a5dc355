"""The bound of a filter against a filter that runs on what the simulator's wheels and gyro read."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

from bench.judge import filter_bound, metrics
from bench.judge.bound import bound_of
from bench.judge.filter_bound import filter_spans, filtered
from bench.sim.drive import Drive
from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from bench.sim.wheels import gyro, odometry, steps
from slams.metrics import pair_errors
from slams.scanlog import Track
from slams.types import wrap_angle

DRIVES = 150
VAGUE = 10.0  # m and rad, of a motion that nothing is known of


@cache
def case(**changes):
    """A short log of few beams, the bound of its scans, and its truth as if it were a run."""
    log = simulate(dataclasses.replace(Setting(size=8.0, duration=12.0), **changes))
    truth = log.truth_at(log.t)
    return log, bound_of(log), metrics.common(log.t, truth, truth)


class Plain:
    """A Kalman filter by the book: state x, y, theta, six errors, and the motion under way."""

    def __init__(self, log, poses):
        stamps, values = log.truth.in_order
        fine = np.column_stack([values[:, :2], np.unwrap(values[:, 2])])
        rates = np.gradient(fine[:, 2], stamps)
        self.true = Drive(stamps, fine, np.column_stack([rates, rates]))
        self.log, self.poses = log, poses
        size = [1e3] * 3 + [0.01, 0.03, 0.01, 0.03, 0.002, 0.003, VAGUE, VAGUE]
        self.P = np.diag(np.square(size))
        self.x = np.zeros((DRIVES, 11))
        self.x[:, :3] = poses[0]

    def update(self, H, R, innovation):
        """The textbook's, Joseph's form; innovations (DRIVES, m) of all drives at once."""
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + R)
        kept = np.eye(11) - K @ H
        self.P = kept @ self.P @ kept.T + K @ R @ K.T
        self.x += innovation @ K.T

    def fix(self, covariance, pose, rng):
        noise = rng.standard_normal((DRIVES, 3)) @ np.linalg.cholesky(covariance).T
        innovation = pose + noise - self.x[:, :3]
        innovation[:, 2] = wrap_angle(innovation[:, 2])
        self.update(np.eye(11)[:3], covariance, innovation)

    def readings(self, rng):
        """Of every drive, from scan to scan: ahead, aside, turn, and the turn by the gyro."""
        odom, rate = self.log.odom.t, self.log.yaw_rate.t
        read = []
        for _ in range(DRIVES):
            wheels = Track(odom, odometry(self.true, odom, rng)).poses_at(self.log.t)
            wheels[:, 2] = np.unwrap(wheels[:, 2])
            yaw = Track(rate, gyro(self.true, rate, rng)).integral_at(self.log.t)
            read.append([*steps(wheels), np.diff(yaw)])
        return np.array(read)

    def reading(self, k):
        """What ahead, turn and turn by the gyro between scans k and k + 1 are of, their noise."""
        seconds = self.log.t[k + 1] - self.log.t[k]
        ahead, _, turn = (float(v[0]) for v in steps(self.poses[k : k + 2]))
        way, turned = abs(ahead), abs(turn)
        H = np.zeros((3, 11))
        H[0, [3, 9]] = ahead, 1.0
        H[1, [4, 5, 6, 10]] = turn, way, turn, 1.0
        H[2, [7, 8, 10]] = seconds, turn, 1.0
        R = 1e-14 * np.eye(3)
        R[0, 0] += 0.003**2 * way + 0.002**2 * turned
        R[1, 1] += 0.004**2 * way + 0.01**2 * turned
        R[0, 1] = R[1, 0] = 0.002 * 0.01 * turned
        R[2, 2] += 0.004**2 * 0.01 * seconds
        return H, R

    def transition(self, k):
        """How an error goes on from scan k to k + 1, and what comes to it."""
        seconds = self.log.t[k + 1] - self.log.t[k]
        before, after = self.poses[k : k + 2]
        keep = math.exp(-seconds / 20.0)
        F, heading = np.eye(11), 0.5 * (before[2] + after[2])
        dx, dy, _ = after - before
        F[:3, 2] = -dy, dx, 1.0
        F[:3, 9] = math.cos(heading), math.sin(heading), 0.0
        F[:3, 10] = -0.5 * dy, 0.5 * dx, 1.0
        F[6, 6] = keep
        Q = np.zeros((11, 11))
        Q[6, 6], Q[7, 7] = 0.03**2 * (1.0 - keep**2), 1e-8 * seconds
        return F, Q

    def motion(self, k, read):
        """Take wheels and gyro between scans k and k + 1 in, and move on."""
        H, R = self.reading(k)
        self.x[:, 9:] = 0.0
        self.P = anew(self.P)
        self.update(H, R, read[:, [0, 2, 3]] - self.x @ H.T)
        F, Q = self.transition(k)
        self.P = F @ self.P @ F.T + Q
        self.move(read[:, 1], F[6, 6])

    def move(self, aside, keep):
        a, w = self.x[:, 9], self.x[:, 10]
        half = self.x[:, 2] + 0.5 * w
        self.x[:, 0] += np.cos(half) * a - np.sin(half) * aside
        self.x[:, 1] += np.sin(half) * a + np.cos(half) * aside
        self.x[:, 2] += w
        self.x[:, 6] *= keep


def anew(P):
    """A motion that nothing is known of yet."""
    P = P.copy()
    P[9:11], P[:, 9:11] = 0.0, 0.0
    P[[9, 10], [9, 10]] = VAGUE**2
    return P


@cache
def by_chance(**changes):
    """Mean errors over each span of the plain filter, on what many robots read on one drive."""
    log, limit, truth = case(**changes)
    poses = limit.poses.copy()
    poses[:, 2] = np.unwrap(poses[:, 2])
    rng = np.random.default_rng(1)
    plain = Plain(log, poses)
    read = plain.readings(rng)
    track = np.empty((DRIVES, len(poses), 3))
    for k in range(len(poses)):
        plain.fix(limit.covariance[k], poses[k], rng)
        track[:, k] = plain.x[:, :3]
        if k + 1 < len(poses):
            plain.motion(k, read[:, :, k])
    found = {}
    for span in metrics.SPANS:
        first, second = metrics.pairs(truth, span)
        if len(first):
            errors = [pair_errors(one, poses, first, second) for one in track]
            found[span.name] = np.mean(errors, axis=(0, 2))
    return found


@pytest.mark.parametrize("sensor", ["utm30lx", "lds01"])
def test_a_filter_on_real_readings_reaches_the_bound(sensor):
    """At worst 4 % less per update: readings are interpolated, with less noise than white slip."""
    found = filter_spans(*case(sensor=sensor))
    chance = by_chance(sensor=sensor)
    assert found.keys() == chance.keys() and len(found) >= 4
    for name, (translation, rotation) in chance.items():
        assert translation == pytest.approx(found[name]["translation_m"], rel=0.06), name
        assert rotation == pytest.approx(found[name]["rotation_rad"], rel=0.06), name


@pytest.mark.parametrize("with_gyro", [True, False])
def test_pairs_of_poses_against_a_filter_that_keeps_a_copy_of_the_first(with_gyro):
    """Few fixes, so that all that drifts counts: the copy is three more states."""
    log, limit, _ = case()
    information = np.zeros_like(limit.information)
    information[::90] = limit.information[::90]
    few = dataclasses.replace(limit, information=information)
    given = log if with_gyro else dataclasses.replace(log, yaw_rate=None)
    found = filtered(given, few, np.arange(len(log)))
    plain, first, last = Plain(log, found.poses), 100, 440
    rows = slice(None) if with_gyro else slice(2)
    P = np.zeros((14, 14))
    P[:11, :11] = plain.P
    for k in range(last + 1):
        if k % 90 == 0:
            P = seen(P, np.eye(3), limit.covariance[k])
        if k == first:
            P[:, 11:] = P[:, :3]
            P[11:] = P[:3]
        if k == last:
            break
        H, R = plain.reading(k)
        P[:11, :11], P[9:11, 11:], P[11:, 9:11] = anew(P[:11, :11]), 0.0, 0.0
        P = seen(P, H[rows], R[rows, rows])
        F, Q = np.eye(14), np.zeros((14, 14))
        F[:11, :11], Q[:11, :11] = plain.transition(k)
        P = F @ P @ F.T + Q
    across = filter_bound._between(found.steps, np.array([first]), np.array([last]))[0]
    scale = np.sqrt(np.outer(np.diag(P)[:3], np.diag(P)[:3]))
    assert found.covariance[last, :3, :3] / scale == pytest.approx(P[:3, :3] / scale, abs=3e-3)
    across = (across @ found.covariance[first])[:3, :3]
    assert across / scale == pytest.approx(P[:3, 11:] / scale, abs=3e-3)


def seen(P, H, R):
    """The covariance after a measurement of the first columns of H."""
    H = np.pad(H, ((0, 0), (0, len(P) - H.shape[1])))
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    kept = np.eye(len(P)) - K @ H
    return kept @ P @ kept.T + K @ R @ K.T


def two_fixes(limit, truth, span):
    expected = limit.pairs(*metrics.pairs(truth, span))
    return expected.translation.mean(), expected.rotation.mean()


def test_every_sensor_more_makes_the_bound_smaller():
    log, limit, truth = case()
    wheels = filter_spans(dataclasses.replace(log, yaw_rate=None), limit, truth)
    both = filter_spans(log, limit, truth)
    for span in metrics.SPANS:
        fixes = two_fixes(limit, truth, span)
        for key, alone in zip(("translation_m", "rotation_rad"), fixes, strict=True):
            assert both[span.name][key] < wheels[span.name][key] < alone
    assert both["1 s"]["translation_m"] < 0.6 * two_fixes(limit, truth, metrics.SPANS[2])[0]


def test_blind_wheels_lose_the_heading_as_their_errors_say():
    """After one fix alone: slip, the errors of the whole drive, and the floor's as a double sum."""
    log, limit, _ = case()
    once = np.zeros_like(limit.information)
    once[0] = limit.information[0]
    blind = dataclasses.replace(limit, information=once)
    alone = dataclasses.replace(log, yaw_rate=None)
    found = filtered(alone, blind, np.arange(len(log))).covariance[-1, 2, 2]
    turn = np.diff(np.unwrap(limit.poses[:, 2]))
    way = np.hypot(*np.diff(limit.poses[:, :2], axis=0).T).sum()
    memory = np.exp(-np.abs(log.t[1:, None] - log.t[1:]) / 20.0)
    expected = (
        limit.covariance[0, 2, 2]
        + 0.004**2 * way
        + 0.01**2 * np.abs(turn).sum()
        + (0.03 * turn.sum()) ** 2
        + (0.01 * way) ** 2
        + 0.03**2 * turn @ memory @ turn
    )
    assert found == pytest.approx(expected, rel=0.01)


def test_an_open_scan_still_tells_what_it_tells():
    """A corridor's scans fix all but the way along, here y: the wheels carry that on."""
    log, limit, _ = case()
    corridor = np.diag([1.0, 0.0, 1.0])
    kinds = {"all": np.eye(3), "corridor": corridor, "blind": np.zeros((3, 3))}
    some = np.zeros(len(log), bool)
    some[200:280] = True
    errors = {}
    for kind, seen in kinds.items():
        information = np.where(some[:, None, None], seen @ limit.information @ seen, 0.0)
        information[~some] = limit.information[~some]
        open_there = dataclasses.replace(limit, information=information)
        found = filtered(log, open_there, np.arange(len(log)))
        assert np.isfinite(found.covariance).all()
        errors[kind] = math.sqrt(np.trace(found.covariance[279, :2, :2]))
    assert errors["all"] < 0.5 * errors["corridor"]
    assert errors["corridor"] < 0.5 * errors["blind"]


def test_steps_between_poses_are_their_product():
    rng = np.random.default_rng(4)
    steps = np.eye(9) + 0.1 * rng.standard_normal((40, 9, 9))
    first, second = np.array([0, 3, 5, 0, 7]), np.array([0, 4, 18, 40, 38])
    for k, product in enumerate(filter_bound._between(steps, first, second)):
        naive = np.eye(9)
        for step in steps[first[k] : second[k]]:
            naive = step @ naive
        assert product == pytest.approx(naive, rel=1e-9)


def test_a_log_that_covers_part_of_the_truth_or_skips_scans():
    log, limit, truth = case()
    half = log.select(every=2)
    seen = half.truth_at(half.t)
    found = filter_spans(half, bound_of(half), metrics.common(half.t, seen, seen))
    whole = filter_spans(log, limit, truth)
    assert whole["1 s"]["translation_m"] < found["1 s"]["translation_m"]
    assert found["1 s"]["translation_m"] < 1.3 * whole["1 s"]["translation_m"]
    short = Track(log.truth.t[log.truth.t <= 6.0], log.truth.values[log.truth.t <= 6.0])
    less = dataclasses.replace(log, truth=short)
    seen = less.truth_at(less.t)
    assert filter_spans(less, bound_of(less), metrics.common(less.t, seen, seen))["1 s"]


def test_what_was_not_simulated_or_has_no_wheels_has_no_bound():
    log, limit, truth = case()
    assert filter_spans(log.select(odometry=False), limit, truth) is None
    assert filter_spans(dataclasses.replace(log, meta={}), limit, truth) is None
    assert filter_spans(dataclasses.replace(log, truth=None), limit, truth) is None
