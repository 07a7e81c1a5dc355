"""Plans of comparisons and sweeps: options of algorithms, what is tried by chance, folders."""

import math
import shutil

import pytest

from bench import compare, sweep
from bench.run import compare_options, folder, plan
from bench.run.cases import Choice, replayed
from bench.run.comparing import spread_over_starts, start_scans
from bench.run.single import seeds
from bench.sim.degrade import CATALOG
from hector.params import HectorParams
from slams import cli
from slams.formats.options import SourceOptions
from slams.registry import names
from tests.rooms import drive


def choice_of(*words):
    arguments = compare_options.parser().parse_args(words)
    labels = compare_options.labels_of(arguments)
    choice, _ = compare_options.checked(arguments, labels)
    return choice.params


def test_parameters_of_one_algorithm_leave_the_others_alone(tmp_path):
    (tmp_path / "a.yaml").write_text("cell: 0.1\nseed: 4\n")
    plain = choice_of("--algorithms", "tsd", "tsd@original", "crsm")
    given = ["--params", f"tsd:{tmp_path / 'a.yaml'}", "--set", "tsd:cell=0.05"]
    given += ["--seed", "3", "--seed", "crsm:5", "--set", "slams.baselines:Odometry:seed=9"]
    labels = ("tsd", "tsd@original", "crsm", "slams.baselines:Odometry")
    found = choice_of("--algorithms", *labels, *given)
    assert found["tsd"] == plain["tsd"].replace(cell=0.05, seed=4)
    assert found["tsd@original"] == plain["tsd@original"].replace(seed=3)
    assert found["crsm"] == plain["crsm"].replace(seed=5)
    assert found["slams.baselines:Odometry"].seed == 9


def test_a_variant_is_a_row_with_its_own_settings():
    words = "--algorithms", "hector@paper", "hector@paper:resolution=0.1,levels=2"
    params = choice_of(*words)
    plain, variant = (params[label] for label in words[1:])
    assert variant == plain.replace(resolution=0.1, levels=2)
    log = drive(n=3)
    outcome = replayed(words[2], log, Choice(params=params))
    assert outcome.row["algorithm"] == words[2]
    assert outcome.grid.resolution == 0.1


def test_quick_is_a_minute_of_the_log():
    arguments = compare_options.parser().parse_args(["--quick", "--every", "2"])
    choice, _ = compare_options.checked(arguments, [])
    assert len(choice.part(drive(80, 1.0))) == 30


def test_the_last_seed_for_all_counts():
    assert seeds(["1", "tsd:2", "3"]) == ({"seed": "3"}, ["tsd:seed=2"])
    assert seeds([]) == ({}, [])


def test_results_are_named_after_the_log_and_a_taken_name_gets_a_number(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def claimed(*logs, **more):
        return folder.claimed(**{"out": None, "logs": logs, "force": False} | more)

    assert claimed() == folder.RESULTS_FOLDER / "compare"
    assert claimed("bags/drive.bag") == folder.RESULTS_FOLDER / "compare-drive"
    assert folder.named_after("sweep", ["a/room.npz"]) == folder.RESULTS_FOLDER / "sweep-room"
    assert claimed("a.npz", "b.log.gz") == folder.RESULTS_FOLDER / "compare-a-b"
    (tmp_path / "results" / "compare-drive").mkdir(parents=True)
    assert claimed("drive.bag").name == "compare-drive-2"
    (tmp_path / "results" / "compare-drive" / "results.json").touch()
    assert claimed("drive.bag", force=True).name == "compare-drive"


def test_what_is_in_the_folder_asked_for_is_not_overwritten(tmp_path):
    mine, theirs = tmp_path / "mine", tmp_path / "theirs"
    for place, name in ((mine, "results.json"), (theirs, "thesis.tex")):
        place.mkdir()
        (place / name).touch()
    for force in (False, True):
        with pytest.raises(FileExistsError, match="files that are not results"):
            folder.claimed(str(theirs), [], force)
    with pytest.raises(FileExistsError, match="--force to replace"):
        folder.claimed(str(mine), [], False)
    assert folder.claimed(str(mine), [], True) == mine


def test_no_stale_file_stays_beside_a_new_report(room_file, tmp_path, capsys, here):
    out = tmp_path / "out"
    words = [room_file, "-q", "--jobs", "1", "--out", str(out), "--algorithms"]
    assert compare.main([*words, "odometry", "tests.bench.test_html:Still"]) == 0
    (out / "notes.txt").touch()
    assert compare.main([*words, "odometry"]) == 2
    assert "has results already" in capsys.readouterr().err
    assert (out / "errors-tests.bench.test_html.Still.csv").exists()
    log = shutil.move(room_file, out / "rescue-0.npz")  # as an earlier call may have simulated it
    other = shutil.copy(out / "trajectory-odometry.tum", out / "trajectory-other.tum")
    words = [str(log), *words[1:], "odometry", "--trajectory", f"theirs={other}", "--force"]
    assert compare.main(words) == 0
    names = {path.name for path in out.iterdir()}
    assert {"notes.txt", "errors-odometry.csv", "report.html", log.name, other.name} <= names
    assert not [name for name in names if "Still" in name]


def asked(*words):
    return compare_options.labels_of(compare_options.parser().parse_args(words))


def test_the_ideas_are_compared_where_there_are_any(monkeypatch):
    known = asked()
    assert known[-len(names()) :] == names()
    assert "hector@paper" in known
    full = asked("--full")
    assert full[0] == "hector@original"
    assert full[4:] == known
    assert asked("--full", "--algorithms", "kiss") == asked("--algorithms", "kiss") == ["kiss"]
    monkeypatch.setattr(HectorParams, "PRESETS", {})
    assert "hector@paper" not in asked()


def test_starts_are_even_over_a_tenth_of_the_log():
    assert start_scans(5505, 19)[:2] == [0, 28] and start_scans(5505, 19)[-1] == 500
    assert start_scans(1000, 5) == [0, 25, 50, 75, 100]
    assert start_scans(1000, 1) == [0]
    assert start_scans(25, 10) == [0, 1, 2], "a short log has no more"
    assert start_scans(1, 3) == [0]


@pytest.mark.parametrize(
    ("errors", "above", "mean", "median", "worst"),
    [
        ([0.02, 0.05, 0.01, 0.04], 2, 0.03, 0.03, 0.05),
        ([0.02, None, 0.04], 2, 0.03, 0.04, math.inf),  # a lost run is as bad as can be
        ([0.02, None], 1, 0.02, math.inf, math.inf),
        ([None, None], 2, math.nan, math.inf, math.inf),
    ],
)
def test_starts_by_hand(errors, above, mean, median, worst):
    found = spread_over_starts(errors, 0.03)
    assert (found["n"], found["above"]) == (len(errors), above)
    figures = [found[name] for name in ("mean", "median", "worst")]
    assert figures == pytest.approx([mean, median, worst], nan_ok=True)


def planned(chosen):
    drives = plan.Drives(["rescue"], 2, 10.0, "utm30lx")
    logs = plan.logs_of([], drives, SourceOptions())
    return plan.Plan(["hector"], plan.conditions_of(chosen), logs, (False,), None, None)


def test_each_drive_has_its_own_mishap_and_a_clean_one_none(tmp_path):
    for chosen, expected in (("clean", [0, 0]), ("noise=0.05", [0, 1])):
        cases = planned([chosen]).cases(tmp_path)
        assert [case.known["seed"] for case in cases] == [0, 1]
        assert [case.task.what["condition"]["seed"] for case in cases] == expected


def test_a_name_alone_is_all_its_levels_and_levels_by_hand_are_one_climb():
    assert plan.conditions_of(["noise"]) == {"noise": CATALOG["noise"].levels}
    found = plan.conditions_of(["noise=0.3", "beams", "noise=0.01", "clean"])
    counts = [(name, len(levels)) for name, levels in found.items()]
    assert counts == [("clean", 1), ("beams", 8), ("noise", 2)]
    assert found["noise"] == (0.01, 0.3)
    found = plan.conditions_of(["beams=20", "beams=60", "beams=20", "bias=-0.2", "bias=0.1"])
    assert found == {"beams": (60, 20), "bias": (0.1, -0.2)}, "from mild to severe, each once"
    assert len(plan.conditions_of(["all"])) == len(CATALOG)


@pytest.mark.parametrize(
    ("words", "rate", "sensor"),
    [
        ([], 10.0, None),
        (["--rate", "0", "--sensor", "utm30lx"], None, None),
        (["--rate", "5", "--sensor", "rplidar-a1"], 5.0, "rplidar-a1"),
    ],
)
def test_rate_and_sensor_are_those_that_were_asked_for(words, rate, sensor):
    twice = ["--arenas", "ring", "ring", "--algorithms", "tsd", "tsd", *words]
    made = sweep._plan(sweep.parser().parse_args(twice))
    assert (made.algorithms, len(made.logs)) == (["tsd"], sweep.N_DRIVES)
    assert (made.rate, made.sensor, made.odometry) == (rate, sensor, (False, True))


def test_a_sweep_of_which_nothing_came_fails(tmp_path, monkeypatch):
    failed = {"failed": "MemoryError"}
    monkeypatch.setattr(sweep, "_do", lambda cases, *_: {c.task.key: failed for c in cases})
    words = ["--arenas", "rescue", "--algorithms", "hector", "--degradations", "clean"]
    words += ["--seeds", "1", "-q", "--out", str(tmp_path / "out")]
    assert sweep.main(words) == cli.EXIT_FAILED
    assert "MemoryError" in (tmp_path / "out" / "sweep.json").read_text()
