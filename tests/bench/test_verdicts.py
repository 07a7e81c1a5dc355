"""Verdicts: whose errors are paired with whose, at which times."""

from types import SimpleNamespace

import numpy as np
import pytest

from bench.judge import verdicts
from bench.judge.metrics import SpanErrors

N = 200


def errors(mean, t=None, seed=0):
    t = np.arange(float(N)) if t is None else t
    values = mean + np.random.default_rng(seed).normal(0.0, 1e-4, N)[: len(t)]
    return SpanErrors(t, values, values, values)


def outcome(name, mean=0.001, log="l0", span="1 s", seed=0, **more):
    series = {} if mean is None else {span: errors(mean, seed=seed)}
    return SimpleNamespace(row={"algorithm": name, "log": log} | more, errors=series)


def test_pairs_come_in_the_order_of_their_errors_and_tell_who_is_next_to_whom():
    found = verdicts.on_one_log([outcome("c", 0.003), outcome("a", 0.001), outcome("b", 0.002)])
    pairs = [(line["a"], line["b"], line["next"]) for line in found]
    assert pairs[:3] == [("a", "b", True), ("a", "c", False), ("b", "c", True)]
    assert {line["measure"] for line in found} == {"translation", "rotation"}
    assert found[0]["sentence"].startswith("translation: a is better than b on this log")


def test_p_values_of_one_log_are_adjusted_for_all_its_pairs():
    rows = [outcome(name, 0.001 + 1e-5 * k, seed=k) for k, name in enumerate("abc")]
    for line in verdicts.on_one_log(rows):
        assert line["p_value"] >= line["p_alone"]
    assert any(line["p_value"] > line["p_alone"] for line in verdicts.on_one_log(rows))


def test_the_span_is_the_first_that_all_runs_have():
    rows = [outcome("a", span="10 s"), outcome("b", 0.002, span="10 s"), outcome("c", None)]
    assert {line["what"] for line in verdicts.on_one_log(rows)} == {"per 10 s"}
    assert verdicts.on_one_log([outcome("a"), outcome("b", span="10 s")]) == []
    assert verdicts.on_one_log([outcome("a"), outcome("c", None)]) == []


def test_series_are_compared_at_the_stamps_that_both_have():
    a, b = (
        verdicts.Series("a", found.t, found.orientation)
        for found in (errors(0.001), errors(0.002, t=np.arange(50.0, N)))
    )
    first, second = verdicts._shared(a, b)
    assert len(first) == len(second) == N - 50
    assert first == pytest.approx(a.values[50:])
    assert verdicts._shared(a, a)[0] is a.values


def translation(means):
    """The verdicts over logs from mean errors: algorithm to log to error."""
    runs = [outcome(a, mean, log) for a, of in means.items() for log, mean in of.items()]
    return [line for line in verdicts.over_logs(runs) if line["measure"] == "translation"]


def test_over_logs_only_those_that_both_ran_are_paired():
    means = {
        "a": {"l0": 0.001, "l1": 0.002, "l2": 0.003},
        "b": {"l1": 0.004, "l2": 0.005, "l3": 0.009},
    }
    (line,) = translation(means)
    assert (line["a"], line["b"], line["n"]) == ("a", "b", 2)
    assert line["difference"] == pytest.approx(-0.002)
    assert translation({"a": {"l0": 0.1}, "b": {"l0": 0.2, "l1": 0.3}}) == []


def test_too_few_logs_say_that_they_cannot_show_it():
    few = {name: {f"l{k}": m + 1e-4 * k for k in range(5)} for name, m in (("a", 0.1), ("b", 0.2))}
    (line,) = translation(few)
    assert line["sentence"].endswith(
        "5 logs cannot show it: the least p among 2 comparisons is 0.12"
    )
    many = {name: {f"l{k}": m + 1e-4 * k for k in range(8)} for name, m in (("a", 0.1), ("b", 0.2))}
    assert "cannot show" not in translation(many)[0]["sentence"]
