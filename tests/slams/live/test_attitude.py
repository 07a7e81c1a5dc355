"""A node's attitude, by the IMU's messages and by tf: that of a run of the recording."""

import math

import numpy as np
import pytest

from slams.formats.bag import IMU, TF
from slams.formats.ros_maker import Maker
from slams.live.frames import FEW
from slams.live.options import Quality
from slams.types import Attitude, Pose2
from tests.rooms import way
from tests.slams.formats.test_attitude import messages, true
from tests.slams.live.robots import Stand, mounted

N, HEIGHT = 40, 0.35  # scans; m, of the laser
TURNED = Pose2(0.1, 0.0, 0.5 * math.pi)  # the IMU looks left, as that of `messages`


def imu(row):
    """A sensor_msgs/Imu of a reading; it has no orientation where that is nan."""
    message = Maker().imu(round(1e9 * row.sent), 0.0, "imu")
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
    stand.bus.publish("/tf_static", TF, message, Quality.LATCHED)


@pytest.mark.parametrize("source", ["orientation", "gyro and accelerometer", "tf"])
def test_poses_are_those_of_a_run_of_the_recording(source, monkeypatch, tmp_path):
    stand = Stand(monkeypatch, "hector", tmp_path / "out.mcap")
    mount(stand)
    if source == "tf":
        for k in range(0, 500, 2):
            message = tilted(0.01 * k)
            message.transforms += tilted(0.01 * (k + 1)).transforms
            stand.bus.publish("/tf", TF, message)
    else:
        for row in messages(source == "orientation")[:500]:
            stand.bus.publish("/imu", IMU, imu(row))
    for k, pose in enumerate(way(N, 0.1)):
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
        stand.bus.publish("/imu", IMU, imu(same))
    stand.scan(1.0)
    stand.start()
    assert stand.node.buffer.attitude_at(1.0) is None
    assert stand.node.buffer.yaw_at(1.0) is not None


def test_a_robot_that_stands_still_keeps_its_attitude(monkeypatch):
    stand = mounted(monkeypatch)
    for t in (0.0, 0.1):
        stand.bus.publish("/tf", TF, message := tilted(t))
    for k in range(2 * FEW):
        message.transforms[0].header.stamp.nanosec = 150_000_000 + 10_000_000 * k
        stand.bus.publish("/tf", TF, message)
    stand.scan(0.05)
    stand.start()
    assert stand.node.buffer.attitude_at(0.5) == pytest.approx(true(0.1))


def test_nothing_is_known_in_a_gap(monkeypatch):
    stand = mounted(monkeypatch)
    for t in (0.0, 0.1, 0.2, 1.2, 1.3):
        stand.bus.publish("/tf", TF, tilted(t))
    stand.scan(0.05)
    stand.start()
    at = stand.node.buffer.attitude_at
    assert at(0.1) == pytest.approx(true(0.1)) and isinstance(at(1.25), Attitude)
    assert at(0.7) is None and at(1.4) is None


def test_odometry_of_the_level_frame_is_that_of_the_tilting_base(monkeypatch):
    stand = mounted(monkeypatch)
    for k in range(12):
        stand.bus.publish("/tf", TF, tilted(0.1 * k, parent="base_footprint"))
        stand.moved(0.1 * k, (0.1 * k, 0.0, 0.0), child="base_footprint")
    stand.scan(1.05)
    stand.start_and_drive()
    assert stand.node.report()["odometry"] == "tf"
    assert stand.node.buffer.odometry_at(1.05) == pytest.approx((1.05, 0.0, 0.0))
    assert stand.node.report()["base_frame"] == "base_link"
