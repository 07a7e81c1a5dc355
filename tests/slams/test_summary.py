"""The summary of a run: every figure is what its name says."""

import json
import math

import numpy as np
import pytest

from slams import Params, metrics, player
from slams.player import Run
from slams.registry import create
from slams.scanlog import ScanLog, TimeSeries
from slams.summary import as_json, as_text, cost, summarize, truth_errors
from slams.types import Pose2
from tests.rooms import laser, moved

T = np.arange(20) * 0.5


def poses_of(off=0.0):
    """A way to the side of the truth by `off` [m] in the middle of it."""
    x = 0.3 * np.arange(20)
    return np.stack([x, np.where((x > 2.0) & (x < 4.0), off, 0.0), 0.0 * x], axis=1)


def log_of(truth=None, covered=None):
    ranges = np.ones((20, 5), np.float32)
    ranges[3] = np.inf
    ranges[4, :3] = np.nan  # some beams return
    covered = slice(None) if covered is None else covered
    track = None if truth is None else TimeSeries(T[covered], truth[covered])
    return ScanLog(T, ranges, laser(5), None, track, None, {"name": "by hand"})


def run_of(poses, report=None):
    seconds = np.linspace(0.001, 0.02, 20)
    return Run(T, poses, seconds, 2.0, report or {"lost": 0})


def summary_of(poses, log, report=None):
    return summarize(run_of(poses, report), log, "mine", Params(), 3.0)


def test_the_figures_of_a_run_by_hand():
    found = summary_of(poses_of(), log_of())
    assert (found["scans"], found["beams"], found["scans_without_return"]) == (20, 5, 1)
    assert (found["duration_s"], found["path_length_m"]) == (9.5, pytest.approx(5.7))
    assert found["compile_s"] == 5.0
    assert found["cpu_ms_per_scan"] == pytest.approx(10.5)
    assert found["cpu_ms"] == pytest.approx({"p50": 10.5, "p95": 19.05, "max": 20.0})
    assert found["real_time_factor"] == pytest.approx(9.5 / 0.21)
    assert found["errors"] is None
    assert "no truth in the log" in as_text(found)


def test_costs_by_hand():
    found = cost(0.001 * np.arange(1, 102), 10.0)
    expected = {"mean": 51.0, "p50": 51.0, "p95": 96.0, "p99": 100.0, "max": 101.0}
    assert {name: found[f"{name}_ms"] for name in expected} == pytest.approx(expected)


def test_errors_against_the_truth_by_hand():
    truth = moved(Pose2(4.0, -3.0, 1.0), poses_of())  # another frame
    estimate = poses_of(off=0.1)
    estimate[-1, 0] += 0.4
    errors = truth_errors(run_of(estimate), log_of(truth))
    assert errors["per_update"]["translation_m"]["max"] == pytest.approx(0.4)
    assert errors["per_update"]["translation_m"]["mean"] == pytest.approx((0.4 + 0.2) / 19)
    assert errors["end_m"] == pytest.approx(0.4)
    assert errors["ate_m"] == pytest.approx(metrics.ate(estimate, truth)) and errors["ate_m"] > 0.05
    assert errors["not_covered"] == 0
    assert set(errors) == {"per_update", "per_1_s", "not_covered", "ate_m", "end_m"}


@pytest.mark.parametrize("covered", [slice(5, None), np.r_[:8, 13:20]])  # late, with a gap
def test_poses_without_a_truth_are_left_out(covered):
    log, estimate = log_of(poses_of(), covered), poses_of()
    estimate[np.delete(np.arange(20), covered), 1] = 9.0
    errors = truth_errors(run_of(estimate), log)
    assert errors["not_covered"] == 5
    assert errors["ate_m"] == pytest.approx(0.0, abs=1e-9)
    assert "5 poses at times without truth" in as_text(summary_of(estimate, log))


def test_counts_of_faults_become_notes():
    report = {"lost": 2, "too_far": 7, "unlike": 3}
    found = summary_of(poses_of(), log_of(), report) | {"stamps_back": 3}
    (note,) = [line for line in as_text(found).splitlines() if line.startswith("note")]
    assert "3 stamps jump back" in note
    assert "1 scans have no return at all" in note
    assert "7 scans not inserted into the map" in note
    assert "2 scans are lost" in note and "3 scans are unlike the given map" in note
    one = as_text(summary_of(poses_of(), log_of(), dict.fromkeys(report, 1)))
    assert "are lost" not in one and "unlike the" not in one


@pytest.mark.parametrize(
    ("scans", "leveled", "causes"),
    [(1, 0, ""), (2, 0, "people, dust, or a tilting laser"), (2, 9, "people or dust")],
)
def test_a_note_names_the_causes_of_many_conflicts(scans, leveled, causes):
    text = as_text(summary_of(poses_of(), log_of(), {"in_conflict": scans, "leveled": leveled}))
    notes = [line for line in text.splitlines() if "conflict with free space" in line]
    end = f"2 scans conflict with free space of the map: {causes}"
    assert [note.endswith(end) for note in notes] == ([True] if causes else [])


def test_what_is_not_finite_becomes_null():
    text = as_json({"a": math.nan, "b": [math.inf, 1.0], "c": np.float64(-math.inf), "d": "nan"})
    assert json.loads(text) == {"a": None, "b": [None, 1.0], "c": None, "d": "nan"}


def test_the_time_of_what_brings_the_scans_is_not_counted(room_log, monkeypatch):
    """By a clock that advances only between the scans."""
    seen = []
    monkeypatch.setattr(player.time, "process_time", lambda: float(len(seen)))
    done = player.replay(create("odometry"), (s for s in room_log if seen.append(s) is None))
    assert len(seen) == len(room_log)
    assert not done.seconds.any()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_pose_that_is_not_finite_is_refused_with_its_scan(bad, room_log, monkeypatch):
    slam = create("odometry")
    poses = iter([Pose2(0.0, 0.0, 0.0)] * 3 + [Pose2(bad, 0.0, 0.0)] * len(room_log))
    monkeypatch.setattr(slam, "update", lambda scan: next(poses))
    with pytest.raises(RuntimeError, match=r"Odometry returned Pose2\(x=(nan|inf).* for scan 3"):
        player.replay(slam, room_log)
