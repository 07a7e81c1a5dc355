"""Sensor presets and ROS files on the command line: order of loading, what is said, exit codes."""

import json
import subprocess
import sys

import pytest

from slams import check, run
from slams.registry import find
from tests.places import ROOT
from tests.rooms import drive

ROS = "map_resolution: 0.1\nmap_multi_res_levels: 2\nmap_frame: map\nlaser_max_dist: 12.0\n"


@pytest.fixture
def ros(tmp_path):
    path = tmp_path / "ros.yaml"
    path.write_text(ROS)
    return path


def command(*arguments):
    return run.main([str(argument) for argument in arguments])


def shown(capsys, *arguments):
    """Values that --show-params prints."""
    assert command(*arguments, "--show-params") == 0
    lines = [line.partition("  #")[0] for line in capsys.readouterr().out.splitlines()]
    return dict(line.split(": ", 1) for line in map(str.strip, lines))


def test_later_in_the_list_wins(capsys, tmp_path, ros):
    (tmp_path / "p.yaml").write_text("levels: 4\nmax_range: 9.0\n")
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


def test_show_params_tells_the_names_in_ros_and_reads_back(capsys, tmp_path):
    assert command("tsd", "--show-params") == 0
    text = capsys.readouterr().out
    assert "original code: 3 cells; ROS: truncation_radius)" in text
    (tmp_path / "p.yaml").write_text(text)
    assert find("tsd").cls.Params().with_yaml(tmp_path / "p.yaml") == find("tsd").cls.Params()


def test_what_became_of_each_parameter_goes_to_stderr(capsys, tmp_path, ros):
    log = tmp_path / "room.npz"
    drive(n=5).save(log)
    out = tmp_path / "o"
    assert command("hector", log, "--out", out, "--ros-params", ros) == 0
    told = capsys.readouterr()
    assert told.err.startswith("hector_mapping -> hector: 3 mapped, 1 ignored\n")
    assert "  map_resolution = 0.1: resolution = 0.1 [m]\n" in told.err
    assert "hector_mapping" not in told.out
    assert json.loads((out / "summary.json").read_text())["parameters"]["resolution"] == 0.1
    assert command("hector", log, "--out", out, "--ros-params", ros, "-q") == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["hector", "--sensor", "lsd01"], "unknown sensor 'lsd01'; did you mean 'lds01'"),
        (["hector", "--ros-params", "none.yaml"], "none.yaml: no such file or directory"),
        (["kiss", "--ros-params", "ROS"], "Kiss has no original in ROS"),
        (["tsd", "--ros-params", "ROS"], "ros.yaml: no parameter of"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(capsys, ros, arguments, sentence):
    given = [ros if argument == "ROS" else argument for argument in arguments]
    assert command(*given, "--show-params") == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("slams run: ")
    assert sentence in told.err
    assert told.err.count("\n") == 1


@pytest.mark.parametrize("module", ["slams.run", "slams.check"])
def test_help_loads_no_heavy_library(module):
    code = (
        f"import runpy, sys\nsys.argv = ['x', '--help']\n"
        f"try:\n    runpy.run_module({module!r}, run_name='__main__')\nexcept SystemExit: pass\n"
        "heavy = {'numba', 'pandas', 'matplotlib', 'cv2', 'rerun', 'rosbags', 'scipy', 'PIL'}\n"
        "print('\\nloaded:', sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.rstrip().endswith("loaded: []")


def test_the_check_is_a_command_like_the_others(capsys):
    assert check.main([]) == 2
    assert check.main(["hecter"]) == 2
    assert "did you mean 'hector'" in capsys.readouterr().err
