"""The node on a network in memory: input, output and notes."""

import math

import numpy as np
import pytest

from slams.live import node
from slams.live.options import NodeOptions, Quality
from slams.live.recorder import Recorder
from slams.ros.maker import UNKNOWN_VARIANCE, percent
from slams.ros.messages import SCAN_TYPE, TF_TYPE, seconds
from slams.types import Pose2
from tests.slams.live.robots import LASER, MOUNT, Ending, Stand, close, mounted, planar, robot_log


@pytest.mark.parametrize(("algorithm", "beam"), [("hector", 0.0), ("crsm", 0.0), ("hector", 4e-4)])
def test_poses_and_map_are_those_of_a_run_of_the_recording(algorithm, beam, monkeypatch, tmp_path):
    stand = Stand(monkeypatch, algorithm, tmp_path / "out.mcap")
    stand.play(robot_log(time_increment=beam))
    stand.start_and_drive()
    log, slam = stand.recorded()
    assert (log.laser.sweep_time > 0.0) == (beam > 0.0)
    assert log.laser.mount == pytest.approx(MOUNT, abs=1e-12)
    assert np.array_equal(stand.live.map().p, slam.map().p, equal_nan=True)
    assert sum(scan.odometry is not None for scan in log) == len(log) - 1  # the first is earlier
    assert sum(scan.yaw is not None for scan in log) == len(log)
    assert stand.node.report()["no_odometry"] == 1


def test_the_transform_joins_map_and_odometry_and_the_pose_is_the_algorithms(monkeypatch):
    stand = Stand(monkeypatch, "hector", tf_ahead=0.1)
    stand.play(robot_log(n=12))
    stand.start()
    before = len(stand.bus.sent("/tf"))
    stand.drive()
    moved, posed = stand.bus.sent("/tf")[before:], stand.bus.sent("/pose")
    assert len(posed) == 12
    assert len(moved) == 11  # none without odometry
    drive = stand.node.drive
    for tf, t, pose, message in zip(moved, drive.t[1:], drive.poses[1:], posed[1:], strict=True):
        edge = tf.transforms[0]
        assert (edge.header.frame_id, edge.child_frame_id) == ("map", "odom")
        assert seconds(edge.header.stamp) == pytest.approx(t + 0.1, abs=1e-6)
        shift, at = edge.transform, message.pose.pose
        odom = planar(shift.translation, shift.rotation)
        assert close(odom @ stand.node.buffer.at(t)[0], pose)
        assert close(planar(at.position, at.orientation), pose)
        assert message.header.frame_id == "map"
    covariance = posed[-1].pose.covariance.reshape(6, 6)
    assert np.array_equal(covariance[np.ix_([0, 1, 5], [0, 1, 5])], stand.live.last.covariance)
    assert not covariance[2:5].any()
    state = stand.bus.sent("/slam/state")[-1].status[0]
    assert (state.level, state.name, state.message) == (0, "slams", "matched")
    values = {pair.key: pair.value for pair in state.values}
    assert float(values["quality"]) > 0.8
    assert (values["scans"], values["dropped"]) == ("12", "0")


def test_without_odometry_the_base_itself_is_placed_in_the_map(monkeypatch):
    stand = mounted(monkeypatch, tf_ahead=0.0)
    stand.start_and_drive(1.0)
    edge = stand.bus.sent("/tf")[0].transforms[0]
    assert (edge.header.frame_id, edge.child_frame_id) == ("map", "base_link")
    variances = np.diag(stand.bus.sent("/pose")[0].pose.covariance.reshape(6, 6))
    assert variances[[0, 1, 5]].tolist() == [UNKNOWN_VARIANCE] * 3
    assert stand.node.report()["no_odometry"] == 0


def test_the_map_stays_for_who_comes_later_and_without_loops_no_path_is_published(monkeypatch):
    stand = Stand(monkeypatch, "hector", map_every=60.0)
    stand.play(robot_log(n=5))
    stand.start_and_drive()
    stand.node.close()
    assert "/map" in stand.bus.kept and not stand.bus.sent("/path")
    message, grid = stand.bus.sent("/map")[-1], stand.live.map()
    assert message.header.frame_id == "map"
    assert (message.info.height, message.info.width) == grid.p.shape
    assert message.info.resolution == pytest.approx(grid.resolution)
    assert (message.info.origin.position.x, message.info.origin.position.y) == grid.origin
    assert np.array_equal(message.data, percent(grid))
    assert stand.transport.closed


def turned_over(message):
    """A transform that also rolls by half a turn, as a laser mounted upside down has it."""
    q = message.transforms[0].transform.rotation
    q.x, q.y, q.z, q.w = q.w, q.z, 0.0, 0.0
    return message


def test_a_laser_upside_down_turns_the_other_way(monkeypatch):
    stand = Stand(monkeypatch)
    mount = turned_over(stand.make.transforms(0, [("base_link", "laser", MOUNT)]))
    stand.bus.publish("/tf_static", TF_TYPE, mount, Quality.LATCHED)
    seen = stand.scans_seen()
    stand.start_and_drive(1.0, 2.0)
    lidar = seen[0].laser
    assert lidar.angle_min == pytest.approx(0.75 * math.pi)
    assert lidar.angle_increment < 0.0
    assert lidar.mount == pytest.approx(MOUNT, abs=1e-12)
    assert seen[1].laser is lidar


@pytest.mark.parametrize(("wanted", "x"), [("auto", 1.0), ("topic", 7.0), ("none", None)])
def test_odometry_is_tfs_where_there_is_one_else_the_topics(wanted, x, monkeypatch):
    stand = mounted(monkeypatch, odometry=wanted)
    stand.tf(("odom", "elsewhere", Pose2(50.0, 0.0, 0.0)), static=False)
    for t in (0.0, 2.0):
        stand.moved(t, (t, 0.0, 0.0))
        stand.odometry(t, (6.0 + t, 0.0, 0.0))
    stand.start(1.0)
    seen = stand.scans_seen()
    stand.drive()
    assert seen[0].odometry == (None if x is None else Pose2(x, 0.0, 0.0))
    edge = stand.bus.sent("/tf")[-1].transforms[0]
    assert (edge.header.frame_id, edge.child_frame_id) == ("map", "odom")  # also for "none"
    assert edge.transform.translation.x == pytest.approx(-(x or 1.0))
    assert stand.node.report()["base_frame"] == "base_link"


def test_odometry_of_another_frame_is_carried_to_the_base(monkeypatch):
    stand = Stand(monkeypatch, base_frame="base_link")
    stand.tf(("footprint", "base_link", Pose2(1.0, 0.0, 0.0)), ("base_link", "laser", MOUNT))
    for t in (0.0, 2.0):
        stand.odometry(t, (0.0, 0.0, 0.5 * math.pi), child="footprint")
    stand.start(1.0)
    assert close(stand.node.buffer.at(1.0)[0], (0.0, 1.0, 0.5 * math.pi))


def test_odometry_that_comes_after_its_scan_is_waited_for(stand, monkeypatch):
    stand.odometry(0.0, (0.0, 0.0, 0.0))
    stand.start(1.0)

    def wait_for(covered, seconds):
        assert not covered()
        stand.odometry(2.0, (2.0, 0.0, 0.0))
        assert covered()

    monkeypatch.setattr(stand.node.buffer._changed, "wait_for", wait_for)
    stand.drive()
    assert stand.node.report()["no_odometry"] == 0
    assert stand.live.last.map_to_odom is not None


def test_a_scan_goes_without_odometry_that_does_not_come(stand):
    stand.odometry(0.0, (0.0, 0.0, 0.0))
    stand.start_and_drive(1.0)
    stand.look()
    assert stand.node.report()["no_odometry"] == 1
    assert len(stand.node.drive.t) == 1
    assert any("1 scans so far had no odometry in time" in note for note in stand.notes)


def waits(stand, monkeypatch, looks=5):
    """The sentences of a node that waits until it is ended."""
    monkeypatch.setattr(node, "REPORT_PERIOD", 0.0)
    stand.start(ending=Ending(looks))
    assert stand.node.drive.t == []
    return [note for note in stand.notes if note.startswith("waiting")]


def test_scans_are_waited_for_with_the_topics_there_are(monkeypatch):
    stand = Stand(monkeypatch)
    kind = f"topics with a publisher of {SCAN_TYPE}"
    assert f"waiting for scans on /scan; {kind}: none" in waits(stand, monkeypatch)[0]
    stand.bus.types["/scan"] = "sensor_msgs/msg/PointCloud2"
    stand.scan(0.0, topic="/front/scan")
    assert f"{kind}: /front/scan (--scan-topic" in waits(stand, monkeypatch)[-1]


@pytest.mark.parametrize(
    ("base", "named", "frames"),
    [
        ("robot", "robot", "base_link, camera"),
        (None, "a base", "base_link, camera"),
        ("robot", "robot", "none"),  # a base that was named
    ],
)
def test_a_frame_that_is_not_in_tf_is_waited_for(base, named, frames, monkeypatch):
    stand = Stand(monkeypatch, base_frame=base)
    if frames != "none":
        stand.tf(("base_link", "camera", MOUNT))
    stand.scan(0.0)
    sentence = f"no fixed transform from {named} to the laser's frame laser; frames: {frames}"
    assert sentence in waits(stand, monkeypatch)[-1]
    stand.start(ending=Ending(100, lambda: stand.tf((base or "base_link", "laser", MOUNT))))
    stand.drive()
    assert stand.node.report()["base_frame"] == (base or "base_link")


def test_tf_odometry_that_is_asked_for_is_waited_for(monkeypatch):
    stand = mounted(monkeypatch, odometry="tf")
    stand.scan(0.1)
    sentence = "no odometry from odom to the laser's frame laser; frames: base_link"
    assert sentence in waits(stand, monkeypatch)[-1]
    stand.start(ending=Ending(100, lambda: stand.moved(0.1, (0.0, 0.0, 0.0))))
    assert stand.node.report()["odometry"] == "tf"


def test_tf_odometry_that_begins_late_is_told_and_leaves_no_second_parent(stand):
    stand.start_and_drive(0.1)
    assert len(stand.bus.sent("/tf")) == 1  # map -> base_link
    stand.look()
    stand.moved(0.2, (0.0, 0.0, 0.0))
    stand.scan(0.2)
    stand.drive()
    stand.look()
    assert len(stand.node.drive.t) == len(stand.bus.sent("/tf")) == 2  # that of the odometry
    assert sum("began too late and is not used" in note for note in stand.notes) == 1


def test_without_tf_the_laser_is_the_base(monkeypatch):
    stand = Stand(monkeypatch)
    stand.start_and_drive(0.0)
    assert any("no transform to the laser's frame laser" in note for note in stand.notes)
    assert stand.bus.sent("/tf")[0].transforms[0].child_frame_id == "laser"


def test_what_is_assumed_of_the_laser_is_told_once(stand):
    for k, reading in enumerate((2.0, 1.0, 8.0, 4.0)):  # into a larger room
        ranges = np.full(91, reading, np.float32)
        limitless = stand.make.scan(10**8 * k, "laser", LASER, ranges, 0.1)
        limitless.range_max, limitless.time_increment = 0.0, 0.01
        stand.bus.publish("/scan", SCAN_TYPE, limitless)
    stand.gyro(0.0, 0.5, frame="somewhere")
    seen = stand.scans_seen()
    stand.start_and_drive()
    for _ in range(2):
        stand.look()
    (note,) = [note for note in stand.notes if "range_max is 0" in note]
    assert note == "range_max is 0; 2.00 m is used instead"
    assert sum("no transform to the gyro's frame 'somewhere'" in note for note in stand.notes) == 1
    assert [scan.laser.time_increment for scan in seen] == [0.0] * 4
    assert np.isfinite([scan.ranges for scan in seen]).all() and seen[3].laser is seen[2].laser


def test_what_waits_while_frames_are_sought_is_not_left_out(stand, monkeypatch):
    monkeypatch.setattr(node, "MAX_QUEUED_SCANS", 2)
    stand.start_and_drive(*(0.1 * k for k in range(10)))
    assert len(stand.node.drive.t) == 10
    for k in range(10, 20):
        stand.scan(0.1 * k)
    stand.drive()
    assert len(stand.node.drive.t) == 12
    assert stand.node.drive.t[-1] == pytest.approx(1.9)
    stand.look()
    assert any(note.startswith("8 scans left out so far") for note in stand.notes)


def test_odd_messages_are_left_out_and_said_once(stand):
    stand.start(0.0)
    broken = stand.bus.transport().advertise("/scan", SCAN_TYPE, Quality.SENSOR)
    for topic in ("/scan", "/tf", "/odom", "/imu"):
        kind = stand.bus.types.get(topic, TF_TYPE)
        broken = stand.bus.transport().advertise(topic, kind, Quality.SENSOR)
        broken.publish(b"\0\1\0\0oh")
    stand.scan(0.1, frame="other")
    stand.scan(0.2)
    stand.drive()
    stand.look()
    report = stand.node.report()
    assert (report["unreadable"], report["other_frame"], report["scans"]) == (1, 1, 2)
    (note,) = [note for note in stand.notes if "such scans are left out" in note]
    assert note == "a message of /scan is no sensor_msgs/msg/LaserScan; such scans are left out"
    assert any("two lasers on one topic" in note for note in stand.notes)


def test_a_laser_that_begins_with_empty_scans_is_waited_for(stand):
    empty = stand.make.scan(0, "", LASER, np.zeros(0, np.float32), 0.1)
    stand.bus.publish("/scan", SCAN_TYPE, empty)
    stand.start_and_drive(0.1)
    assert (len(stand.node.drive.t), stand.node.report()["unreadable"]) == (1, 1)
    assert "a scan of /scan has no beams or no directions; such scans are left out" in stand.notes


def test_a_network_that_takes_nothing_does_not_stop_the_robot(stand):
    stand.start(0.0)

    def refuse(data):
        raise OSError("full")

    stand.node._publisher._publishers["/pose"].publish = refuse
    stand.drive()
    stand.look()
    assert len(stand.node.drive.t) == 1
    assert len(stand.bus.sent("/slam/state")) == 1
    assert "1 messages were not accepted by the network in time" in stand.notes


def test_a_recording_that_cannot_be_written_is_said(monkeypatch, tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        Recorder(tmp_path / "nowhere" / "out.mcap", NodeOptions())
    recorder = Recorder(tmp_path / "out.mcap", NodeOptions())
    recorder.put("/nobody", 0, b"")
    with pytest.raises(OSError, match=r"out.mcap: not recorded"):
        recorder.close()
    assert list(tmp_path.iterdir()) == []
