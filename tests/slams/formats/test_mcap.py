"""result.mcap read back by the rosbags library and by evo; the maps of map_server."""

import json

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

import slams
from slams import run
from slams.formats import mcap, trajectory
from slams.types import Laser, OccupancyGrid, Pose2
from tests import bags

CELLS = np.array([[0.878, 0.1, np.nan], [0.5, 0.0, 1.0]], np.float32)
GRID = OccupancyGrid(CELLS, 0.05, (-1.0, 2.0))
WAY = np.stack([np.arange(6.0), 0.5 * np.arange(6), np.linspace(-3, 3, 6)], axis=1)


def log_of(t):
    rows = np.random.default_rng(0).uniform(0.5, 20.0, (len(t), 9)).astype(np.float32)
    rows[0, :2] = np.nan, np.inf
    laser = Laser(-1.0, 0.25, 9, 0.1, 30.0, Pose2(0.1, 0.2, 0.3), 1e-4)
    return slams.ScanLog(np.asarray(t, np.float64), rows, laser)


def messages(path):
    found = {}
    with AnyReader([path]) as reader:
        for connection, t, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((t, message))
    return found


@pytest.fixture
def written(tmp_path):
    log = log_of(1e9 + 0.1 * np.arange(6))
    mcap.write_mcap(tmp_path / "result.mcap", log, WAY, GRID)
    return log, tmp_path / "result.mcap"


def test_topics_scans_poses_and_frames(written):
    log, path = written
    found = messages(path)
    counts = {topic: len(items) for topic, items in found.items()}
    assert counts == {"/map": 1, "/path": 1, "/tf_static": 1, "/tf": 6, "/pose": 6, "/scan": 6}
    assert [t for t, _ in found["/pose"]] == [round(t * 1e9) for t in log.t]
    assert sorted(path.parent.iterdir()) == [path]
    scan = found["/scan"][3][1]
    assert np.array_equal(scan.ranges, log.ranges[3])
    assert (scan.angle_min, scan.angle_max) == pytest.approx((-1.0, 1.0))
    assert scan.header.frame_id == "laser"
    mount = found["/tf_static"][0][1].transforms[0]
    assert (mount.header.frame_id, mount.child_frame_id) == ("base_link", "laser")
    assert mount.transform.translation.y == 0.2
    moves = [message.transforms[0] for _, message in found["/tf"]]
    assert [tf.transform.translation.x for tf in moves] == WAY[:, 0].tolist()
    assert {(tf.header.frame_id, tf.child_frame_id) for tf in moves} == {("map", "base_link")}
    assert len(found["/path"][0][1].poses) == 6


def test_the_map(written):
    message = messages(written[1])["/map"][0][1]
    assert message.data.tolist() == [88, 10, -1, 50, 0, 100]  # row 0 is the lowest y
    info = message.info
    assert (info.width, info.height, info.resolution) == (3, 2, pytest.approx(0.05))
    assert (info.origin.position.x, info.origin.position.y) == (-1.0, 2.0)
    assert message.header.frame_id == "map"


@pytest.mark.parametrize("kind", ["mcap", "tum"])
def test_evo_reads_the_poses(kind, written):
    file_interface = pytest.importorskip("evo.tools.file_interface")
    log, path = written
    if kind == "mcap":
        with Reader(path) as reader:
            read = file_interface.read_bag_trajectory(reader, "/pose")
    else:
        trajectory.write_tum(path.with_name("t.tum"), log.t, WAY)
        read = file_interface.read_tum_trajectory_file(path.with_name("t.tum"))
    assert read.timestamps == pytest.approx(log.t, abs=1e-6)
    assert read.positions_xyz[:, :2] == pytest.approx(WAY[:, :2])
    yaw = [np.arctan2(T[1, 0], T[0, 0]) for T in read.poses_se3]
    assert yaw == pytest.approx(WAY[:, 2], abs=1e-7)


def test_equal_runs_give_equal_bytes(written):
    log, path = written
    mcap.write_mcap(path.with_name("again.mcap"), log, WAY, GRID)
    assert path.read_bytes() == path.with_name("again.mcap").read_bytes()


@pytest.mark.parametrize(
    ("t", "stored"),
    [
        ([-1.0, 0.0], [0, 10**9]),  # stamps that ROS does not hold count from the first scan
        ([3e9, 3e9 + 1.0], [0, 10**9]),
        ([5.0, 7.0, 6.0], [5 * 10**9, 6 * 10**9, 7 * 10**9]),
    ],
)
def test_stamps(t, stored, tmp_path):
    mcap.write_mcap(tmp_path / "r.mcap", log_of(t), WAY[: len(t)], GRID)
    assert sorted(t for t, _ in messages(tmp_path / "r.mcap")["/pose"]) == stored


def test_nothing_is_left_of_what_fails(tmp_path):
    with pytest.raises(ValueError, match="zip"):
        mcap.write_mcap(tmp_path / "r.mcap", log_of([1.0, 2.0]), WAY, GRID)
    assert list(tmp_path.iterdir()) == []


def test_run_takes_a_bag_and_says_what_it_assumed(tmp_path, capsys):
    def recorded(make):
        return [("/scan", t, make.scan(t, np.full(31, 2.0))) for t in 1.0 + 0.1 * np.arange(8)]

    path = bags.write(tmp_path, "mcap", recorded, name="kitchen")
    assert run.main(["odometry", str(path), "--out", str(tmp_path / "o")]) == 0
    shown = capsys.readouterr()
    assert "odometry on kitchen: 8 scans" in shown.out
    assert shown.err.startswith("slams run: note: no transform from a base to the laser's frame")
    summary = json.loads((tmp_path / "o" / "summary.json").read_text())
    assert summary["meta"]["source"]["scans"] == "/scan"
    assert "no transform" in summary["meta"]["notes"][0]
    assert run.main(["odometry", str(path), "--out", str(tmp_path / "p"), "-q"]) == 0
    assert capsys.readouterr().err == ""
