"""A node with several lasers, and its attitude: that of a run of the recording."""

import math

import numpy as np
import pytest

from slams.live import scans
from slams.live.__main__ import parser
from slams.live.buffer import MIN_KEPT_TRANSFORMS, LaserMount
from slams.live.diagnostics import COUNT_MESSAGES
from slams.live.options import NodeOptions, Quality, node_options, topic_names
from slams.live.scans import ScanQueue
from slams.ros.maker import Maker
from slams.ros.messages import IMU_TYPE, SCAN_TYPE, TF_TYPE
from slams.types import Attitude, Pose2
from tests.rooms import ROOM, cast, drive_poses, laser
from tests.slams.live.robots import Stand, mounted, scan_record
from tests.slams.ros.test_attitude import messages, true

TWO = ("/front", "/rear")
PLACES = {"front": Pose2(0.2, 0.0, 0.0), "rear": Pose2(-0.2, 0.0, 3.0)}


def drive(stand, n=30, apart=0.05):
    """Scans of both lasers, those of the rear one half a period later, and sent in pairs."""
    stand.tf(*(("base_link", name, place) for name, place in PLACES.items()))
    poses = drive_poses(2 * n, 0.05)
    for k in range(n):
        pair = [(2 * k + 1, "rear"), (2 * k, "front")]  # the older one comes later
        for j, name in pair if k else reversed(pair):
            lidar = laser(181, mount=PLACES[name])
            ranges = cast(ROOM, poses[j], lidar).astype(np.float32)
            stamp = 10.0 + 0.1 * k + apart * (j - 2 * k)
            message = stand.make.scan(round(1e9 * stamp), name, lidar, ranges, 0.1)
            stand.bus.publish(f"/{name}", SCAN_TYPE, message)


@pytest.mark.parametrize("apart", [0.05, 0.0])
def test_poses_are_those_of_a_run_of_the_recording_in_the_order_of_stamps(
    apart, monkeypatch, tmp_path
):
    stand = Stand(monkeypatch, "hector", tmp_path / "out.mcap", scans=TWO, wait=60.0)
    drive(stand, apart=apart)
    stand.start_and_drive()
    log, _ = stand.recorded(scan_topic="/front", more_scan_topics=("/rear",))
    places = [pytest.approx(place, abs=1e-12) for place in PLACES.values()]
    assert [lidar.mount for lidar in log.lasers] == places
    assert len(log) == 60
    assert (stand.node.report()["late"], stand.node.report()["repeated"]) == (0, 0)


def test_a_laser_that_tf_does_not_place_is_left_out_until_it_does(monkeypatch):
    stand = mounted(monkeypatch, scans=TWO)
    stand.moved(0.0, (0.0, 0.0, 0.0))
    stand.scan(0.0, topic="/front")
    stand.scan(0.1, "rear", topic="/rear")
    stand.start_and_drive()
    stand.look()
    assert (stand.node.drive.t, stand.node.report()["unplaced"]) == ([0.0], 1)
    assert f"1 {COUNT_MESSAGES['unplaced']}" in stand.notes
    stand.tf(("base_link", "rear", PLACES["rear"]))
    stand.scan(0.2, "rear", topic="/rear")
    stand.drive()
    assert stand.node.drive.t == [0.0, 0.2]
    assert stand.node.report()["odometry"] == "tf"  # chosen once, with the first laser


class Clock:
    """An order of scans on a clock of its own."""

    def __init__(self, monkeypatch, wait=0.4, size=20):
        self.now, here = 50.0, LaserMount(Pose2(0.0, 0.0, 0.0), False)
        self.scans = ScanQueue(TWO, lambda frame: here, size, wait)
        monkeypatch.setattr(scans.time, "monotonic", lambda: self.now)

    def put(self, t, topic):
        self.scans.put(scan_record(t, topic))

    def taken(self):
        found = []
        while (scan := self.scans.take(0.0)) is not None:
            found.append((round(scan.sweep.t, 6), scan.topic))
        return found


def test_a_scan_waits_until_the_other_laser_has_come_as_far(monkeypatch):
    clock = Clock(monkeypatch)
    for t in (0.0, 0.2):
        clock.put(t, "/front")
        clock.put(t + 0.1, "/rear")
    assert [t for t, _ in clock.taken()] == [0.0, 0.1, 0.2]
    clock.put(0.4, "/front")
    assert clock.taken() == [(0.3, "/rear")]
    clock.put(0.4, "/rear")
    assert clock.taken() == [(0.4, "/front"), (0.4, "/rear")]


def test_no_scan_waits_longer_than_asked_nor_for_a_silent_laser(monkeypatch):
    clock = Clock(monkeypatch)
    for t in (0.0, 0.2):
        clock.put(t, "/front")
        clock.put(t, "/rear")
    assert [topic for _, topic in clock.taken()] == ["/front", "/rear"] * 2
    clock.put(0.6, "/front")
    clock.now += 0.39
    assert clock.taken() == []
    clock.now += 0.02
    assert clock.taken() == [(0.6, "/front")]
    clock.now += scans.SCAN_TIMEOUT
    clock.put(2.6, "/front")
    assert clock.taken() == [(2.6, "/front")]


def test_the_oldest_scans_are_left_out(monkeypatch):
    clock = Clock(monkeypatch, size=3)
    for k in range(10):
        clock.put(0.01 * k, "/front")
    clock.put(0.2, "/rear")
    assert clock.taken() == [(0.08, "/front"), (0.09, "/front")]  # that at 0.2 waits
    assert clock.scans.counts["dropped"] == 8


def test_topics_on_the_command_line():
    words = ["hector", "--scan-topic", "front", "--scan-topic", "/rear"]
    options = node_options(parser().parse_args(words))
    assert options.scans == ("/front", "/rear")
    for imu in (["--imu", "gyro"], ["--remap", "/imu:=/gyro"]):
        options = node_options(parser().parse_args(["hector", "--remap", "/map:=/m", *imu]))
        assert options.names == topic_names(["/map:=/m", "/imu:=/gyro"])
    sentence = "--scan-topic: got /a, /a, expected up to 8 different topics"
    with pytest.raises(ValueError, match=sentence):
        NodeOptions(("/a", "/a"))


N, HEIGHT = 40, 0.35  # scans; m, of the laser
TURNED = Pose2(0.1, 0.0, 0.5 * math.pi)  # the IMU looks left, as that of `messages`


def imu(row):
    """A sensor_msgs/Imu of a reading; it has no orientation where that is nan."""
    message = Maker().imu(round(1e9 * row.stamp), 0.0, "imu")
    q, w, a = message.orientation, message.angular_velocity, message.linear_acceleration
    if not math.isnan(row.orientation[0]):
        message.orientation_covariance[0] = 0.0
        q.x, q.y, q.z, q.w = row.orientation
    w.x, w.y, w.z = row.rates
    a.x, a.y, a.z = row.acceleration
    return message


def tilted(t, parent="base_stabilized"):
    """A transform from a level frame to the base, tilted as `true`."""
    attitude = true(t)
    message = Maker().transforms(round(1e9 * t), [(parent, "base_link", Pose2(0, 0, 0))])
    q, (roll, pitch) = message.transforms[0].transform.rotation, (0.5 * a for a in attitude)
    q.x, q.y = math.sin(roll) * math.cos(pitch), math.cos(roll) * math.sin(pitch)
    q.z, q.w = -math.sin(roll) * math.sin(pitch), math.cos(roll) * math.cos(pitch)
    return message


def mount(stand):
    edges = [("base_link", "laser", Pose2(0.2, 0.0, 0.0)), ("base_link", "imu", TURNED)]
    message = stand.make.transforms(0, edges)
    message.transforms[0].transform.translation.z = HEIGHT
    stand.bus.publish("/tf_static", TF_TYPE, message, Quality.LATCHED)


@pytest.mark.parametrize("source", ["orientation", "gyro and accelerometer", "tf"])
def test_poses_are_those_of_a_run_of_the_recording(source, monkeypatch, tmp_path):
    stand = Stand(monkeypatch, "hector", tmp_path / "out.mcap")
    mount(stand)
    if source == "tf":
        for k in range(0, 500, 2):
            message = tilted(0.01 * k)
            message.transforms += tilted(0.01 * (k + 1)).transforms
            stand.bus.publish("/tf", TF_TYPE, message)
    else:
        for row in messages(source == "orientation")[:500]:
            stand.bus.publish("/imu", IMU_TYPE, imu(row))
    for k, pose in enumerate(drive_poses(N, 0.1)):
        stand.scan(0.105 + 0.1 * k, pose=pose)
    scans = stand.scans_seen()
    stand.start_and_drive()
    log, slam = stand.recorded()
    seen = [scan.attitude for scan in scans]
    assert log.laser.mount_z == pytest.approx(HEIGHT) and len(log) == N
    assert [scan.attitude for scan in log] == seen
    expected = [true(0.105 + 0.1 * k) for k in range(N)]
    np.testing.assert_allclose(seen, expected, atol=2e-3)
    assert slam.report()["leveled"] > 0


def test_a_constant_orientation_is_no_attitude(monkeypatch):
    stand = Stand(monkeypatch)
    mount(stand)
    for row in messages(True)[:200]:
        same = row._replace(orientation=(0.0, 0.0, 0.0, 1.0), acceleration=(0.0, 0.0, 0.0))
        stand.bus.publish("/imu", IMU_TYPE, imu(same))
    stand.start(1.0)
    _, yaw, attitude = stand.node.buffer.at(1.0)
    assert attitude is None and yaw is not None


def test_a_robot_that_stands_still_keeps_its_attitude(stand):
    for t in (0.0, 0.1):
        stand.bus.publish("/tf", TF_TYPE, message := tilted(t))
    for k in range(2 * MIN_KEPT_TRANSFORMS):
        message.transforms[0].header.stamp.nanosec = 150_000_000 + 10_000_000 * k
        stand.bus.publish("/tf", TF_TYPE, message)
    stand.start(0.05)
    _, _, attitude = stand.node.buffer.at(0.5)
    assert attitude == pytest.approx(true(0.1))


def test_nothing_is_known_in_a_gap(stand):
    for t in (0.0, 0.1, 0.2, 1.2, 1.3):
        stand.bus.publish("/tf", TF_TYPE, tilted(t))
    stand.start(0.05)
    at = [stand.node.buffer.at(t)[2] for t in (0.1, 1.25, 0.7, 1.4)]
    assert at[0] == pytest.approx(true(0.1)) and isinstance(at[1], Attitude)
    assert at[2:] == [None, None]


def test_odometry_of_the_level_frame_is_that_of_the_tilting_base(stand):
    for k in range(12):
        stand.bus.publish("/tf", TF_TYPE, tilted(0.1 * k, parent="base_footprint"))
        stand.moved(0.1 * k, (0.1 * k, 0.0, 0.0), child="base_footprint")
    stand.start_and_drive(1.05)
    assert stand.node.report()["odometry"] == "tf"
    odometry, _, _ = stand.node.buffer.at(1.05)
    assert odometry == pytest.approx((1.05, 0.0, 0.0))
    assert stand.node.report()["base_frame"] == "base_link"
