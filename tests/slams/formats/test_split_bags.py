"""Recordings in several files, the frames they name, and where options may stand."""

import math

import numpy as np
import pytest

import slams
from slams import convert, run
from slams.formats.mcap import frames_of
from tests import bags
from tests.rooms import drive
from tests.slams.formats.test_mcap import messages

T = 1e9 + 0.1 * np.arange(12)
HEAD = ("base_footprint", "base_scan", (0.1, 0.0, 0.2), 0.0, math.pi)  # upside down
ROWS = np.random.default_rng(0).uniform(0.5, 20.0, (12, 31)).astype(np.float32)


def part(first, last, static):
    """A stretch of a drive of a robot whose laser hangs upside down."""

    def made(make):
        found = [("/tf_static", T[first], make.tf(T[first], HEAD))] if static else []
        for t, row in zip(T[first:last], ROWS[first:last], strict=True):
            moving = ("odom", "base_footprint", (t - T[0], 0.0, 0.0), 0.0, 0.0)
            found += [
                ("/tf", t, make.tf(t, moving)),
                ("/scan", t, make.scan(t, row, frame="base_scan")),
                ("/odom", t, make.odometry(t, t - T[0], 0.0, 0.0, child="base_footprint")),
            ]
        return found

    return made


def split(folder, kind):
    return [
        bags.write(folder, kind, part(0, 7, True), "drive_0"),
        bags.write(folder, kind, part(7, 12, False), "drive_1"),
    ]


@pytest.mark.parametrize("kind", ["bag", "mcap", "db3", "folder-mcap"])
@pytest.mark.parametrize("salvage", [False, True])
def test_several_files_are_one_log(kind, salvage, tmp_path):
    whole = slams.load(bags.write(tmp_path / "whole", kind, part(0, 12, True)))
    assert whole.laser.angle_increment < 0.0
    files = split(tmp_path, kind)
    for order in (files, files[::-1]):
        log = slams.load(order, salvage=salvage)
        assert np.array_equal(log.t, whole.t)
        assert np.array_equal(log.ranges, whole.ranges)
        assert log.laser == whole.laser
        assert np.array_equal(log.odom.values, whole.odom.values)
        assert log.name == order[0].name.partition(".")[0]
    with pytest.raises(ValueError, match=r"no laser scans on /side; there are: /scan \(12\)"):
        slams.load(files, salvage=salvage, scan_topic="/side")


def test_a_file_without_the_static_transforms_of_its_drive_is_refused(tmp_path):
    _, second = split(tmp_path, "bag")
    sentence = r"no transform from .*base_footprint.* base_scan"
    with pytest.raises(ValueError, match=sentence) as caught:
        slams.load(second)
    assert "give all files" in str(caught.value) and str(second) in str(caught.value)
    log = slams.load(second, base_frame="base_scan")  # said by the user
    assert log.laser.angle_increment > 0.0
    assert any("the laser is taken as the base" in note for note in log.notes)


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (["drive_0.bag", "room.npz"], "room.npz: is no bag; of several files"),
        (["drive_0.bag", "two/drive_1.mcap"], "of ROS 1, the others of ROS 2"),
        (["drive_0.bag", "none.bag"], "none.bag"),
        ([], "no log given"),
    ],
)
def test_files_that_are_not_of_one_log(names, sentence, tmp_path):
    split(tmp_path, "bag")
    split(tmp_path / "two", "mcap")
    drive(n=3).save(tmp_path / "room.npz")
    with pytest.raises((ValueError, OSError), match=sentence):
        slams.load([tmp_path / name for name in names])


def test_several_files_are_converted_into_one(tmp_path):
    out = tmp_path / "out.npz"
    assert convert.main([*map(str, split(tmp_path, "bag")), str(out), "-q"]) == 0
    assert len(slams.load(out)) == 12


@pytest.mark.parametrize(
    "words",
    [
        ["odometry", "--limit", "9", "LOG", "-q"],
        ["--limit", "9", "odometry", "LOG", "-q"],
        ["-q", "odometry", "--set", "seed=1", "LOG", "--limit", "9"],
    ],
)
def test_options_stand_anywhere_around_the_files_of_a_log(words, tmp_path):
    files, at = [str(path) for path in split(tmp_path, "bag")], words.index("LOG")
    given = [*words[:at], *files, *words[at + 1 :]]
    assert run.main([*given, "--out", str(tmp_path / "out")]) == 0
    assert len((tmp_path / "out" / "trajectory.tum").read_text().splitlines()) == 10


def test_the_result_names_frames_as_the_log_does(tmp_path, capsys):
    log = bags.write(tmp_path, "bag", part(0, 12, True))
    out = tmp_path / "out"
    assert run.main(["odometry", str(log), "--mcap", "--out", str(out)]) == 0
    assert capsys.readouterr().out.splitlines()[-1].count("result.mcap") == 1
    found = messages(out / "result.mcap")
    assert found["/scan"][0][1].header.frame_id == "base_scan"
    (moving,) = found["/tf"][0][1].transforms
    assert (moving.header.frame_id, moving.child_frame_id) == ("map", "base_footprint")
    (fixed,) = found["/tf_static"][0][1].transforms
    assert (fixed.header.frame_id, fixed.child_frame_id) == ("base_footprint", "base_scan")
    again = slams.load(out / "result.mcap")
    assert again.laser.mount == pytest.approx(slams.load(log).laser.mount)


@pytest.mark.parametrize(
    ("source", "frames"),
    [
        ({"base_frame": "b", "laser_frame": "l"}, ("b", "l")),
        ({"base_frame": "l", "laser_frame": "l"}, ("base_link", "l")),
        ({"base_frame": "base_link", "laser_frame": "base_link"}, ("base_link", "laser")),
        ({"base_frame": "map", "laser_frame": "map"}, ("base_link", "laser")),
        ({"base_frame": 3, "laser_frame": ""}, ("base_link", "laser")),
        ("text", ("base_link", "laser")),
    ],
)
def test_frames_never_make_a_circle(source, frames):
    assert frames_of({"source": source}) == frames
