"""Failure, cost and tables: what the benchmark says of a run."""

import numpy as np
import pytest

from bench.judge import loss
from bench.judge.loss import MAX_HEADING_ERROR, MAX_POSITION_ERROR, alarms, beyond
from bench.judge.metrics import Common, RelationErrors
from bench.run import timing
from bench.run.cases import Choice, read_relations, replayed
from slams import load
from slams.player import replay
from slams.registry import find
from slams.summary import summarize


def line(n, step=0.1):
    poses = np.zeros((n, 3))
    poses[:, 0] = step * np.arange(n)
    return poses


def test_a_run_that_leaves_the_limits_is_lost_and_may_come_back():
    truth = line(100)
    estimate = truth.copy()
    estimate[40:60, 1] = MAX_POSITION_ERROR + 0.01
    found = loss.by_truth(Common(5.0 + np.arange(100.0), estimate, truth, 0))
    shares = {"after_m": pytest.approx(4.0), "completed": pytest.approx(0.8)}
    assert found == {"lost": True, "at_s": 40.0} | shares
    estimate[40:60, 1] = MAX_POSITION_ERROR - 0.01
    estimate[30, 2] = 2.0 * np.pi
    assert not loss.by_truth(Common(np.arange(100.0), estimate, truth, 0))["lost"]
    estimate[80, :2] += 0.8 * MAX_POSITION_ERROR
    assert beyond(Common(np.arange(100.0), estimate, truth, 0)).nonzero()[0].tolist() == [80]
    estimate[70:, 2] = MAX_HEADING_ERROR + 0.01 + 2.0 * np.pi
    assert loss.by_truth(Common(np.arange(100.0), estimate, truth, 0))["at_s"] == 70.0


def test_some_broken_relations_are_no_lost_run_and_the_first_is_that_of_the_least_stamp():
    def errors(broken):
        translation = np.where(np.arange(100) < broken, 2.0, 0.01)
        t = np.arange(100.0)[::-1].copy()
        return RelationErrors(t, translation, np.zeros(100), np.zeros(100, bool), 100)

    found = {"lost": False, "at_s": 85.0, "after_m": None, "completed": 0.95, "broken": 5}
    assert loss.by_relations(errors(5), 10.0) == found
    assert loss.by_relations(errors(6), 10.0)["lost"]


def test_an_algorithm_may_call_itself_lost():
    assert loss.by_report({"lost": 6}, 100) == {"lost": True, "scans": 6}
    assert loss.by_report({"lost": 5}, 100) == {"lost": False, "scans": 5}
    assert loss.by_report({}, 100) == {"lost": False, "scans": 0}


def test_a_run_has_the_same_figures_in_its_summary_and_in_the_benchmark(room_file):
    log = load(room_file)
    entry = find("odometry")
    own = summarize(replay(entry.cls(entry.params()), log), log, "odometry", entry.params(), 0.0)
    row = replayed("odometry", log, Choice()).row
    assert row["cpu_ms_per_scan"] == row["cost"]["mean_ms"]
    assert row["cpu_ms"] == {name: row["cost"][f"{name}_ms"] for name in ("p50", "p95", "max")}
    assert row["real_time_factor"] == row["cost"]["real_time_factor"]
    assert [key for key in own["errors"] if key.startswith("per_")] == ["per_update", "per_1_s"]
    names = {"translation_m": "se2_translation_m", "rotation_rad": "orientation_rad"}
    for key, span in (("per_update", "update"), ("per_1_s", "1 s")):
        found = row["errors"]["spans"][span]
        for name, theirs in names.items():
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
    if not timing.STATUS_FILE.exists():
        pytest.skip("this system does not tell a process' peak memory")
    assert 70.0 < memory.mb < 110.0


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


STEP = 0.1


def flags(n, *ranges):
    found = np.zeros(n, bool)
    for first, after in ranges:
        found[first:after] = True
    return found


def judged(says, off, n=200):
    return alarms(flags(n, *says), STEP * np.arange(n), flags(n, *off))


@pytest.mark.parametrize(
    ("says", "off", "expected"),
    [
        ([], [], (0, 0, 200, 0, None)),  # never left the limits
        ([(10, 30)], [], (0, 0, 200, 20, None)),
        ([(105, 150)], [(100, 150)], (1, 1, 140, 0, True)),  # said in time, late and never
        ([(112, 150)], [(100, 150)], (1, 0, 140, 0, True)),
        ([(15, 20), (75, 80)], [(10, 20), (50, 80), (120, 140)], (3, 1, 110, 0, True)),
        ([(95, 96)], [(100, 150)], (1, 1, 140, 0, True)),  # a warning right before, an early one
        ([(80, 81)], [(100, 150)], (1, 0, 140, 1, True)),
        ([(150, 170)], [(100, 150)], (1, 0, 140, 20, True)),  # after the way back: no answer
        ([], [(100, 110), (119, 130)], (1, 0, 160, 0, True)),  # a short look into the limits
        ([], [(100, 110), (121, 130)], (2, 0, 161, 0, True)),
        ([(128, 130)], [(100, 105), (110, 115), (120, 130)], (1, 0, 160, 0, True)),
        ([], [(100, 200)], (1, 0, 90, 0, False)),  # right again is the last second
        ([], [(100, 195)], (1, 0, 95, 0, False)),
        ([], [(100, 185)], (1, 0, 105, 0, True)),
    ],
)
def test_what_was_said_of_losses(says, off, expected):
    assert judged(says, off) == expected


def test_a_clock_that_is_set_back_stands_still():
    t = STEP * np.concatenate([np.arange(100), 50 + np.arange(100)])
    found = alarms(flags(200, (152, 160)), t, flags(200, (140, 160)))
    assert found.episodes == found.in_time == 1  # the clock goes on from 9.9 s at scan 150
