"""When a run was lost, by the truth and by relations."""

import numpy as np
import pytest

from bench.judge import loss
from bench.judge.metrics import Common, RelationErrors


def test_it_is_lost_where_it_first_was_and_after_the_way_until_there():
    n = 50
    truth = np.column_stack([0.5 * np.arange(n), np.zeros((n, 2))])
    estimate = truth.copy()
    estimate[20:25, 1] = 9.0
    found = loss.by_truth(Common(np.arange(n) + 7.0, estimate, truth, 0))
    assert (found["at_s"], found["after_m"]) == (20.0, 10.0)
    assert found["completed"] == pytest.approx(0.9)


def test_the_words_name_the_limits(monkeypatch):
    monkeypatch.setattr(loss, "LIMIT_M", 7.25)
    assert loss.words().startswith("off by more than 7.25 m or 0")


def test_relations_are_asked_in_the_order_of_their_stamps():
    t = np.arange(100.0)[::-1].copy()
    translation = np.where((t == 30.0) | (t == 60.0), 2.0, 0.01)
    errors = RelationErrors(t, translation, np.zeros(100), np.zeros(100, bool), 100)
    assert loss.by_relations(errors, 10.0)["at_s"] == 20.0
