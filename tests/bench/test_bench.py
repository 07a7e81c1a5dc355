"""Failure, cost and tables: what the benchmark says of a run."""

import numpy as np
import pytest

from bench.judge import loss
from bench.judge.loss import LIMIT_M, LIMIT_RAD
from bench.judge.metrics import Common, RelationErrors
from bench.report import tables
from bench.report import text as report
from bench.run import timing
from bench.run.cases import Choice, read_relations, replayed
from slams import load, summary
from slams.player import replay
from slams.registry import find
from slams.summary import summarize
from tests.rooms import drive


def line(n, step=0.1):
    poses = np.zeros((n, 3))
    poses[:, 0] = step * np.arange(n)
    return poses


def test_a_run_that_leaves_the_limits_is_lost_and_may_come_back():
    truth = line(100)
    estimate = truth.copy()
    estimate[40:60, 1] = LIMIT_M + 0.01
    found = loss.by_truth(Common(5.0 + np.arange(100.0), estimate, truth, 0))
    assert found == {
        "lost": True,
        "at_s": 40.0,
        "after_m": pytest.approx(4.0),
        "completed": pytest.approx(0.8),
    }
    estimate[40:60, 1] = LIMIT_M - 0.01
    assert not loss.by_truth(Common(np.arange(100.0), estimate, truth, 0))["lost"]
    estimate[70:, 2] = LIMIT_RAD + 0.01 + 2.0 * np.pi
    assert loss.by_truth(Common(np.arange(100.0), estimate, truth, 0))["at_s"] == 70.0


def test_the_words_name_the_limits(monkeypatch):
    monkeypatch.setattr(loss, "LIMIT_M", 7.25)
    assert loss.words().startswith("off by more than 7.25 m or 0")


def test_some_broken_relations_are_no_lost_run_and_the_first_is_that_of_the_least_stamp():
    def errors(broken):
        translation = np.where(np.arange(100) < broken, 2.0, 0.01)
        t = np.arange(100.0)[::-1].copy()
        return RelationErrors(t, translation, np.zeros(100), np.zeros(100, bool), 100)

    assert loss.by_relations(errors(5), 10.0) == {
        "lost": False,
        "at_s": 85.0,
        "after_m": None,
        "completed": 0.95,
        "broken": 5,
    }
    assert loss.by_relations(errors(6), 10.0)["lost"]


def test_an_algorithm_may_call_itself_lost():
    assert loss.by_report({"lost": 6}, 100) == {"lost": True, "scans": 6}
    assert loss.by_report({"lost": 5}, 100) == {"lost": False, "scans": 5}
    assert loss.by_report({}, 100) == {"lost": False, "scans": 0}


def test_cost_by_hand():
    found = summary.cost(np.array([0.001, 0.002, 0.003, 0.004]), 10.0)
    assert found["mean_ms"] == pytest.approx(2.5)
    assert (found["p50_ms"], found["max_ms"]) == (pytest.approx(2.5), pytest.approx(4.0))
    assert (found["p95_ms"], found["p99_ms"]) == (pytest.approx(3.85), pytest.approx(3.97))
    assert found["real_time_factor"] == pytest.approx(1000.0)


def test_a_run_has_the_same_figures_in_its_summary_and_in_the_benchmark(tmp_path):
    drive(n=60).save(tmp_path / "room.npz")
    log = load(tmp_path / "room.npz")
    entry = find("odometry")
    own = summarize(replay(entry.cls(entry.params()), log), log, "odometry", entry.params(), 0.0)
    row = replayed("odometry", log, Choice()).row
    assert row["cpu_ms_per_scan"] == row["cost"]["mean_ms"]
    assert row["cpu_ms"] == {name: row["cost"][f"{name}_ms"] for name in ("p50", "p95", "max")}
    assert row["real_time_factor"] == row["cost"]["real_time_factor"]
    assert [key for key in own["errors"] if key.startswith("per_")] == ["per_update", "per_1_s"]
    for key, span in (("per_update", "update"), ("per_1_s", "1 s")):
        found = row["errors"]["spans"][span]
        for name, theirs in (
            ("translation_m", "se2_translation_m"),
            ("rotation_rad", "orientation_rad"),
        ):
            for moment, value in own["errors"][key][name].items():
                assert value == pytest.approx(found[theirs][moment], rel=1e-9, abs=1e-12)
    for name in ("ate_m", "end_m"):
        assert row["errors"][name] == pytest.approx(own["errors"][name], rel=1e-9)


def test_peak_memory_counts_what_is_allocated_inside_and_nothing_before():
    before = np.ones(30_000_000)
    del before
    with timing.PeakMemory() as memory:
        inside = np.ones(10_000_000)
        del inside
    if memory.mb is None:
        pytest.skip("this system does not tell a process' peak memory")
    assert 70.0 < memory.mb < 110.0


def test_published_figures_are_read_with_their_columns():
    rows = tables.published("update", "stdr arena (not public)")
    assert [row["ours"] for row in rows] == ["hector@original", "tsd@original", "crsm@original"]
    assert rows[0]["translation_mean"] == 0.025
    assert rows[2]["rotation_max"] == 0.333
    intel = tables.published("relations", "intel")
    assert [row["translation_mean"] for row in intel] == [0.220, 0.070, 0.031, 0.0229]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "expected relations, lines t1 t2"),
        ("1 2 3\n", "expected relations, lines t1 t2"),
        ("1 2 3 4 5 6 7 8\n1 2\n", "expected relations, lines t1 t2"),
        ("a b c d e f g h\n", "not a relations file"),
        ("1 2 nan 4 5 6 7 8\n", "not finite"),
    ],
)
def test_bad_relations_are_refused(tmp_path, text, sentence):
    path = tmp_path / "x.relations"
    path.write_text(text)
    with pytest.raises(ValueError, match=sentence):
        read_relations(path)


def test_a_failed_run_is_told_in_a_sentence():
    log = {"name": "x", "scans": 1, "beams": 1, "duration_s": 0.0}
    rows = [{"algorithm": "raiser", "log": "x", "failed": "ValueError: no"}]
    assert "raiser failed: ValueError: no" in report.as_text(log, rows)
