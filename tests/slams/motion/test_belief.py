"""The covariance of a pose from scan to scan: kernels against the same algebra by numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slams.motion import belief_kernels as kernels
from slams.motion.chord import Chord, covariance
from slams.types import Pose2

X, Y = math.cos(0.7), math.sin(0.7)
A = np.array((X, Y, 0.0))
STEP, VARIANCE, HEADING = Pose2(0.3, -0.05, 0.2), Chord(0.01, 0.002, 0.03), 1.1
LEAST = kernels.LEAST * np.eye(3)


def _positive(seed: int) -> np.ndarray:
    root = np.random.default_rng(seed).normal(size=(3, 3))
    return root @ root.T + 0.1 * np.eye(3)


def _carried(before: np.ndarray) -> np.ndarray:
    c, s = math.cos(HEADING), math.sin(HEADING)
    x, y = c * STEP.x - s * STEP.y, s * STEP.x + c * STEP.y
    swing = np.array(((1.0, 0.0, -y), (0.0, 1.0, x), (0.0, 0.0, 1.0)))
    return swing @ before @ swing.T + covariance(Pose2(x, y, STEP.theta), VARIANCE, HEADING)


@pytest.mark.parametrize("seed", range(3))
def test_a_direction_is_read_raised_and_stretched_as_by_numpy(seed):
    M = _positive(seed)
    assert kernels.along(M, X, Y) == pytest.approx(A @ M @ A)
    assert kernels.raised(M, X, Y, 0.4) == pytest.approx(M + 0.4 * np.outer(A, A))
    S = np.eye(3) + (0.3 - 1.0) * np.outer(A, A)
    assert kernels.stretched(M, X, Y, 0.3) == pytest.approx(S @ M @ S)
    assert np.array_equal(kernels.stretched(M, X, Y, 1.0), M)


@pytest.mark.parametrize("scale", [1.0, 4.0])
@pytest.mark.parametrize("same", [0.0, 1.0])
def test_a_prediction_is_the_pose_before_swung_by_the_step_and_as_wide_as_was_learned(same, scale):
    M, blind, caution = _positive(0), 0.6, 1.7
    before = M
    if same:
        both = _carried(np.zeros((3, 3)))
        before = M + 2.0 * blind * math.sqrt((A @ M @ A) * (A @ both @ A)) * np.outer(A, A)
    S = np.eye(3) + (scale ** (-0.5 * blind) - 1.0) * np.outer(A, A)
    predicted = S @ (scale * _carried(before)) @ S
    sees, learned = (X, Y, blind), (same, scale, caution)
    found = kernels.foreseen(M, HEADING, tuple(STEP), tuple(VARIANCE), sees, learned)
    assert found[0] == pytest.approx(predicted)
    assert found[1] == pytest.approx(caution * predicted)
    assert found[2] == pytest.approx(np.linalg.inv(caution * predicted))


def test_a_match_alone_and_with_the_prediction_add_their_informations():
    honest, known, off = _positive(0), _positive(1), np.array((0.2, -0.1, 0.05))
    prior = np.linalg.inv(np.linalg.inv(known) + np.outer(off, off))
    alone, both, even = kernels.settled(honest, known, off)
    assert alone == pytest.approx(np.linalg.inv(honest + LEAST))
    assert both == pytest.approx(np.linalg.inv(honest + prior))
    assert even == pytest.approx(kernels.evenness(alone))
    expected = off + np.linalg.inv(honest + LEAST) @ known @ off
    assert kernels.by_scan(honest, known, off) == pytest.approx(expected)
    square = off @ np.linalg.inv(honest + known) @ off
    assert kernels.surprise(honest, known, off) == pytest.approx(square)


def test_a_match_is_held_back_by_what_it_claims_beyond_its_worth():
    seen, known, off = _positive(2), _positive(1), np.array((0.2, -0.1, 0.05))
    prior = np.linalg.inv(np.linalg.inv(known) + np.outer(off, off))
    k, claimed, worth = A @ prior @ A, A @ seen @ A, 0.25 * (A @ seen @ A)
    by_scan = (claimed + k) / claimed  # where the scan alone has it, times the way
    keep = worth / (worth + k) * by_scan  # fused once more by its worth
    honest = kernels.stretched(seen, X, Y, 0.5)
    moved = kernels.held_back(seen, honest, known, off, X, Y)
    assert moved == pytest.approx((keep - 1.0) * (A @ off))
    assert kernels.held_back(seen, seen, known, off, X, Y) == 0.0
