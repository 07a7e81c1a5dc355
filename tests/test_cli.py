"""Both commands as a user types them."""

import json

import cv2
import numpy as np
import pytest
import yaml

from bench import compare
from slams import run as slams_run
from slams.formats import trajectory
from slams.scanlog import load_npz
from tests.processes import python
from tests.rooms import drive, rewritten


@pytest.fixture(scope="module")
def log_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "room.npz"
    drive(n=60).save(path)
    return path


def command(*arguments, cwd, module="slams.run"):
    return python("-m", module, *arguments, cwd=cwd)


def test_run_writes_everything_and_says_so(log_file, tmp_path):
    done = command("hector", log_file, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "hector on room: 60 scans in 3.0 s" in done.stdout
    assert "error against the truth" in done.stdout
    assert "per update" in done.stdout
    out = tmp_path / "results" / "room-hector"
    files = ["map.pgm", "map.png", "map.yaml", "summary.json", "trajectory.csv", "trajectory.tum"]
    assert sorted(p.name for p in out.iterdir()) == files
    summary = json.loads((out / "summary.json").read_text())
    assert summary["scans"] == 60
    assert summary["cpu_ms_per_scan"] > 0.0
    assert summary["compile_s"] >= 0.0
    assert summary["parameters"]["resolution"] == 0.05
    assert summary["versions"]["numba"]
    assert summary["errors"]["per_update"]["translation_m"]["mean"] < 0.005
    t, poses = trajectory.read(out / "trajectory.tum")
    assert (len(t), poses.shape) == (60, (60, 3))
    assert yaml.safe_load((out / "map.yaml").read_text())["free_thresh"] == 0.196
    assert cv2.imread(str(out / "map.png")).std() > 10.0


def test_the_same_command_gives_the_same_files(log_file, tmp_path):
    for name in ("a", "b"):
        assert slams_run.main(["hector", str(log_file), "--out", str(tmp_path / name), "-q"]) == 0
    for name in ("trajectory.csv", "map.pgm", "map.png", "map.yaml"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_options_change_the_run(log_file, tmp_path, capsys):
    out = tmp_path / "o"
    (tmp_path / "p.yaml").write_text("resolution: 0.1\nlevels: 2\n")
    options = ["--params", str(tmp_path / "p.yaml"), "--set", "levels=1", "--seed", "7"]
    options += ["--limit", "10", "--every", "2", "--no-odometry"]
    assert slams_run.main(["hector@original", str(log_file), "--out", str(out), *options]) == 0
    summary = json.loads((out / "summary.json").read_text())
    p = summary["parameters"]
    assert (p["resolution"], p["levels"], p["seed"], p["start"]) == (0.1, 1, 7, "last")
    assert (summary["scans"], summary["report"]["odometry"]) == (10, 0)
    assert summary["algorithm"] == "hector@original"
    assert "hector@original on room: 10 scans" in capsys.readouterr().out


@pytest.mark.parametrize("out", ["f", "f/deep/out", None])
def test_an_output_that_is_a_file_is_refused_at_once(out, log_file, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("slams.player.warm_up", lambda *_: pytest.fail("the run began"))
    name = "f" if out else "results"
    (tmp_path / name).write_text("mine")
    more = ["--out", out] if out else []
    assert slams_run.main(["odometry", str(log_file), *more]) == 2
    said = capsys.readouterr().err
    assert said == f"slams run: {name}: is a file; expected a folder for the results\n"
    assert (tmp_path / name).read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("option", ["--out", "--save-state"])
def test_a_folder_that_cannot_be_written_is_refused_at_once(option, log_file, monkeypatch, capsys):
    monkeypatch.setattr("slams.player.warm_up", lambda *_: pytest.fail("the run began"))
    kept = log_file.parent / "kept"
    kept.mkdir(exist_ok=True)
    monkeypatch.setattr("os.access", lambda path, mode: path != kept)  # root may write anywhere
    assert slams_run.main(["odometry", str(log_file), option, str(kept / "new")]) == 2
    said = f"slams run: {kept}: permission denied; expected a folder that can be written\n"
    assert capsys.readouterr().err == said


def test_odd_scans_survive_and_are_counted(log_file, tmp_path, capsys):
    log = load_npz(log_file)
    t, ranges = log.t.copy(), log.ranges.copy()
    t[20], ranges[[5, 6]], ranges[7] = 0.0, np.nan, np.inf
    rewritten(log_file, tmp_path / "odd.npz", t=t, ranges=ranges)
    out = tmp_path / "out"
    assert slams_run.main(["hector", str(tmp_path / "odd.npz"), "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "1 stamps jump back" in text
    assert "3 scans have no return" in text
    summary = json.loads((out / "summary.json").read_text())
    assert summary["errors"]["end_m"] < 0.02
    assert summary["report"]["empty"] == 3


def test_compare_on_given_logs(log_file, tmp_path):
    names = ["hector", "hector@original", "odometry", "kiss"]
    words = [log_file, "--algorithms", *names, "--out", "cmp"]
    done = command(*words, cwd=tmp_path, module="bench.compare")
    assert done.returncode == 0, done.stderr
    answer, *screen, report = done.stdout.splitlines()
    assert answer.startswith("Take hector: ")
    assert len(screen) < 20
    assert [line.split()[0] for line in screen[-4:]] == names
    assert report == "The report: cmp/report.html; tables, figures and results.json beside it."
    out = tmp_path / "cmp"
    results = json.loads((out / "results.json").read_text())
    assert [row["algorithm"] for row in results["rows"]] == names
    by_name = {row["algorithm"]: row for row in results["rows"]}
    updates = {n: r["errors"]["spans"]["update"]["translation_m"] for n, r in by_name.items()}
    means = {name: update["mean"] for name, update in updates.items()}
    assert means["hector"] < means["kiss"]
    for name in ("fig2_translation", "fig3_orientation", "fig4_maps"):
        assert cv2.imread(str(out / f"{name}.png")).std() > 5.0
        assert (out / f"{name}.pdf").read_bytes().startswith(b"%PDF")
    table = np.genfromtxt(out / "errors-hector.csv", delimiter=",", names=True)
    assert len(table) == 59
    assert table["translation_m"].mean() == pytest.approx(means["hector"], abs=1e-8)
    assert (out / "errors-hector-original.csv").is_file()
    translation = (out / "table-translation.csv").read_text()
    assert translation.startswith("algorithm,mean,deviation,min,max")


def test_compare_with_relations_and_without_truth(log_file, tmp_path, capsys):
    rewritten(log_file, tmp_path / "l.npz", truth=None, truth_t=None)
    t = load_npz(log_file).t
    lines = [f"{t[k]:.6f} {t[k + 20]:.6f} 0 0 0 0 0 0" for k in range(10)]
    (tmp_path / "l.relations").write_text("\n".join(lines) + "\n1e9 2e9 0 0 0 0 0 0\n")
    arguments = [str(tmp_path / "l.npz"), "--algorithms", "odometry", "--jobs", "1"]
    arguments += ["--relations", str(tmp_path / "l.relations"), "--out", str(tmp_path / "out")]
    assert compare.main(arguments) == 0
    out = capsys.readouterr().out
    assert "relations [mm]" in out
    assert "note: 10 of 11 relations have both stamps in the log" in out
    row = json.loads((tmp_path / "out" / "results.json").read_text())["rows"][0]
    assert (row["relations"]["used"], row["relations"]["given"]) == (10, 11)


def test_compare_takes_the_files_of_ros_nodes(log_file, tmp_path, capsys):
    for name, text in (
        ("a=1.yaml", "map_resolution: 0.1\nmap_frame: map\nlaser_max_dist: 12.0\n"),
        ("b.yaml", "map_resolution: 0.2\n"),
        ("o.yaml", "laser_max_dist: 9.0\n"),
    ):
        (tmp_path / name).write_text(text)
    algorithms = ["hector@original", "hector", "crsm@original"]
    arguments = [str(log_file), "--algorithms", *algorithms, "--limit", "4", "--seed", "7"]
    files = [("hector", "a=1.yaml"), ("hector@original", "o.yaml"), ("hector", "b.yaml")]
    for label, name in files:
        arguments += ["--ros-params", f"{label}={tmp_path / name}"]
    arguments += ["--sensor", "lds02", "--out", str(tmp_path / "out")]
    assert compare.main(arguments) == 0
    message = capsys.readouterr().err
    head = "hector_mapping -> hector: 2 mapped, 1 ignored\n  map_resolution = 0.2"
    assert message.startswith(head)
    assert "hector_mapping -> hector@original: 1 mapped, " in message
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    original, hector, crsm = (row["parameters"] for row in results["rows"])
    assert (hector["resolution"], hector["max_range"], hector["seed"]) == (0.2, 12.0, 7)
    assert (original["resolution"], original["start"]) == (0.025, "auto"), "as the node's own"
    assert (crsm["hold"], crsm["seed"]) == (4, 7), "as the laser's, no file speaks of it"
    said = results["ros_params"]
    assert list(said) == ["hector", "hector@original"]
    assert said["hector"]["files"] == [str(tmp_path / "a=1.yaml"), str(tmp_path / "b.yaml")]
    became = {p["name"]: (p["value"], p["fate"], p["text"]) for p in said["hector"]["parameters"]}
    assert became["map_resolution"] == ("0.2", "mapped", "resolution = 0.2 [m]")
    assert became["map_frame"][:2] == ("map", "ignored")


def test_compare_survives_a_log_of_one_scan_and_a_truth_beside_it(log_file, tmp_path, capsys):
    truth, part = load_npz(log_file).truth, np.r_[:15, 45:60]
    rewritten(log_file, tmp_path / "beside.npz", truth_t=truth.t + 1e6)
    known = {"truth": truth.values[part], "truth_t": truth.t[part]}
    rewritten(log_file, tmp_path / "gap.npz", **known)
    for log, sentence in (
        (tmp_path / "beside.npz", "note: the truth covers 0 of 60 scans"),
        (tmp_path / "gap.npz", "note: the truth covers 30 of 60 scans; the others do not count"),
        (log_file, "note: one scan only"),
    ):
        more = ["--limit", "1"] if log is log_file else []
        out = str(tmp_path / f"o-{log.stem}")
        arguments = [str(log), "--algorithms", "odometry", "--out", out, *more]
        assert compare.main(arguments) == 0
        assert sentence in capsys.readouterr().out
