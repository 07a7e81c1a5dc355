"""The network of ROS 2, on this machine's loopback alone."""

import json
import signal
import time

import numpy as np
import pytest

import slams
from slams.live.options import DIAGNOSTICS_TYPE, NODE_TYPES, Quality
from slams.player import replay
from slams.ros.maker import Maker
from slams.ros.messages import MAP_TYPE, PATH_TYPE, POSE_COV_TYPE, SCAN_TYPE, TF_TYPE, typestore
from slams.types import OccupancyGrid, Pose2
from tests.rooms import drive, laser
from tests.slams.live.commands import DOMAIN, PATIENCE, started

transport = pytest.importorskip("slams.live.transport", reason="needs the extra live")


@pytest.fixture
def transports(monkeypatch):
    """Makes participants of one domain on loopback, and closes them."""
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
    made = []

    def make():
        made.append(transport.Transport(DOMAIN, localhost=True))
        return made[-1]

    yield make
    for one in made:
        one.close()


def until(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "nothing came"
        time.sleep(0.01)


def examples():
    make, pose = Maker(), Pose2(1.0, -2.0, 0.5)
    grid = OccupancyGrid(np.array([[0.0, 1.0, np.nan]], np.float32), 0.05, (-1.0, -2.0))
    return {
        SCAN_TYPE: make.scan(5, "laser", laser(1081), np.arange(1081, dtype=np.float32), 0.1),
        "nav_msgs/msg/Odometry": make.odometry(6, pose, "odom", "base"),
        "sensor_msgs/msg/Imu": make.imu(7, 0.5, "imu"),
        TF_TYPE: make.transforms(8, [("a", "b", pose), ("longer_name", "c", pose)]),
        MAP_TYPE: make.grid(9, grid, "map"),
        PATH_TYPE: make.path([9], np.array([pose]), "map"),
        POSE_COV_TYPE: make.pose_with_covariance(10, pose, np.diag([1.0, 2.0, np.inf]), "map"),
        DIAGNOSTICS_TYPE: make.status(11, 1, "predicted", {"quality": "0.5", "n": "3"}),
    }


def packed(msgtype):
    return bytes(typestore().serialize_cdr(examples()[msgtype], msgtype))


def test_names_are_ros_2s():
    assert transport.type_name(SCAN_TYPE) == "sensor_msgs::msg::dds_::LaserScan_"


def joined(sender, receiver, topic, msgtype):
    """An outlet of a sender, and what a receiver gets of it."""
    got = []
    receiver.subscribe(topic, msgtype, Quality.RELIABLE, got.append)
    outlet = sender.advertise(topic, msgtype, Quality.RELIABLE)
    receiver.listen()
    until(lambda: outlet.subscribers)
    return outlet, got


@pytest.mark.parametrize("msgtype", NODE_TYPES)
def test_every_message_arrives_byte_by_byte(msgtype, transports):
    data = packed(msgtype)
    outlet, got = joined(transports(), transports(), "/topic", msgtype)
    outlet.publish(data)
    until(lambda: got)
    assert got[0].data[: len(data)] == data
    assert got[0].data[len(data) :] == b"\0" * (-len(data) % 4)
    assert (got[0].topic, got[0].msgtype) == ("/topic", msgtype)


def test_the_types_are_laid_out_as_the_library_writes_them():
    """DDS knows the fields, too: a peer that unpacks them by its own rules gets the same."""
    message, data = examples()[SCAN_TYPE], packed(SCAN_TYPE)
    scan = transport.message_type(SCAN_TYPE).__idl__
    names = [name for name, _ in typestore().fielddefs[SCAN_TYPE][1]]
    assert list(scan.datatype.__annotations__) == names
    found = unpacked(SCAN_TYPE, data)
    assert found["header"]["frame_id"] == "laser"
    assert found["header"]["stamp"] == {"sec": 0, "nanosec": 5}
    assert found["ranges"] == message.ranges.tolist()
    assert found["range_max"] == pytest.approx(message.range_max)


def unpacked(msgtype, data):
    """A message unpacked by cyclonedds, as names and values."""
    from cyclonedds.idl import IdlStruct

    def dressed(kind):
        kind.__init__ = lambda self, **fields: self.__dict__.update(fields)
        for annotation in kind.__annotations__.values():
            if isinstance(annotation, type) and issubclass(annotation, IdlStruct):
                dressed(annotation)

    def plain(value):
        if not isinstance(value, IdlStruct):
            return value
        return {name: plain(part) for name, part in vars(value).items()}

    dressed(transport.message_type(msgtype))
    return plain(transport.message_type(msgtype).__idl__.deserialize(data))


def test_a_map_stays_for_who_comes_later_and_a_scan_does_not(transports):
    sender, latched, passed = transports(), [], []
    maps = sender.advertise("/map", MAP_TYPE, Quality.LATCHED)
    maps.publish(packed(MAP_TYPE))
    scans = sender.advertise("/scan", SCAN_TYPE, Quality.SENSOR)
    scans.publish(packed(SCAN_TYPE))
    late = transports()
    late.subscribe("/map", MAP_TYPE, Quality.LATCHED, latched.append)
    late.subscribe("/scan", SCAN_TYPE, Quality.SENSOR, passed.append)
    late.listen()
    until(lambda: latched)
    until(lambda: scans.subscribers)
    assert passed == []
    until(lambda: late.published(MAP_TYPE) == ["/map"])
    assert late.published(SCAN_TYPE) == ["/scan"]


def test_messages_of_ones_own_do_not_come_back(transports):
    first, mine = transports(), []
    first.subscribe("/tf", TF_TYPE, Quality.RELIABLE, mine.append)
    first.listen()
    outlet, its = joined(first, transports(), "/tf", TF_TYPE)
    outlet.publish(packed(TF_TYPE))
    until(lambda: its)
    assert mine == []


def test_a_writer_that_leaves_is_no_message(transports):
    first, second, receiver, got = transports(), transports(), transports(), []
    data = packed(TF_TYPE)
    receiver.subscribe("/left", TF_TYPE, Quality.RELIABLE, got.append)
    receiver.listen()
    for sender in (first, second):
        outlet = sender.advertise("/left", TF_TYPE, Quality.RELIABLE)
        until(lambda outlet=outlet: outlet.subscribers)
        outlet.publish(data)
        until(lambda sender=sender: len(got) == 1 + (sender is second))
        del outlet
        sender.close()
        until(lambda: "/left" not in receiver.published(TF_TYPE))
    assert len(got) == 2


def test_a_run_of_the_recording_gives_the_poses_of_the_robot(transports, tmp_path):
    """As of a LDS-01 at 5 Hz on a TurtleBot: odometry of its own stamps, no gyro."""
    log = drive(n=25, rate=5.0, lidar=laser(91, mount=Pose2(-0.03, 0.0, 0.0)))
    seen = log.t, log.ranges, log.laser, drive(n=150, rate=30.0, lidar=laser(2)).odom
    slams.ScanLog(*seen, meta={"name": "tb"}).save(tmp_path / "tb.npz")
    watcher, maps, moves = transports(), [], []
    watcher.subscribe("/map", MAP_TYPE, Quality.LATCHED, maps.append)
    watcher.subscribe("/tf", TF_TYPE, Quality.RELIABLE, moves.append)
    watcher.listen()
    out = tmp_path / "out"
    more = ("--out", out, "--record", tmp_path / "seen.mcap", "--wait", 5.0)
    live = started("slams.live", "hector", *more, folder=tmp_path)
    assert "ready for scans on /scan" in live.stderr.readline()
    words = ("slams.play", "tb.npz", "--rate", 4, "--wait-for-subscriber", PATIENCE)
    play = started(*words, folder=tmp_path)
    output, error = play.communicate(timeout=2 * PATIENCE)
    assert (play.returncode, output) == (0, "25 scans of tb published\n"), error
    until(lambda: sum(to_odom(record) for record in moves) >= 20)
    until(lambda: maps)
    live.send_signal(signal.SIGINT)
    output, error = live.communicate(timeout=PATIENCE)
    assert live.returncode == 0, error
    assert output.startswith("25 scans, 0 left out; from scan to pose: p50 ")
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["node"]["scans"], summary["node"]["odometry"]) == (25, "tf")
    log = slams.load(tmp_path / "seen.mcap")
    run = replay(slams.create("hector"), log)
    written = np.loadtxt(out / "trajectory.csv", delimiter=",", skiprows=1)
    assert np.array_equal(written, np.round(np.column_stack([run.t, run.poses]), 9))
    as_logged = replay(slams.create("hector"), slams.load(tmp_path / "tb.npz"))
    off = np.hypot(*(run.poses - as_logged.poses)[:, :2].T)
    assert off.max() < 1e-3
    assert not [p.name for p in tmp_path.iterdir() if p.name.startswith(".")]


def to_odom(record):
    edge = typestore().deserialize_cdr(record.data, TF_TYPE).transforms[0]
    return (edge.header.frame_id, edge.child_frame_id) == ("map", "odom")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_ended_before_the_first_scan(number, tmp_path):
    live = started("slams.live", "odometry", "--record", "seen.mcap", folder=tmp_path)
    assert "ready" in live.stderr.readline()
    live.send_signal(number)
    _, error = live.communicate(timeout=PATIENCE)
    assert live.returncode == 1
    assert error == "slams live: ended before the first scan; nothing is written\n"
    assert list(tmp_path.iterdir()) == []
