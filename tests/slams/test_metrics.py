import numpy as np
import pytest

from bench.judge import metrics as bench_metrics
from bench.judge.metrics import Common
from slams import metrics
from slams.types import Pose2
from tests.rooms import moved

UPDATE = bench_metrics.SPANS[0]


def walk(n=200, seed=0):
    rng = np.random.default_rng(seed)
    pose, poses = Pose2(2.0, -1.0, 0.4), []
    for _ in range(n):
        poses.append(pose)
        pose = pose @ Pose2(0.1, 0.0, float(rng.normal(0.0, 0.1)))
    return np.array(poses)


def test_component_errors_by_hand():
    truth = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 3.1]])
    estimate = np.array([[0.0, 0.0, 0.0], [1.3, 0.4, -3.1]])
    found = bench_metrics.span_errors(Common(np.arange(2.0), estimate, truth, 0), UPDATE)
    assert found.translation == pytest.approx([0.5])
    assert found.orientation == pytest.approx([2.0 * np.pi - 6.2])


def test_relative_errors_need_no_common_frame_and_component_errors_do():
    truth, rng = walk(), np.random.default_rng(1)
    estimate = truth + rng.normal(0.0, [0.01, 0.01, 0.005], truth.shape)
    turned = moved(Pose2(5.0, 6.0, 0.3), estimate)
    for lag in (7, 1):
        steps = np.arange(len(truth) - lag), np.arange(lag, len(truth))
        a, b = metrics.pair_errors(estimate, truth, *steps)
        c, d = metrics.pair_errors(turned, truth, *steps)
        assert c == pytest.approx(a, abs=1e-12)
        assert d == pytest.approx(b, abs=1e-12)
    same = bench_metrics.component_errors(estimate, truth, *steps)[0].mean()
    other = bench_metrics.component_errors(turned, truth, *steps)[0].mean()
    assert other > 1.5 * same


def test_pairs_over_time_do_not_depend_on_the_rate_and_those_over_none_are_updates():
    fast, slow = np.arange(400) / 40.0, np.arange(50) / 5.0
    for t, span, step in ((fast, 1.0, 40), (slow, 1.0, 5), (slow, 0.0, 1)):
        first, second = metrics.pairs_over_time(t, span)
        assert len(first) == len(t) - step
        assert set(second - first) == {step}
    assert len(metrics.pairs_over_time(slow, 0.1)[0]) == 0, "5 Hz has no poses 0.1 s apart"
    assert len(metrics.pairs_over_time(fast[:1], 1.0)[0]) == 0


def test_pairs_over_time_follow_stamps_where_scans_are_missing_or_out_of_order():
    t = np.array([0.0, 0.1, 0.3, 0.2, 0.4, 0.9, 1.0])
    first, second = metrics.pairs_over_time(t, 0.1)
    found = sorted(zip(t[first], t[second], strict=True))
    assert found == [(0.0, 0.1), (0.1, 0.2), (0.2, 0.3), (0.3, 0.4), (0.9, 1.0)]


def test_pairs_over_path_wait_for_the_path():
    poses = np.zeros((6, 3))
    poses[:, 0] = [0.0, 0.4, 0.4, 0.8, 1.2, 1.4]
    first, second = bench_metrics.pairs_over_path(poses, 1.0)
    assert first.tolist() == [0, 1, 2]
    assert second.tolist() == [4, 5, 5]


def test_frames_are_made_common_by_the_first_pose_with_a_truth():
    truth = walk(20)
    estimate = metrics.from_first(truth)
    truth[[0, 7]] = np.nan
    seen = bench_metrics.common(np.arange(20.0), estimate, truth)
    assert (seen.dropped, len(seen.t)) == (2, 18)
    errors = bench_metrics.span_errors(seen, UPDATE)
    assert len(errors.t) == 17
    assert errors.translation == pytest.approx(0.0, abs=1e-12)
    assert errors.orientation == pytest.approx(0.0, abs=1e-12)
    nothing = bench_metrics.common(np.arange(20.0), estimate, np.full((20, 3), np.nan))
    assert (len(nothing.t), nothing.dropped) == (0, 20)
    assert bench_metrics.span_errors(nothing, UPDATE) is None


def test_relations_by_hand():
    t = np.array([0.0, 30.0, 1.0])  # a stamp that jumps back
    poses = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, np.pi / 2], [1.0, 0.0, 0.0]])
    relations = np.array(
        [
            [0.0, 1.0, 1.0, 0.0, 0.0],  # right
            [1.0, 30.0, 1.0, 0.3, 1.5],  # 0.3 m and pi/2 - 1.5 off
            [0.0, 5.0, 1.0, 0.0, 0.0],  # no such stamp
        ]
    )
    found = bench_metrics.relation_errors(t, poses, relations)
    assert found.translation == pytest.approx([0.0, 0.3])
    assert found.rotation == pytest.approx([0.0, np.pi / 2 - 1.5])
    assert found.loop.tolist() == [False, True]
    assert found.t.tolist() == [1.0, 30.0]


def test_classes_share_out_all_values():
    shares = bench_metrics.class_shares(np.array([0.0, 0.02, 0.03, 0.9]), 0.025, 4)
    assert shares == pytest.approx([0.5, 0.25, 0.0, 0.25])
