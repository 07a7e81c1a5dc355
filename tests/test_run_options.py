"""Sensor presets and ROS files on the command line: order of loading, what is said, exit codes."""

import json

import pytest

from slams import run
from slams.__main__ import main
from tests.rooms import command, drive

ROS = "map_resolution: 0.1\nmap_multi_res_levels: 2\nmap_frame: map\nlaser_max_dist: 12.0\n"


@pytest.fixture
def ros(tmp_path):
    path = tmp_path / "ros.yaml"
    path.write_text(ROS)
    return path


@pytest.fixture
def log(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drive(n=5).save(tmp_path / "a.npz")  # called "room" by its meta
    return "a.npz"


def shown(capsys, *arguments):
    """Values that --show-params prints."""
    assert command(*arguments, "--show-params") == 0
    lines = [line.partition("  #")[0] for line in capsys.readouterr().out.splitlines()]
    return dict(line.split(": ", 1) for line in map(str.strip, lines))


def test_later_in_the_list_wins(capsys, tmp_path, ros):
    (tmp_path / "p.yaml").write_text("levels: 4\nmax_range: 9.0\n")
    assert command("hector", "--sensor", "lds02", "--show-params") == 0
    assert capsys.readouterr().err == "note: --sensor lds02 sets nothing for hector\n"
    sensor = ["hector@original", "--sensor", "lds02"]
    assert shown(capsys, "hector@original")["start"] == "last"
    values = shown(capsys, *sensor)
    assert (values["start"], values["deskew"], values["max_turn"]) == ("auto", "true", "0.2")
    values = shown(capsys, *sensor, "--ros-params", ros)
    assert (values["resolution"], values["levels"], values["start"]) == ("0.1", "2", "auto")
    values = shown(capsys, *sensor, "--params", tmp_path / "p.yaml", "--ros-params", ros)
    assert (values["resolution"], values["levels"], values["max_range"]) == ("0.1", "4", "9.0")
    every = ["--ros-params", ros, "--params", tmp_path / "p.yaml", "--set", "levels=1"]
    assert shown(capsys, *sensor, *every)["levels"] == "1"


def test_shown_parameters_tell_unit_and_names_in_ros_and_read_back(capsys, tmp_path):
    assert command("hector@original", "--show-params") == 0
    text = capsys.readouterr().out
    assert "levels: 2 " in text
    assert "[m] cell of the finest level" in text
    assert "; ROS: map_resolution)" in text
    text = text.replace("levels: 2 ", "levels: 5 ")
    (tmp_path / "all.yaml").write_text(text)
    assert command("hector@original", "--show-params", "--params", tmp_path / "all.yaml") == 0
    assert capsys.readouterr().out == text


def test_what_became_of_each_parameter_goes_to_stderr(log, capsys, tmp_path, ros):
    out = tmp_path / "o"
    assert command("hector", log, "--out", out, "--ros-params", ros) == 0
    printed = capsys.readouterr()
    assert printed.err.startswith("hector_mapping -> hector: 3 mapped, 1 ignored\n")
    assert "  map_resolution = 0.1: resolution = 0.1 [m]\n" in printed.err
    assert "hector_mapping" not in printed.out
    summary = json.loads((out / "summary.json").read_text())
    assert summary["parameters"]["resolution"] == 0.1
    assert summary["ros_params"]["files"] == [str(ros)]
    fates = {fate["name"]: fate["fate"] for fate in summary["ros_params"]["parameters"]}
    assert (fates["map_resolution"], fates["map_frame"]) == ("mapped", "ignored")
    assert command("hector", log, "--out", out, "--ros-params", ros, "-q", "--force") == 0
    assert capsys.readouterr() == ("", "")
    assert command("hector", log, "--out", out, "-q", "--force") == 0
    assert "ros_params" not in json.loads((out / "summary.json").read_text())


def test_results_are_named_after_the_file_and_replaced_only_if_asked(log, tmp_path, capsys):
    words = ["odometry", log, "-q"]
    assert run.main([*words, "--mcap"]) == 0
    out = tmp_path / "results" / "a-odometry"
    (out / "mine.txt").write_text("mine")
    before = {path: path.read_bytes() for path in out.iterdir()}
    assert run.main([*words, "--limit", "3"]) == 2
    assert "results/a-odometry: exists; --force replaces it" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in out.iterdir()} == before
    assert run.main([*words, "--limit", "3", "--force"]) == 0
    assert not (out / "result.mcap").exists(), "of the earlier run"
    assert (out / "mine.txt").read_text() == "mine"
    assert {*run.files_of_run(out), "mine.txt"} == {path.name for path in out.iterdir()}


@pytest.mark.parametrize(
    "words",
    [["run", "odometry", "a.npz", "-q", "--save-state"], ["convert", "a.npz", "-q"]],
    ids=["state", "npz"],
)
def test_no_file_is_overwritten_unless_asked(words, log, tmp_path, capsys):
    target = {"--save-state": "x.state"}.get(words[-1], "x.npz")
    (tmp_path / target).write_text("mine")
    assert main([*words, target]) == 2
    sentence = f"{target}: exists; --force replaces it, or choose another name"
    assert capsys.readouterr().err == f"slams {words[0]}: {sentence}\n"
    assert (tmp_path / target).read_text() == "mine"
    assert main([*words, target, "--force"]) == 0
    assert (tmp_path / target).read_bytes() != b"mine"
