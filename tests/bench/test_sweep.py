"""The sweep: climbs, and that they are the same wherever they are done; its page and files."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from bench import sweep as command
from bench.report import sweep_figure
from bench.results import sweep as results
from bench.results.sweep import Sweep
from bench.run import plan
from bench.run import trial as trial_module
from bench.run.trial import judged
from slams import Params
from slams.player import Run, replay
from slams.scanlog import TimeSeries
from tests.bench.test_html import Still
from tests.rooms import drive


def trial(algorithm="a", level=0.0, log="l0", odometry=False, **more):
    known = {
        "algorithm": algorithm,
        "log": log,
        "place": "room",
        "seed": 0,
        "degradation": "noise" if level else "clean",
        "level": level,
        "odometry": odometry,
        "failed": None,
        "used": ["laser"],
        "scans": 100,
        "duration_s": 10.0,
        "ate_m": 0.01,
        "second_m": 0.001,
        "lost": False,
        "right_again": None,
        "episodes": 0,
        "said_in_time": 0,
        "right_scans": 100,
        "false_alarms": 0,
        "wheels_ate_m": None,
    }
    return known | more


def lost(**more):
    return trial(lost=True, ate_m=3.0, episodes=1, right_again=False, **more)


def sweep_of(trials, cpu=0.1, levels=None):
    costs = [{"cpu_s": cpu * (1 + k)} for k in range(len(trials))]
    facts = {
        "units": {"noise": "m", "beams": "1"},
        "meanings": {"noise": "range noise"},
        "levels": levels or {"clean": [0.0], "noise": [0.05, 0.1, 0.2]},
        "logs": [{"name": "l0", "place": "room", "seed": 0}],
        "rate": 10.0,
        "sensor": "utm30lx",
        "lost": "too far off",
    }
    record = {"command": "c", "machine": {"cpu": "a <b>", "system": "s"}, "versions": {"v": "1"}}
    return Sweep(facts, trials, costs, record)


def test_the_page_answers_first_and_draws_curves_with_bands_and_escapes_names(tmp_path):
    names = ("<i>", "b")
    trials = [trial(algorithm=name, log=f"l{k}", level=0.05) for name in names for k in range(3)]
    trials += [lost(algorithm="b", log="l0", level=0.1), trial(algorithm="<i>", level=0.1)]
    found = sweep_of(trials)
    weighed = command.write(tmp_path, found)
    page = (tmp_path / "report.html").read_text()
    assert "<i>" not in page
    assert page.index("3 drives cannot decide") < page.index("<img") < page.index("levels held [%]")
    assert page.count("<img") == 2, "errors and costs, and the curves of one question"
    assert '<td data-label="laser alone" class="words">3 drives cannot decide' in page
    assert (tmp_path / "fig_survival-1.png").exists()
    assert "range noise" in page and "a &lt;b&gt;" in page
    axes, (cell,) = Figure().subplots(), weighed.cells
    sweep_figure.survival(axes, cell, "noise")
    assert len(axes.lines) == len(axes.collections) == 2, "a line and a band of both rows"
    assert axes.lines[1].get_ydata().tolist() == [one.k / one.n for one in cell.curves["b"]]


def test_a_trial_is_judged_against_the_truth():
    log = drive(n=60)
    truth = log.truth_at(log.t)
    poses = truth.copy()
    poses[40:, 0] += 2.0
    says = np.zeros(60, bool)
    says[5] = True  # of nothing; the loss itself is never said
    run = Run(log.t, poses, np.full(60, 1e-3), 0.0, {"odometry": 3, "posed": 30}, says)
    found = judged(run, log)
    assert found["lost"]
    said = ("episodes", "said_in_time", "false_alarms")
    assert [found[name] for name in said] == [1, 0, 1]
    assert found["right_again"] is False
    assert found["used"] == ["laser", "wheels"]
    assert found["wheels_ate_m"] >= 0.0
    run = Run(log.t, truth, np.full(60, 1e-3), 0.0, {}, np.zeros(60, bool))
    right = judged(run, log.select(odometry=False))
    assert not right["lost"] and right["wheels_ate_m"] is None
    assert right["ate_m"] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(ValueError, match="fewer than two scans"):  # which has no cost either
        judged(run, replace(log, truth=TimeSeries(log.t + 99.0, truth)))


def test_what_would_be_another_runs_twin_is_left_out(room_file, tmp_path):
    """Wheels that nobody looks at; another seed of a recorded log where no chance plays a part."""
    given = plan.logs_of([room_file], plan.Drives([], 3, 1.0, "", 5), None)
    levels = plan.conditions_of(["clean", "beams=45", "noise=0.05", "stall=1"])
    made = plan.Plan(["odometry"], levels, given, (False, True), None, None)
    cases = made.cases(tmp_path / "logs")
    found = [(c.known["degradation"], c.known["odometry"], c.known["seed"]) for c in cases]
    every = [(name, with_wheels, 5) for name in ("clean", "beams") for with_wheels in (False, True)]
    every += [("noise", with_wheels, seed) for with_wheels in (False, True) for seed in (5, 6, 7)]
    assert sorted(found) == sorted([*every, *(("stall", True, seed) for seed in (5, 6, 7))])
    assert len({case.task.key for case in cases}) == len(cases)


def test_a_climb_ends_at_the_first_level_that_loses_the_run(room_file, tmp_path, monkeypatch):
    tried, loses = [], []

    def judged_by_level(entry, params, log, odometry):
        (done,) = log.meta["degraded"]
        tried.append(done["level"])
        if done["level"] == 90:
            raise ValueError("no hope")
        return trial(lost=done["level"] == loses[-1]), {"cpu_s": 1.0}

    monkeypatch.setattr(trial_module, "_run", judged_by_level)
    given = plan.logs_of([room_file], plan.Drives([], 1, 1.0, ""), None)
    levels = plan.conditions_of(["dropout=10", "dropout=50", "dropout=90", "dropout=95"])
    (case,) = plan.Plan(["odometry"], levels, given, (True,), None, None).cases(tmp_path / "logs")
    for at, levels_tried in ((10, [10]), (50, [10, 50]), (99, [10, 50, 90])):
        loses.append(at)
        tried.clear()
        result = trial_module.perform(**case.task.what, **case.task.where)
        assert tried == levels_tried
        assert len(result.value["trials"]) == len(result.measured["costs"]) == len(levels_tried)
    assert result.value["trials"][-1]["failed"] == "ValueError: no hope"
    assert result.measured["costs"][-1] is None


def test_a_run_tells_at_which_scans_it_called_itself_lost():
    class Doubting(Still):
        def report(self):
            return {"lost": sum(scan <= self.scans for scan in (4, 5, 9))}

    run = replay(Doubting(Params()), drive(n=12))
    assert np.flatnonzero(run.says_lost).tolist() == [3, 4, 8]


def arguments_of(log, out, *more):
    names = ["odometry", "tests.bench.test_html:Still", "tests.bench.test_html:Broken"]
    levels = ["clean", "noise=0.1", "jump=2"]
    words = [log, "--algorithms", *names, "--degradations", *levels, "--seeds", "1"]
    return [*words, "--rate", "0", "--out", str(out), "-q", *more]


def test_the_same_bytes_from_one_process_and_two(room_file, tmp_path):
    places = {name: tmp_path / name for name in ("one", "two")}
    assert command.main(arguments_of(room_file, places["one"], "--jobs", "1")) == 0
    assert command.main(arguments_of(room_file, places["two"], "--jobs", "2")) == 0
    names = [results.TRIALS_FILE, "survival.csv", "table-alarms.csv"]
    for name in names:
        texts = {place: (folder / name).read_bytes() for place, folder in places.items()}
        assert len(set(texts.values())) == 1, name
    found = results.read(places["one"])
    assert len(found.trials) == 3 * (2 * 2 + 1), "single levels: each climb is one trial"
    failed = [t for t in found.trials if t["failed"]]
    assert {t["algorithm"] for t in failed} == {"tests.bench.test_html:Broken"}
    assert all("no hope" in t["failed"] for t in failed)
    assert "jump" in (places["one"] / "report.html").read_text()


def test_what_is_done_is_not_done_again_nor_counted(room_file, tmp_path, capsys, monkeypatch):
    given = arguments_of(room_file, tmp_path / "out", "--jobs", "1")
    words = [word for word in given if word != "-q"]
    counted = []

    def progress(items, total, *_, **__):
        counted.append(total)
        return items

    monkeypatch.setattr(command.cli, "progress", progress)
    assert command.main(words) == 0
    before = (tmp_path / "out" / results.TRIALS_FILE).read_bytes()
    stored = {p: p.stat().st_mtime_ns for p in (tmp_path / "out" / "runs").rglob("*.json")}
    gone = sorted(p for p in stored if not p.name.endswith(".cost.json"))[:2]
    for path in gone:
        path.unlink()
    assert command.main(words) == 0
    assert (tmp_path / "out" / results.TRIALS_FILE).read_bytes() == before
    done_again = {p.name for p in stored if p.stat().st_mtime_ns != stored[p]}
    assert {p.name for p in gone} <= done_again
    assert len(done_again) <= 4  # and what they cost
    assert counted == [15, 2]
    (tmp_path / "out" / "table-critical-9.csv").touch()
    assert command.main([*words, "--odometry", "with"]) == 2
    assert command.main([*words, "--odometry", "with", "--force"]) == 0
    assert not (tmp_path / "out" / "table-critical-9.csv").exists()
    said = capsys.readouterr().err
    assert "15 runs, 13 kept from before, 2 to do\n" in said
    assert "out: has other results; expected another --out, or --force\n" in said


def test_the_degradations_are_listed_with_units_and_levels(capsys):
    assert command.main(["--degradations", "list"]) == 0
    said = capsys.readouterr().out
    assert "noise [m]: " in said
    assert "people [1]: " in said


def test_the_default_sweep_has_ten_drives_an_arena_and_all_three_kinds_of_rows():
    made = command._plan(command.parser().parse_args([]))
    names = ("hector", "tsd", "crsm", "gmapping")
    assert made.algorithms == [f"{n}{p}" for p in ("", "@paper", "@original") for n in names]
    assert len(made.logs) == 40
    assert set(made.conditions) == set(command.DEFAULT_DEGRADATIONS)
    quick = command._plan(command.parser().parse_args(["--quick"]))
    assert quick.algorithms == list(names)
    assert set(quick.conditions) == set(command.QUICK_DEGRADATIONS)
    assert len(quick.logs) == 20
