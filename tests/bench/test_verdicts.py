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


def rising(names, logs):
    """Each algorithm a millimeter worse than the one before, on every log."""
    return {
        name: {f"l{k}": 1e-3 * (1 + more) * (1.0 + 0.01 * k) for k in range(logs)}
        for more, name in enumerate(names)
    }


def test_too_few_logs_say_that_they_cannot_show_it():
    (line,) = translation(rising("ab", 5))
    assert "a and b can't be distinguished over 5 logs: " in line["sentence"]
    words = "; 5 logs cannot show it: the least p among 2 comparisons is 0.12"
    assert line["sentence"].endswith(words) and line["p_value"] == 2 * 2 / 2**5
    (line,) = translation(rising("ab", 8))
    assert line["sentence"].startswith("translation: a is better than b over 8 logs by 1.0")
    assert "cannot show" not in line["sentence"]
    for line in translation(rising("abcd", 8)):
        assert "8 logs cannot show it: the least p among 12 comparisons" in line["sentence"]


def test_a_pair_on_fewer_logs_is_judged_by_its_own():
    """Many comparisons on 13 logs come first; that one on 7 can still be shown."""
    means = rising("abc", 13)
    means["c"] = {log: means["c"][log] for log in list(means["c"])[:7]}
    words = {line["n"]: line["sentence"] for line in translation(means)}
    assert "cannot show" not in words[13]
    assert "7 logs cannot show it: the least p among 4 comparisons is 0.062" in words[7]


def test_noise_and_rounding_prove_nothing():
    found = verdicts.on_one_log([outcome("a"), outcome("b", seed=1), outcome("c", 0.001 + 5e-10)])
    assert all("can't be distinguished on this log: " in line["sentence"] for line in found)
