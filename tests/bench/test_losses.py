"""When a run was lost, by the truth and by relations; p-values that rounding does not change."""

import numpy as np
import pytest

from bench.judge import loss
from bench.judge.metrics import Common, RelationErrors
from bench.judge.statistics import _sign_flips, least_p_value


def test_the_limit_grows_with_the_way():
    n = 101
    truth = np.column_stack([np.arange(n), np.zeros((n, 2))])
    for off in (3.4, 6.5):
        estimate = truth.copy()
        estimate[:, 1] += np.where(np.arange(n) <= 40, 0.0, 1.0) * off * np.arange(n) / 100.0
        found = loss.by_truth(Common(np.arange(n) + 7.0, estimate, truth, 0))
        share = off / 100.0  # of the distance; half a meter and 5 % of it are allowed
        beyond = (np.arange(n) > 40) & (share * np.arange(n) > 0.5 + 0.05 * np.arange(n))
        assert found["lost"] == bool(beyond.any())
        assert found["completed"] == pytest.approx(1.0 - beyond.mean())


def test_it_is_lost_where_it_first_was_and_after_the_way_until_there():
    n = 50
    truth = np.column_stack([0.5 * np.arange(n), np.zeros((n, 2))])
    estimate = truth.copy()
    estimate[20:25, 1] = 9.0
    found = loss.by_truth(Common(np.arange(n) + 7.0, estimate, truth, 0))
    assert (found["at_s"], found["after_m"]) == (20.0, 10.0)
    assert found["completed"] == pytest.approx(0.9)


def test_limits_are_of_the_distance_and_the_turn_apart():
    truth = np.zeros((5, 3))
    estimate = truth.copy()
    estimate[1:, :] = [(0.4, 0.0, 0.0), (0.4, 0.4, 0.0), (0.0, 0.0, -0.31), (0.0, 0.0, 6.2)]
    common = Common(np.arange(5.0), estimate, truth, 0)
    assert loss.limits_exceeded(common).tolist() == [False, False, True, True, False]


def test_a_relation_may_be_off_by_what_both_of_its_poses_may():
    for translation, rotation, broken in ((0.99, 0.59, 0), (1.01, 0.0, 100), (0.0, 0.61, 100)):
        off = np.full(100, translation), np.full(100, rotation)
        errors = RelationErrors(np.arange(100.0), *off, np.zeros(100, bool), 100)
        assert loss.by_relations(errors, 0.0)["broken"] == broken


def test_the_words_name_the_limits(monkeypatch):
    monkeypatch.setattr(loss, "LIMIT_M", 7.25)
    assert loss.words().startswith("off by more than 7.25 m and 5% of the distance driven, or by 0")


def test_relations_are_asked_in_the_order_of_their_stamps():
    t = np.arange(100.0)[::-1].copy()
    translation = np.where((t == 30.0) | (t == 60.0), 2.0, 0.01)
    errors = RelationErrors(t, translation, np.zeros(100), np.zeros(100, bool), 100)
    assert loss.by_relations(errors, 10.0)["at_s"] == 20.0


@pytest.mark.parametrize("n", [5, 9, 13])
def test_rounding_makes_no_sum_of_signs_less_than_it_is(n):
    for seed in range(40):
        differences = np.random.default_rng(seed).uniform(0.1, 1.0, n)
        assert _sign_flips(differences, 0) == least_p_value(n)
