"""Verdicts, and measures without a truth, on drives whose poses are made worse."""

from types import SimpleNamespace

import numpy as np
import pytest

from bench.judge import consistency as judged
from bench.judge import verdicts
from bench.judge.metrics import SpanErrors
from bench.judge.registration import Reference, register
from tests.rooms import drive

N = 200


def errors(mean, t=None, seed=0):
    t = np.arange(float(N)) if t is None else t
    values = mean + np.random.default_rng(seed).normal(0.0, 1e-4, N)[: len(t)]
    return SpanErrors(t, values, values, values)


def outcome(name, mean=0.001, span="1 s", seed=0):
    series = {} if mean is None else {span: errors(mean, seed=seed)}
    return SimpleNamespace(row={"algorithm": name, "log": "same"}, errors=series)


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


def translation(means):
    """The verdicts over logs from mean errors: algorithm to log to error."""
    names = sorted({log for of in means.values() for log in of})
    runs = [[outcome(a, of[log]) for a, of in means.items() if log in of] for log in names]
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


def test_over_logs_too_few_cannot_show_what_more_do():
    (line,) = translation(rising("ab", 5))
    assert "a and b can't be distinguished over 5 logs: " in line["sentence"]
    assert line["p_value"] == 2 * 2 / 2**5, "of two comparisons"
    (line,) = translation(rising("ab", 8))
    assert line["sentence"].startswith("translation: a is better than b over 8 logs by 1.0")


def test_noise_and_rounding_prove_nothing():
    found = verdicts.on_one_log([outcome("a"), outcome("b", seed=1), outcome("c", 0.001 + 5e-10)])
    assert all("can't be distinguished on this log: " in line["sentence"] for line in found)


def square(n=200, side=4.0):
    along = np.linspace(-side / 2, side / 2, n)
    walls = [(along, np.full(n, side / 2)), (np.full(n, side / 2), -along)]
    walls += [(-along, np.full(n, -side / 2)), (np.full(n, -side / 2), along)]
    return np.concatenate([np.column_stack(wall) for wall in walls])


def test_registration_finds_how_far_a_scan_was_moved():
    target = Reference([square()])
    assert register(square(), target, np.zeros(2)) == pytest.approx(0.0, abs=1e-9)
    c, s = np.cos(0.03), np.sin(0.03)
    moved = square() @ np.array([[c, s], [-s, c]]) + (0.12, -0.16)
    assert register(moved, target, np.array([0.12, -0.16])) == pytest.approx(0.2, abs=1e-3)


def test_registration_says_where_it_cannot():
    wall = np.column_stack([np.linspace(-5.0, 5.0, 200), np.ones(200)])
    assert register(wall, Reference([wall]), np.zeros(2)) is None, "open along the wall"
    assert register(square() + 20.0, Reference([square()]), np.zeros(2)) == np.inf
    assert register(square(), Reference([]), np.zeros(2)) is None


def test_wall_area_counts_cells_with_two_returns():
    points = np.array([(0.01, 0.01), (0.02, 0.02), (0.06, 0.01), (-0.01, 0.01), (-0.02, 0.01)])
    assert judged.wall_area(points) == pytest.approx(2 * 0.05**2)
    assert judged.wall_area(points[:0]) == 0.0


def test_worse_poses_draw_more_wall_and_miss_their_revisits():
    log = drive(n=600)
    t, poses = 0.1 * np.arange(600), log.truth_at(log.t)
    there = np.concatenate([poses[::2], poses[::-1][::2]])  # and back the same way
    back = type(log)(t, np.concatenate([log.ranges[::2], log.ranges[::-1][::2]]), log.laser)
    drift = there.copy()
    drift[:, 1] += np.linspace(0.0, 0.3, len(drift))
    good, bad = (judged.consistency(back, way) for way in (there, drift))
    assert bad.walls_m2 > 1.2 * good.walls_m2
    assert good.revisits > 3
    assert good.revisits_m < 0.02 < 0.08 < bad.revisits_m


def test_a_run_without_revisits_has_no_error_there():
    log = drive(n=10)
    found = judged.consistency(log, log.truth_at(log.t))
    assert found.revisits == 0 and found.revisits_m is None


def test_the_odd_one_out_disagrees_most():
    t, way = np.arange(20.0), np.random.default_rng(0).random((20, 3))
    odd = way * (3.0, 3.0, 1.0)
    between = t[1:] - 0.5, 0.5 * (way[1:] + way[:-1])
    for other in ((t, way), between):
        apart = judged.disagreements([(t, way), other, (t, odd), (t + 50.0, way)])
        assert apart[0] == pytest.approx(0.5 * judged.disagreements([(t, way), (t, odd)])[0])
        assert apart[3] is None, "no time in common"
