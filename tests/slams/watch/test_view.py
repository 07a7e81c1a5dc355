"""--video and --view: what they write, and what they say when they cannot."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from slams import run as slams_run
from slams.formats import occupancy
from slams.registry import find
from slams.types import OccupancyGrid, Pose2, Scan
from slams.watch import scene, video, view
from slams.watch.painter import HEAD_HEIGHT, HEIGHT, SCAN_COLOR, WIDTH, Painter
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


def film(path, log, every=10, slam=None):
    slam = slam or odometry()
    with video.Video(path, slam, "it", every) as watcher:
        for scan in log:
            watcher.watch(scan, slam.update(scan))


def near(image, color, tolerance=40):
    """Pixels (k, 2) x, y about of a color (BGR)."""
    far = np.abs(image.astype(int) - np.array(color)).max(axis=2)
    return np.argwhere(far < tolerance)[:, ::-1]


def test_a_folder_of_frames(log, tmp_path):
    film(tmp_path / "frames", log)
    names = sorted(p.name for p in (tmp_path / "frames").iterdir())
    assert names == ["00000.png", "00001.png", "00002.png", "00003.png"]
    image = cv2.imread(str(tmp_path / "frames" / "00003.png"))
    assert image.shape == (HEIGHT, WIDTH, 3)
    for color in (occupancy.PATH_COLOR, occupancy.START_COLOR, SCAN_COLOR):
        assert len(near(image, color)) > 20
    film(tmp_path / "first", log.select(1))
    first = (tmp_path / "first" / "00000.png").read_bytes()
    assert (tmp_path / "frames" / "00000.png").read_bytes() == first
    film(tmp_path / "frames", log, every=30)
    assert len(list((tmp_path / "frames").iterdir())) == 2


def test_the_same_run_gives_the_same_film(log, tmp_path):
    for name in ("a.mp4", "b.mp4"):
        film(tmp_path / name, log)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()
    assert len(list(tmp_path.iterdir())) == 2


def test_mp4_holds_the_frames(log, tmp_path):
    film(tmp_path / "a.mp4", log)
    film(tmp_path / "a", log)
    last = cv2.imread(str(tmp_path / "a" / "00003.png"))
    reader, frames = cv2.VideoCapture(str(tmp_path / "a.mp4")), []
    while (frame := reader.read()[1]) is not None:
        frames.append(frame)
    assert len(frames) == 4
    assert np.abs(frames[-1].astype(int) - last).mean() < 4.0


def test_what_is_drawn_is_where_it_was_seen():
    seen = scene.Scene()
    scan = next(iter(drive(n=1, noise=0.0)))
    seen.add(scan, Pose2(0.0, 0.0, 0.0))
    painter = Painter(seen)
    p = np.full((40, 40), np.nan, np.float32)
    p[20, 10] = 1.0  # x 0.2 .. 0.4, y 2.0 .. 2.2 m
    painter.grid = OccupancyGrid(p, 0.2, (-1.8, -2.0))
    image = painter.frame("text")
    scale, corner = painter._window()
    where = near(image, (0, 0, 0), 8)
    dark = where[(where[:, 1] > HEAD_HEIGHT) & (where[:, 1] < HEIGHT - 60)]
    x, y = dark.mean(axis=0)
    assert (x + 0.5) / scale + corner[0] == pytest.approx(0.3, abs=0.6 / scale)
    assert (HEIGHT - y - 0.5) / scale + corner[1] == pytest.approx(2.1, abs=0.6 / scale)
    assert len(dark) == pytest.approx((0.2 * scale) ** 2, rel=0.15)
    hits = near(image, SCAN_COLOR) + 0.5
    world = np.stack([hits[:, 0], HEIGHT - hits[:, 1]], axis=1) / scale + corner
    on_wall = np.abs(seen.points[None] - world[:, None]).max(axis=2).min(axis=1)
    assert on_wall.max() < 3.0 / scale


def test_a_map_finer_than_the_pixels_is_drawn_in_place():
    seen = scene.Scene()
    seen.add(next(iter(drive(n=1))), Pose2(0.0, 0.0, 0.0))
    painter = Painter(seen)
    p = np.zeros((1000, 1000), np.float32)
    p[600:700, 200:300] = 1.0
    painter.grid = OccupancyGrid(p, 0.005, (-2.5, -2.5))
    scale, corner = painter._window()
    dark = near(painter.frame(""), (0, 0, 0), 8)
    x, y = dark[(dark[:, 1] > HEAD_HEIGHT) & (dark[:, 1] < HEIGHT - 60)].mean(axis=0)
    assert (x + 0.5) / scale + corner[0] == pytest.approx(-1.25, abs=1.0 / scale)
    assert (HEIGHT - y - 0.5) / scale + corner[1] == pytest.approx(0.75, abs=1.0 / scale)


def test_the_points_of_a_scan_lie_where_it_hit():
    lidar, pose = laser(4, mount=Pose2(0.2, 0.1, 0.3)), Pose2(1.0, -0.5, 0.7)
    ranges = np.array([2.0, np.inf, 3.0, np.nan], np.float32)
    seen = scene.Scene()
    seen.add(Scan(0.0, ranges, lidar), pose)
    hits = lidar.directions[[0, 2]] * np.array([[2.0], [3.0]])
    assert seen.points == pytest.approx((pose @ lidar.mount).transform(hits))


def test_nothing_is_left_of_a_film_that_failed(log, tmp_path):
    class Breaks:
        broken = False

        def update(self, scan):
            self.broken = scan.t > 0.7
            if self.broken:
                raise RuntimeError("no")
            return Pose2(0.0, 0.0, 0.0)

        def map(self):
            assert not self.broken
            return odometry().map()

    for name in ("a.mp4", "a"):
        with pytest.raises(RuntimeError, match="no"):
            film(tmp_path / name, log, slam=Breaks())
    assert list(tmp_path.iterdir()) == []


def run(*arguments):
    return slams_run.main([str(argument) for argument in arguments])


def test_run_makes_films(log_file, tmp_path, capsys):
    out = ["--out", tmp_path / "o", "-q", "--force"]
    assert run("odometry", log_file, "--video", tmp_path / "v", "--video-every", 15, *out) == 0
    assert len(list((tmp_path / "v").iterdir())) == 3
    assert run("odometry", log_file, "--video", tmp_path / "w", *out) == 0
    assert len(list((tmp_path / "w").iterdir())) == 31
    capsys.readouterr()
    for target, sentence in (
        ("v.avi", "got v.avi, expected .mp4 or a folder"),
        (tmp_path / "none" / "v.mp4", "there is no folder"),
        (log_file.with_suffix(""), ""),
    ):
        code = run("odometry", log_file, "--video", target, "--out", tmp_path / "p", "--force")
        assert code == (2 if sentence else 0)
        error = capsys.readouterr().err
        assert sentence in error
        assert error.count("\n") == (1 if sentence else 0)
    assert run("odometry", log_file, "--video-every", 0, *out) == 2
    assert "--video-every: got 0, expected 1 or more" in capsys.readouterr().err


def test_a_folder_with_other_files_is_left_alone(log_file, log, tmp_path, capsys, monkeypatch):
    folder = tmp_path / "precious"
    folder.mkdir()
    (folder / "thesis.txt").write_text("years")
    assert run("odometry", log_file, "--video", folder, "--out", tmp_path / "o", "--force") == 2
    assert "precious: holds other files; expected a new folder" in capsys.readouterr().err
    assert [path.name for path in folder.iterdir()] == ["thesis.txt"]
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.chdir(empty)
    film(".", log)  # where somebody stands: filled, not replaced
    assert len(list(Path.cwd().iterdir())) == 4
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "precious"]


def test_a_pose_that_is_none_is_told_by_the_replay(log_file, tmp_path, capsys, monkeypatch):
    (tmp_path / "nans.py").write_text(
        "from slams.baselines import Odometry\n"
        "from slams import Pose2\n"
        "class Nans(Odometry):\n"
        "    def update(self, scan):\n"
        "        super().update(scan)\n"
        "        return Pose2(float('nan'), 0.0, 0.0) if scan.t > 0.5 else Pose2(0.0, 0.0, 0.0)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert run("nans:Nans", log_file, "--video", tmp_path / "v.mp4", "--out", tmp_path / "o") == 1
    assert "Nans returned Pose2(x=nan" in capsys.readouterr().err


def test_timing_does_not_count_the_film(log_file, tmp_path):
    from slams import load
    from slams.player import replay

    spent = []

    def slow(scan, pose):
        spent.append(sum(i * i for i in range(20000)))

    done = replay(odometry(), load(log_file), slow)
    assert len(spent) == 30
    assert np.median(done.seconds) < 5e-4


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


def test_a_recording_holds_map_scan_way_and_quality(rerun, log, tmp_path):
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
    assert count["map/way"] == 1 + 3
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
