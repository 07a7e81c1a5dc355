"""Files as they are written, and maps as other programs write them; what is refused."""

import json
import math
import os
import platform
from dataclasses import replace

import cv2
import numpy as np
import pytest
import yaml

import slams
from slams import convert
from slams.formats import files, occupancy, trajectory
from slams.formats.occupancy import picture, trinary
from slams.types import OccupancyGrid
from tests.rooms import drive

GRID = OccupancyGrid(np.array([[0.9, 0.1, np.nan], [0.5, 0.0, 1.0]], np.float32), 0.05, (-1.0, 2.0))


def test_map_server_pair_reads_back_to_the_same_cells(tmp_path):
    occupancy.write_map(tmp_path, GRID)
    entries = yaml.safe_load((tmp_path / "map.yaml").read_text())
    assert (entries["free_thresh"], entries["occupied_thresh"]) == (0.196, 0.65)
    assert (entries["mode"], entries["negate"]) == ("trinary", 0)
    pixels = cv2.imread(str(tmp_path / "map.pgm"), cv2.IMREAD_GRAYSCALE)
    assert pixels.tolist() == [[205, 254, 0], [0, 254, 205]]  # row 0 = highest y
    grid = occupancy.read_map(tmp_path / "map.yaml")
    expected = np.array([[1.0, 0.0, np.nan], [np.nan, 0.0, 1.0]], np.float32)
    assert np.array_equal(grid.p, expected, equal_nan=True)
    assert (grid.resolution, grid.origin) == (0.05, (-1.0, 2.0))


def test_a_folder_appears_whole_or_not_at_all(tmp_path):
    out = tmp_path / "deep" / "out"
    left = out.with_name(f".out.{platform.node()}.{os.getpid()}.part")  # by a run that was killed
    left.mkdir(parents=True)
    (left / "old.txt").write_text("half")
    with pytest.raises(RuntimeError, match="half"), files.complete_folder(out) as folder:
        (folder / "a.txt").write_text("half")
        raise RuntimeError("half way")
    assert not out.exists()
    assert list(out.parent.iterdir()) == []
    with files.complete_folder(out) as folder:
        (folder / "a.txt").write_text("1")
    assert [p.name for p in out.iterdir()] == ["a.txt"]
    (out / "mine.txt").write_text("kept")
    with files.complete_folder(out) as folder:
        (folder / "a.txt").write_text("2")
        (folder / "sub").mkdir()
        (folder / "sub" / "b.json").write_text(json.dumps(1))
    assert (out / "a.txt").read_text() == "2"
    assert (out / "mine.txt").read_text() == "kept"
    assert (out / "sub" / "b.json").is_file()
    assert sorted(p.name for p in out.parent.iterdir()) == ["out"]


def test_a_folder_by_a_name_that_is_none(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    for name in (".", "../here", "../here/."):
        with files.complete_folder(name) as folder:
            (folder / "a.txt").write_text(name)
        assert (tmp_path / "here" / "a.txt").read_text() == name
    assert [p.name for p in tmp_path.iterdir()] == ["here"]


def test_tracks_of_an_npz_can_be_left_out(tmp_path):
    drive(n=3).save(tmp_path / "room.npz")
    log = slams.load(tmp_path / "room.npz", odom="none", imu="none", truth="none")
    assert (log.odom, log.yaw_rate, log.truth, log.notes) == (None, None, None, ())
    log = slams.load(tmp_path / "room.npz", odom="/odom", scan_topic="/scan")
    assert log.odom is not None
    assert log.notes == ("--scan-topic, --odom: nothing to choose in an npz file",)


def test_notes_of_a_conversion_stay(tmp_path):
    room = drive(n=3)
    odom = slams.scanlog.TimeSeries(room.t + 100.0, room.odom.values)
    replace(room, odom=odom, meta={"notes": ["the laser is tilted"]}).save(tmp_path / "room.npz")
    for _ in range(2):
        log = slams.load(tmp_path / "room.npz")
        (note,) = log.notes
        assert note.endswith("0 of 3 scans: 100.000 to 100.100 s, the scans 0.000 to 0.100 s")
        assert log.meta["notes"] == ["the laser is tilted", *log.notes]
        log.save(tmp_path / "room.npz")


@pytest.mark.parametrize("source", ["the lab", None, ["a"]])
def test_an_npz_of_others_says_what_it_likes_about_its_source(source, tmp_path, capsys):
    replace(drive(n=3), meta={"source": source}).save(tmp_path / "a.npz")
    trajectory.write_tum(tmp_path / "t.tum", np.arange(2.0), np.zeros((2, 3)))
    arguments = [str(tmp_path / "a.npz"), str(tmp_path / "b.npz")]
    assert convert.main([*arguments, "--truth", str(tmp_path / "t.tum")]) == 0
    assert "odometry: 3 stamps, 20.0 Hz\n" in capsys.readouterr().out
    assert slams.load(tmp_path / "b.npz").meta["source"] == source


def a_map(tmp_path, pixels, **changes):
    cv2.imwrite(str(tmp_path / "m.png"), np.array(pixels, np.uint8))
    entries = {"image": "m.png", "resolution": 0.1, "origin": [1.0, 2.0, 0.0], "negate": 0}
    entries |= {"occupied_thresh": 0.65, "free_thresh": 0.196}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(entries | changes))
    return tmp_path / "m.yaml"


def cells(path, notes=None):
    return occupancy.read_map(path, notes).p.tolist()


def same(found, expected):
    assert np.array(found) == pytest.approx(np.array(expected), nan_ok=True, abs=1e-6)


def test_trinary_maps(tmp_path):
    same(cells(a_map(tmp_path, [[0, 254], [205, 100]])), [[np.nan, np.nan], [1, 0]])
    same(cells(a_map(tmp_path, [[0, 254, 50]], negate=1)), [[0, 1, np.nan]])
    same(cells(a_map(tmp_path, [[30, 128, 220]])), [[1, np.nan, 0]])  # as cartographer has them
    colors = [[[0, 0, 255], [0, 255, 255], [255, 255, 255]]]  # are averaged
    same(cells(a_map(tmp_path, colors)), [[1, np.nan, 0]])


HEADS = {
    "slam_toolbox": "image: map.pgm\nmode: trinary\nresolution: 0.05\norigin: [-1.5, -2, 0]\n"
    "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n",
    "map_saver": "image: {folder}/map.pgm\nresolution: 0.050000\n"
    "origin: [-1.500000, -2.000000, 0.000000]\nnegate: 0\noccupied_thresh: 0.65\n"
    "free_thresh: 0.196\n\n",
}


@pytest.mark.parametrize("program", HEADS)
def test_maps_that_other_programs_save(program, tmp_path):
    comment = b"# CREATOR: map_saver.cpp 0.050 m/pix\n"
    (tmp_path / "map.pgm").write_bytes(b"P5\n" + comment + b"3 2\n255\n" + bytes([0, 254, 205] * 2))
    (tmp_path / "map.yaml").write_text(HEADS[program].format(folder=tmp_path))
    grid = occupancy.read_map(tmp_path / "map.yaml")
    same(grid.p, [[1, 0, np.nan]] * 2)
    assert (grid.resolution, grid.origin) == (0.05, (-1.5, -2.0))


@pytest.mark.parametrize("negate", [0, 1])
def test_the_trap_of_the_old_threshold_is_told_and_avoided(negate, tmp_path):
    def pixels(*grays):
        return [[255 - gray if negate else gray for gray in grays]]

    trap, notes = {"free_thresh": 0.25, "negate": negate}, []
    same(cells(a_map(tmp_path, pixels(0, 254, 205), **trap), notes), [[1, 0, np.nan]])
    assert "make the gray of unknown cells (205) free; they are taken as unknown" in notes[0]
    notes.clear()
    cells(a_map(tmp_path, [[0, 254]], free_thresh=0.25), notes)
    cells(a_map(tmp_path, [[0, 254, 205]]), notes)
    assert notes == []


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"origin": [0.0, 0.0, 0.5]}, "origin 0, 0, 0.5, .* expected .* yaw 0"),
        ({"origin": 3}, "not a number"),
        ({"origin": [0.0]}, "not a number"),
        ({"origin": ["a", 0.0]}, "not a number"),
        ({"negate": math.inf}, "not a number"),
        ({"resolution": 10**400}, "not a number"),
        ({"free_thresh": math.nan}, "thresholds 0.65, nan; expected"),
        ({"mode": "scale"}, "mode: got scale, expected trinary; save it"),
        ({"resolution": 0.0}, "resolution 0, .* expected a resolution above 0"),
        ({"resolution": "fine"}, "not a number"),
        ({"image": "none.png"}, "its picture none.png is not in"),
        ({"image": "m.yaml"}, "not a picture"),
        (b"- 1\n- 2\n", "expected the yaml of a map"),
        (b"image: none.pgm\n", "no resolution, origin; expected the yaml of a map"),
        (b"made: 2024-99-99\n", "m.yaml: not a YAML file .month must be in"),
        (b"\xff\xfe", "m.yaml: not text"),
    ],
)
def test_other_maps_are_refused(changes, sentence, tmp_path):
    is_text = isinstance(changes, bytes)
    path = a_map(tmp_path, [[0, 254]], **({} if is_text else changes))
    if is_text:
        path.write_bytes(changes)
    with pytest.raises((ValueError, OSError), match=sentence) as caught:
        occupancy.read_map(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"P5\n100000 100000\n255\n0000",  # OpenCV refuses the size by an error of its own
        b"P5\n3 4\n255\n00000",
        b"\x89PNG\r\n\x1a\n00000",
    ],
)
def test_a_picture_that_is_none_is_one_sentence(content, tmp_path, capfd):
    (tmp_path / "m.pgm").write_bytes(content)
    with pytest.raises(ValueError, match=r"m\.pgm: not a picture; expected pgm"):
        occupancy.read_picture(tmp_path / "m.pgm")
    with pytest.raises(OSError, match="No such file") as caught:
        occupancy.read_picture(tmp_path / "none.pgm")
    assert caught.value.filename == str(tmp_path / "none.pgm")
    assert capfd.readouterr().err == ""


def test_a_map_without_cells_is_not_written(tmp_path):
    with pytest.raises(OSError, match="could not be written"):
        occupancy.write_map(tmp_path, OccupancyGrid(np.zeros((0, 0), np.float32), 0.1, (0.0, 0.0)))


def test_the_highest_y_is_on_top_and_the_path_lies_in_the_map(tmp_path):
    p = np.full((20, 10), np.nan, np.float32)
    p[0], p[-1] = 1.0, 0.0
    grid = OccupancyGrid(p, 0.1, (0.0, 0.0))
    assert trinary(grid)[:, 0].tolist() == [254, *18 * [205], 0]
    path = np.array([(0.5, y, 0.0) for y in np.linspace(0.3, 0.8, 20)])
    image = picture(grid, path, least=200).astype(int)
    drawn = np.abs(image[:, :, 2] - image[:, :, 0]).max(axis=1) > 60
    rows = np.flatnonzero(drawn) / image.shape[0]  # 0 on top, where y is 2
    assert rows.min() > 0.5 and rows.max() < 1.0
