"""A log as a robot publishes it: what, when, in which words."""

import threading

import pytest

import slams
from slams.formats.frames import yaw_of
from slams.live.options import Topics, topics_of
from slams.live.robot import Robot
from tests.rooms import drive, laser
from tests.slams.live.bus import Bus


def seconds(message):
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


@pytest.fixture
def sweeping():
    return drive(n=4, rate=10.0, lidar=laser(11, time_increment=0.005))


def test_a_scan_is_sent_when_its_last_beam_is_measured_and_odometry_when_it_is(sweeping):
    bus, order = Bus(), []
    robot = Robot(sweeping, bus.transport(), Topics())
    for moment in robot.moments():
        before = {topic: len(sent) for topic, sent in bus.raw.items()}
        moment.send()
        new = [topic for topic, sent in bus.raw.items() if len(sent) > before.get(topic, 0)]
        order.append((round(moment.t, 3), *new))
        assert moment.is_scan == (new == ["/scan"])
    first = [(0.0, "/odom", "/tf"), (0.0, "/imu"), (0.05, "/scan"), (0.1, "/odom", "/tf")]
    assert order[:4] == first
    assert len(order) == robot.length == 12
    scan, said, moved = (bus.sent(topic)[2] for topic in ("/scan", "/odom", "/tf"))
    assert seconds(scan) == seconds(said) == pytest.approx(0.2)  # stamped with the first beam
    assert scan.time_increment == pytest.approx(0.005)
    at, edge = said.pose.pose, moved.transforms[0]
    assert (at.position.x, at.position.y, yaw_of(at.orientation)) == pytest.approx(
        sweeping.odom.values[2]
    )
    assert edge.transform.translation.x == at.position.x
    assert (edge.header.frame_id, edge.child_frame_id) == ("odom", said.child_frame_id)
    assert bus.sent("/imu")[2].angular_velocity.z == pytest.approx(sweeping.yaw_rate.values[2])


def test_stamps_that_ros_cannot_hold_begin_at_zero(sweeping):
    bus = Bus()
    early = slams.ScanLog(sweeping.t - 50.0, sweeping.ranges, sweeping.laser)
    robot = Robot(early, bus.transport(), topics_of(["/scan:=/front/scan"]))
    robot.introduce()
    for moment in robot.moments():
        moment.send()
    assert [seconds(scan) for scan in bus.sent("/front/scan")] == pytest.approx([0, 0.1, 0.2, 0.3])
    assert set(bus.raw) == {"/front/scan", "/tf_static"}


def test_somebody_is_waited_for(sweeping):
    wire = Bus().transport()
    robot = Robot(sweeping, wire, Topics())
    ending = threading.Event()
    robot._publishers["/scan"].subscribers = 0
    assert robot.await_reader(0.1, ending) is False
    robot._publishers["/scan"].subscribers = 1
    ending.set()
    assert robot.await_reader(0.1, ending) is True
