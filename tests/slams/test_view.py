"""--view: what it writes, and what it says when it cannot."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from slams import player, view
from slams import run as slams_run
from slams.registry import find
from slams.types import Pose2, Scan
from tests.rooms import drive, laser


@pytest.fixture(scope="module")
def log():
    return drive(n=30)


@pytest.fixture(scope="module")
def log_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "room.npz"
    drive(n=30).save(path)
    return path


def odometry():
    entry = find("odometry")
    return entry.cls(entry.params())


def run(*arguments):
    return slams_run.main([str(argument) for argument in arguments])


def test_without_the_extra_one_sentence_says_how_to_get_it(log_file, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert run("odometry", log_file, "--view", "--out", tmp_path / "o") == 2
    error = capsys.readouterr().err
    assert "pip install rerun-sdk" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "o").exists()
    monkeypatch.setitem(sys.modules, "rerun", SimpleNamespace())
    assert run("odometry", log_file, "--view", "--out", tmp_path / "o") == 2


class Recording:
    """Stands in for the viewer: keeps what it is sent."""

    last: "Recording"

    def __init__(self, name, recording_id):
        self.sent, self.times, self.target, self.open = [], [], None, True
        self.recording_id = recording_id
        Recording.last = self

    def spawn(self):
        self.target = "window"

    def save(self, path):
        self.target = Path(path)
        self.target.write_text("rrd")

    def set_time(self, timeline, **value):
        self.times.append((timeline, value))

    def log(self, path, entity):
        self.sent.append((path, entity))

    def disconnect(self):
        self.open = False


def made(kind):
    return lambda *arguments, **more: (kind, arguments, more)


@pytest.fixture
def rerun(monkeypatch):
    fake = SimpleNamespace(
        RecordingStream=Recording,
        Points3D=made("points"),
        LineStrips3D=made("lines"),
        Scalars=made("scalar"),
        GridMap=made("grid"),
        components=SimpleNamespace(ImageFormat=made("format")),
    )
    monkeypatch.setitem(sys.modules, "rerun", fake)
    return fake


def test_a_pose_that_is_none_is_told_by_the_replay(rerun, log_file, tmp_path, capsys, monkeypatch):
    (tmp_path / "nans.py").write_text(
        "from slams.baselines import Odometry\n"
        "from slams import Pose2\n"
        "class Nans(Odometry):\n"
        "    def update(self, scan):\n"
        "        super().update(scan)\n"
        "        return Pose2(float('nan'), 0.0, 0.0) if scan.t > 0.5 else Pose2(0.0, 0.0, 0.0)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert run("nans:Nans", log_file, "--view", tmp_path / "v.rrd", "--out", tmp_path / "o") == 1
    assert not (tmp_path / "v.rrd").exists()
    assert "Nans returned Pose2(x=nan" in capsys.readouterr().err


def test_the_points_of_a_scan_lie_where_it_hit(rerun, tmp_path):
    lidar, pose = laser(4, mount=Pose2(0.2, 0.1, 0.3)), Pose2(1.0, -0.5, 0.7)
    ranges = np.array([2.0, np.inf, 3.0, np.nan], np.float32)
    with view.View(str(tmp_path / "a.rrd"), odometry(), "it") as watcher:
        watcher.watch(Scan(0.0, ranges, lidar), pose)
    hits = lidar.directions[[0, 2]] * np.array([[2.0], [3.0]])
    (sent,) = (entity for path, entity in Recording.last.sent if path == "map/scan")
    assert sent[1][0][:, :2] == pytest.approx((pose @ lidar.mount).transform(hits))


def test_the_time_of_the_viewer_is_not_counted(log, monkeypatch):
    """By a clock that goes on only while the viewer draws."""
    drawn = []
    monkeypatch.setattr(player.time, "process_time", lambda: float(len(drawn)))
    done = player.replay(odometry(), log, lambda scan, pose: drawn.append(scan))
    assert len(drawn) == 30
    assert not done.seconds.any()


def test_a_recording_holds_map_scan_path_and_quality(rerun, log, tmp_path):
    entry = find("hector")
    slam = entry.cls(entry.params())
    with view.View(str(tmp_path / "a.rrd"), slam, "it") as watcher:
        assert not (tmp_path / "a.rrd").exists()
        for scan in log:
            watcher.watch(scan, slam.update(scan))
    sent = Recording.last.sent
    count = {path: sum(p == path for p, _ in sent) for path, _ in sent}
    assert count["map/scan"] == count["map/robot"] == count["match"] == 30
    assert count["map/grid"] == 1 + 2
    assert count["map/path"] == 1 + 3
    assert Recording.last.times[-2:] == [
        ("log", {"duration": pytest.approx(29 / 20)}),
        ("scan", {"sequence": 29}),
    ]
    kind, _, more = sent[-2][1]
    grid = slam.map()
    assert kind == "grid"
    assert more["cell_size"] == grid.resolution
    assert more["translation"][:2] == list(grid.origin)
    assert len(more["data"]) == grid.p.size
    rows = np.frombuffer(more["data"], np.uint8).reshape(grid.p.shape)[::-1]
    assert np.array_equal(rows < 50, np.nan_to_num(grid.p, nan=0.5) > 0.805)
    assert sent[-1][1][1][0][0].shape == (30, 3)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.rrd"]
    assert not Recording.last.open


def test_view_as_a_user_types_it(rerun, log_file, tmp_path, capsys):
    out = ["--out", tmp_path / "o", "-q", "--force"]
    assert run("odometry", log_file, "--view", *out) == 0
    assert Recording.last.target == "window"
    assert Recording.last.recording_id is None  # else the viewer adds it to the run before
    assert run("odometry", log_file, "--view", tmp_path / "a.rrd", *out) == 0
    assert (tmp_path / "a.rrd").read_text() == "rrd"
    assert run("odometry", "--view", log_file, *out) == 2
    assert run("odometry", log_file, "--view", "a.rrt", *out) == 2
    assert "--view: got a.rrt, expected a file .rrd, or nothing" in capsys.readouterr().err
    with pytest.raises(RuntimeError), view.View(str(tmp_path / "b.rrd"), odometry(), "it"):
        raise RuntimeError
    assert not list(tmp_path.glob("*b.*"))
    (tmp_path / "c.rrd").mkdir()
    assert run("odometry", log_file, "--view", tmp_path / "c.rrd", *out) == 2
    assert "c.rrd: is a folder" in capsys.readouterr().err


def test_nothing_is_left_of_a_view_whose_last_map_fails(rerun, log, tmp_path):
    class Breaks:
        drawn = 0

        def map(self):
            self.drawn += 1
            assert self.drawn == 1
            return odometry().map()

    with (
        pytest.raises(AssertionError),
        view.View(str(tmp_path / "a.rrd"), Breaks(), "it") as watcher,
    ):
        watcher.watch(next(iter(log)), Pose2(0.0, 0.0, 0.0))
    assert list(tmp_path.iterdir()) == []
    assert not Recording.last.open


def test_the_map_is_drawn_on_where_stamps_jump_back(rerun, log, tmp_path):
    slam = odometry()
    with view.View(str(tmp_path / "a.rrd"), slam, "it") as watcher:
        for t in (100.0, 100.5, 0.0, 0.5, 1.0):
            watcher.watch(replace(next(iter(log)), t=t), Pose2(0.0, 0.0, 0.0))
    assert sum(path == "map/grid" for path, _ in Recording.last.sent) == 3 + 1


def test_the_real_viewer_library_takes_it(log, tmp_path):
    pytest.importorskip("rerun", reason="the extra viz is not installed")
    slam = odometry()
    with view.View(str(tmp_path / "a.rrd"), slam, "it") as watcher:
        for scan in log:
            watcher.watch(scan, slam.update(scan))
    assert (tmp_path / "a.rrd").stat().st_size > 10_000
