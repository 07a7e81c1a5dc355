import json
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
from slams.types import OccupancyGrid
from tests.rooms import drive

GRID = OccupancyGrid(np.array([[0.9, 0.1, np.nan], [0.5, 0.0, 1.0]], np.float32), 0.05, (-1.0, 2.0))


def test_a_csv_saved_by_a_spreadsheet(tmp_path):
    (tmp_path / "t.csv").write_bytes("\ufefft,x,y,theta\r\n1,2,3,0.5\r\n".encode())
    t, poses = trajectory.read(tmp_path / "t.csv")
    assert (t.tolist(), poses.tolist()) == ([1.0], [[2.0, 3.0, 0.5]])


def test_tum_is_read_by_evo(tmp_path):
    file_interface = pytest.importorskip("evo.tools.file_interface")
    t, poses = np.array([10.0, 10.1]), np.array([[1.0, 2.0, 0.5], [-1.0, 0.5, -3.0]])
    trajectory.write_tum(tmp_path / "t.tum", t, poses)
    read = file_interface.read_tum_trajectory_file(tmp_path / "t.tum")
    assert read.timestamps == pytest.approx(t)
    assert read.positions_xyz[:, :2] == pytest.approx(poses[:, :2])
    yaw = [np.arctan2(T[1, 0], T[0, 0]) for T in read.poses_se3]
    assert yaw == pytest.approx(poses[:, 2], abs=1e-7)


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
    odom = slams.scanlog.Track(room.t + 100.0, room.odom.values)
    replace(room, odom=odom, meta={"notes": ["the laser is tilted"]}).save(tmp_path / "room.npz")
    for _ in range(2):
        log = slams.load(tmp_path / "room.npz")
        assert log.notes == ("odometry covers 0 of 3 scans",)
        assert log.meta["notes"] == ["the laser is tilted", *log.notes]
        log.save(tmp_path / "room.npz")


def test_an_npz_that_points_outside_of_itself_is_named(tmp_path):
    path = tmp_path / "room.npz"
    drive(n=3).save(path)
    data = bytearray(path.read_bytes())
    end = data.rindex(b"PK\x05\x06")
    data[end + 16 : end + 20] = b"\xff\xff\xff\x7f"  # where the list of contents begins
    path.write_bytes(data)
    with pytest.raises(ValueError, match=r"room\.npz: damaged, cut short or no npz"):
        slams.load(path)


@pytest.mark.parametrize("source", ["the lab", None, ["a"]])
def test_an_npz_of_others_says_what_it_likes_about_its_source(source, tmp_path, capsys):
    replace(drive(n=3), meta={"source": source}).save(tmp_path / "a.npz")
    trajectory.write_tum(tmp_path / "t.tum", np.arange(2.0), np.zeros((2, 3)))
    arguments = [str(tmp_path / "a.npz"), str(tmp_path / "b.npz")]
    assert convert.main([*arguments, "--truth", str(tmp_path / "t.tum")]) == 0
    assert "odometry: 3 stamps, 20.0 Hz\n" in capsys.readouterr().out
    assert slams.load(tmp_path / "b.npz").meta["source"] == source
