"""The sweep: what it counts, what it shows, and that it is the same wherever it is done."""

import json
import signal
import sys
import time

import numpy as np
import pytest

from bench import sweep as command
from bench.judge import survival
from bench.report import __main__ as again
from bench.report import sweep_tables
from bench.report.html import sweep_page
from bench.results import sweep as results
from bench.results.sweep import Sweep
from bench.run import plan
from bench.run.trial import judged
from slams import Params, Pose2
from slams.player import Run, replay
from tests.processes import ends, in_session, processes_of, signal_one
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
        "posed": None,
        "refined": None,
        "scans": 100,
        "duration_s": 10.0,
        "way_m": 5.0,
        "ate_m": 0.01,
        "worst_m": 0.02,
        "second_m": 0.001,
        "second_rad": 0.001,
        "lost": False,
        "lost_at_s": None,
        "right_again": None,
        "episodes": 0,
        "said_in_time": 0,
        "said_late": 0,
        "missed": 0,
        "right_scans": 100,
        "false_alarms": 0,
        "wheels_ate_m": None,
    }
    return known | more


def lost(**more):
    return trial(lost=True, ate_m=3.0, episodes=1, missed=1, right_again=False, **more)


def sweep_of(trials, cpu=0.1):
    costs = [{"cpu_s": cpu * (1 + k), "longest_ms": 1.0} for k in range(len(trials))]
    facts = {
        "units": {"noise": "m"},
        "meanings": {"noise": "range noise"},
        "logs": [],
        "rate": 10.0,
        "sensor": "utm30lx",
        "limits": {"limit_m": 0.5, "limit_rad": 0.3},
    }
    record = {"command": "c", "machine": {"cpu": "a <b>", "system": "s"}, "versions": {"v": "1"}}
    return Sweep(facts, trials, costs, record)


def test_a_group_counts_what_survived_and_what_was_said():
    trials = [
        trial(ate_m=0.02, odometry=True, wheels_ate_m=0.01, false_alarms=5),
        trial(ate_m=0.04, odometry=True, wheels_ate_m=0.05),
        lost(odometry=True, wheels_ate_m=0.05) | {"said_in_time": 1, "missed": 0},
        lost(odometry=True) | {"right_again": True},
        trial() | {"failed": "it fell over"},
    ]
    (group,) = survival.grouped(sweep_of(trials), lambda _: "all").values()
    assert str(group.survived) == "2 of 5"
    assert group.survived.low == pytest.approx(0.1176, abs=1e-3)  # Wilson's, by hand
    assert group.survived.high == pytest.approx(0.7693, abs=1e-3)
    assert group.ate_m == pytest.approx(0.03)
    assert group.worst_ate_m == 0.04
    assert str(group.worse_than_wheels) == "2 of 3"
    assert str(group.right_again) == "1 of 2"
    assert str(group.said_in_time) == "1 of 2"
    assert group.false_share == pytest.approx(5 / 400)
    assert group.cpu == pytest.approx(np.median([0.01, 0.02, 0.03, 0.04]))


def test_the_reach_ends_at_the_first_level_that_cost_a_run():
    trials = [
        trial(level=0.05),
        trial(level=0.05, log="l1"),
        trial(level=0.1),
        lost(level=0.1, log="l1"),
        trial(level=0.2),
        lost(algorithm="b", level=0.05),
    ]
    found = sweep_of(trials)
    assert survival.reach(found, "a", False, "noise") == 0.05
    assert survival.reach(found, "b", False, "noise") is None
    (name,) = sweep_tables.reach_table(found, False).index
    assert name == "noise [m]"


def test_the_dearest_case_is_compared_with_its_own_clean_log():
    trials = [trial(), trial(log="l1"), trial(level=0.1), trial(level=0.1, log="l1")]
    found = sweep_of(trials)  # 0.1, 0.2, 0.3, 0.4 s
    assert survival.cost_ratio(found, "a", False) == pytest.approx(3.0)
    assert survival.cost_ratio(found, "a", True) is None


def test_tables_and_answer_name_who_was_lost():
    trials = [
        *(trial(algorithm=name, log=log) for name in "ab" for log in ("l0", "l1")),
        trial(level=0.1),
        lost(algorithm="b", level=0.1),
    ]
    found = sweep_of(trials)
    made = sweep_tables.tables(found)
    errors = made["errors-laser-alone"].frame
    assert list(errors.columns) == ["a", "b"]
    assert errors.loc["clean", "a"] == "10.0"
    assert errors.loc["noise=0.1", "b"] == "1 of 1 lost"
    text = sweep_tables.terminal(found)
    assert "Laser alone: a survived most, 3 of 3" in text
    assert "2 of 3" in made["survival"].frame.loc["b, laser alone", "survived"]


def test_the_page_marks_lost_runs_and_escapes_names():
    trials = [trial(algorithm="<i>"), trial(algorithm="<i>", level=0.1), lost(level=0.1)]
    page = sweep_page.document(sweep_of(trials))
    assert "<i>" not in page
    assert page.count('class="dot run-0 mark"') == 4  # error and cost, clean and spoiled
    assert page.count('class="cross run-1 mark"') == 2
    assert "range noise" in page
    assert "a &lt;b&gt;" in page


def test_a_trial_is_judged_against_the_truth():
    log = drive(n=60)
    truth = log.truth_at(log.t)
    poses = truth.copy()
    poses[40:, 0] += 0.6
    says = np.zeros(60, bool)
    says[5] = True  # of nothing; the loss itself is never said
    run = Run(log.t, poses, np.full(60, 1e-3), 0.0, {"odometry": 3, "posed": 30}, says)
    found = judged(run, log)
    assert found["lost"]
    assert found["lost_at_s"] == pytest.approx(log.t[40] - log.t[0])
    said = ("episodes", "said_in_time", "missed", "false_alarms")
    assert [found[name] for name in said] == [1, 0, 1, 1]
    assert found["right_again"] is False
    assert found["used"] == ["laser", "wheels"]
    assert found["posed"] == 0.5
    assert found["worst_m"] == pytest.approx(0.6, abs=1e-6)
    assert found["wheels_ate_m"] >= 0.0
    right = judged(Run(log.t, truth, np.full(60, 1e-3), 0.0, {}, np.zeros(60, bool)), log)
    assert not right["lost"]
    assert right["ate_m"] == pytest.approx(0.0, abs=1e-9)


def test_wheels_that_nobody_looks_at_are_left_out(tmp_path):
    (tmp_path / "a").mkdir()
    drive(n=30).save(tmp_path / "a" / "room.npz")
    given = plan.logs_of([str(tmp_path / "a" / "room.npz")], plan.Drives([], 1, 1.0, ""), None)
    levels = plan.conditions_of(["clean", "stall=1", "noise=0.05"], full=False)
    made = plan.Plan(["odometry"], levels, given, (False, True), None, None)
    cases = [(c.known["degradation"], c.known["odometry"]) for c in made.cases(tmp_path / "logs")]
    assert ("stall", True) in cases
    assert ("stall", False) not in cases
    assert len(cases) == 5
    twice = [one._replace(log=one.log._replace(seed=seed)) for one in given for seed in (0, 1)]
    made = plan.Plan(["odometry"], levels, twice, (False,), None, None).cases(tmp_path / "logs")
    assert len({c.task.key for c in made if c.known["degradation"] == "clean"}) == 1
    assert len({c.task.key for c in made if c.known["degradation"] == "noise"}) == 2


def test_a_run_tells_at_which_scans_it_called_itself_lost():
    class Doubting:
        Params = Params
        scans = lost = 0

        def __init__(self, params):
            pass

        def update(self, scan):
            self.scans += 1
            self.lost += self.scans in (4, 5, 9)
            return Pose2(0.0, 0.0, 0.0)

        def map(self):
            raise NotImplementedError

        def report(self):
            return {"lost": self.lost}

    run = replay(Doubting(Params()), drive(n=12))
    assert np.flatnonzero(run.says_lost).tolist() == [3, 4, 8]


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "room.npz"
    drive(n=40).save(path)
    return path


def arguments_of(log, out, *more):
    names = ["odometry", "tests.bench.test_html:Still", "tests.bench.test_html:Broken"]
    levels = ["clean", "noise=0.1", "jump=2"]
    words = [str(log), "--algorithms", *names, "--degradations", *levels, "--seeds", "1"]
    return [*words, "--rate", "0", "--out", str(out), "-q", *more]


def test_the_same_bytes_from_one_process_two_and_three_shards(log, tmp_path):
    places = {name: tmp_path / name for name in ("one", "two", "shards")}
    assert command.main(arguments_of(log, places["one"], "--jobs", "1")) == 0
    assert command.main(arguments_of(log, places["two"], "--jobs", "2")) == 0
    for k in (1, 2, 3):
        more = ("--jobs", "1", "--shard", f"{k}/3")
        assert command.main(arguments_of(log, places["shards"], *more)) == 0
        assert (places["shards"] / results.TRIALS).exists() == (k == 3)
    names = [results.TRIALS, "table-errors-laser-alone.csv", "table-errors-with-odometry.csv"]
    for name in names:
        texts = {place: (folder / name).read_bytes() for place, folder in places.items()}
        assert len(set(texts.values())) == 1, name
    found = results.read(places["one"])
    assert len(found.trials) == 3 * (2 * 2 + 1)
    failed = [t for t in found.trials if t["failed"]]
    assert {t["algorithm"] for t in failed} == {"tests.bench.test_html:Broken"}
    assert all("no hope" in t["failed"] for t in failed)
    drawn = {p: p.read_bytes() for p in places["one"].iterdir() if p.is_file()}
    assert b"jump" in drawn[places["one"] / "report.html"]
    assert again.main([str(places["one"]), "-q"]) == 0
    assert {p: p.read_bytes() for p in drawn} == drawn


def test_what_is_done_is_not_done_again(log, tmp_path, monkeypatch):
    assert command.main(arguments_of(log, tmp_path / "out", "--jobs", "1")) == 0
    before = (tmp_path / "out" / results.TRIALS).read_bytes()
    stored = {p: p.stat().st_mtime_ns for p in (tmp_path / "out" / "runs").rglob("*.json")}
    gone = sorted(p for p in stored if not p.name.endswith(".cost.json"))[:2]
    for path in gone:
        path.unlink()
    assert command.main(arguments_of(log, tmp_path / "out", "--jobs", "1")) == 0
    assert (tmp_path / "out" / results.TRIALS).read_bytes() == before
    kept = {p for p in stored if p.stat().st_mtime_ns == stored[p]}
    done_again = {p.name for p in set(stored) - kept}
    assert {p.name for p in gone} <= done_again
    assert len(done_again) <= 4  # and what they cost


def test_a_sweep_killed_goes_on_where_it_was(log, tmp_path):
    words = arguments_of(log, tmp_path / "out", "--jobs", "1")
    process = in_session([sys.executable, "-m", "bench.sweep", *words])
    runs = tmp_path / "out" / "runs"
    try:
        while process.poll() is None and len(list(runs.rglob("*.cost.json"))) < 3:
            pass
    finally:
        process.kill()
        process.wait()
    stored = {p.name: p.read_bytes() for p in runs.rglob("*.json")}
    assert stored
    assert command.main(words) == 0
    for path in runs.rglob("*.json"):
        if path.name in stored and not path.name.endswith(".cost.json"):
            assert path.read_bytes() == stored[path.name]
    assert command.main(arguments_of(log, tmp_path / "other", "--jobs", "1")) == 0
    trials = [(tmp_path / name / results.TRIALS).read_bytes() for name in ("out", "other")]
    assert trials[0] == trials[1]


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (["--degradations", "nois=0.05"], "did you mean 'noise'"),
        (["--degradations", "noise=-1"], "noise"),
        (["--degradations", "beams=2.5"], "beams"),
        (["--arenas", "moon"], "unknown arena 'moon'"),
        (["--algorithms", "hectar"], "did you mean 'hector'"),
        (["--seeds", "0"], "--seeds: got 0"),
        (["--shard", "4/3"], "part 4 of 3"),
        (["--jobs", "0"], "--jobs: got 0"),
        (["--sensor", "lds3"], "unknown sensor"),
        (["--duration", "1"], "--duration: got 1"),
        (["none.npz"], "none.npz"),
    ],
)
def test_bad_input_gets_one_sentence_and_nothing_is_written(tmp_path, capsys, more, sentence):
    folder = tmp_path / "out"
    assert command.main(["--out", str(folder), "-q", *more]) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1
    written = [p for p in folder.rglob("*") if p.is_file()] if folder.exists() else []
    assert written == []


def test_a_log_without_truth_is_refused(tmp_path, capsys):
    log = drive(n=10)
    blind = type(log)(log.t, log.ranges, log.laser, log.odom, None, log.yaw_rate)
    blind.save(tmp_path / "blind.npz")
    assert command.main([str(tmp_path / "blind.npz"), "--out", str(tmp_path / "o")]) == 2
    assert "has no truth; a sweep needs one" in capsys.readouterr().err


def test_the_degradations_are_listed_with_units_and_levels(capsys):
    assert command.main(["--degradations", "list"]) == 0
    said = capsys.readouterr().out
    assert "noise [m]: " in said
    assert "people [1]: " in said


def test_the_quick_sweep_is_made_of_what_there_is():
    levels = plan.conditions_of(list(command.QUICK), full=False)
    assert len(levels) == len(command.QUICK)
    assert levels[0].degradation.name == "clean"


def test_damaged_sweeps_are_refused(tmp_path):
    results.save(tmp_path, sweep_of([trial()]))
    found = json.loads((tmp_path / results.TRIALS).read_text())
    assert results.read(tmp_path).trials == found["trials"]
    (tmp_path / results.TRIALS).write_text(json.dumps(found | {"format": "sweep-0"}))
    with pytest.raises(ValueError, match="sweep-1"):
        results.read(tmp_path)


def test_no_worker_survives_an_interrupt(log, tmp_path):
    words = arguments_of(log, tmp_path / "out", "--jobs", "2")
    process = in_session([sys.executable, "-m", "bench.sweep", *words])
    runs = tmp_path / "out" / "runs"
    while process.poll() is None and not list(runs.rglob("*.cost.json")):
        time.sleep(0.02)
    signal_one(process, signal.SIGTERM)
    process.communicate(timeout=20.0)
    assert ends(processes_of(process.pid)), "a worker is left"
