"""ROS 1: the adapter to rospy, against a stand-in with rospy's names.

It checks what the adapter asks of rospy and that messages are turned to CDR and back; with the real
rospy `test_ros1_master.py` does so, where it is installed.
"""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from slams.formats.bag import SCAN, TF
from slams.formats.ros_maker import Maker
from slams.formats.ros_store import store
from slams.live.ros1 import Ros1Wire
from slams.live.wire import MAP, Quality
from slams.types import OccupancyGrid, Pose2
from tests.rooms import laser

ROS1 = get_typestore(Stores.ROS1_NOETIC)


class Rospy:
    """As much of rospy as the adapter uses."""

    def __init__(self, online=True):
        self.AnyMsg, self.online = object(), online
        self.published, self.subscribed, self.ended = {}, {}, None
        self.node = None

    def is_master_online(self):
        return self.online

    def init_node(self, name, anonymous, disable_signals):
        self.node = (name, anonymous, disable_signals)

    def Publisher(self, topic, kind, latch, queue_size):
        sent = []
        self.published[topic] = SimpleNamespace(kind=kind, latch=latch, sent=sent)
        return SimpleNamespace(publish=sent.append, get_num_connections=lambda: 2)

    def Subscriber(self, topic, kind, callback, queue_size):
        assert kind is self.AnyMsg
        self.subscribed[topic] = callback
        return SimpleNamespace(get_num_connections=lambda: 1)

    def get_published_topics(self):
        return [["/scan", "sensor_msgs/LaserScan"], ["/tf", "tf2_msgs/TFMessage"]]

    def get_name(self):
        return "/slams_1"

    def signal_shutdown(self, reason):
        self.ended = reason

    def get_message_class(self, kind):
        return lambda: SimpleNamespace(kind=kind, deserialize=lambda data: None)


class Message:
    """A message of rospy: it unpacks itself."""

    def __init__(self, kind):
        self.kind, self.data = kind, b""

    def deserialize(self, data):
        self.data = data


@pytest.fixture
def rospy(monkeypatch):
    fake = Rospy()
    fake.get_message_class = lambda kind: lambda: Message(kind)
    for name in ("rospy", "rosgraph", "roslib.message"):
        monkeypatch.setitem(sys.modules, name, fake)
    monkeypatch.setitem(sys.modules, "roslib", SimpleNamespace(message=fake))
    return fake


def raw(kind, data, caller="/driver"):
    return SimpleNamespace(_connection_header={"type": kind, "callerid": caller}, _buff=data)


def test_scans_of_ros_1_arrive_as_cdr(rospy):
    wire, got = Ros1Wire("slams"), []
    assert rospy.node == ("slams", True, True)
    wire.subscribe("/scan", SCAN, Quality.SENSOR, got.append)
    assert rospy.subscribed == {}  # nothing comes before all is ready
    wire.listen()
    sent = ROS1.types[SCAN](
        ROS1.types["std_msgs/msg/Header"](
            77, ROS1.types["builtin_interfaces/msg/Time"](5, 6), "laser"
        ),
        *(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 30.0),
        np.arange(5, dtype=np.float32),
        np.zeros(0, np.float32),
    )
    rospy.subscribed["/scan"](raw("sensor_msgs/LaserScan", bytes(ROS1.serialize_ros1(sent, SCAN))))
    scan = store().deserialize_cdr(got[0].data, SCAN)
    assert (scan.header.stamp.sec, scan.header.stamp.nanosec) == (5, 6)
    assert scan.header.frame_id == "laser"
    assert scan.ranges.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert got[0].topic == "/scan"
    rospy.subscribed["/scan"](raw("sensor_msgs/PointCloud", b"?"))
    own = raw("sensor_msgs/LaserScan", bytes(ROS1.serialize_ros1(sent, SCAN)), "/slams_1")
    rospy.subscribed["/scan"](own)
    assert len(got) == 1
    assert wire.writers("/scan") == 1
    wire.close()
    assert rospy.ended


def test_old_transforms_are_transforms(rospy):
    wire, got = Ros1Wire("slams"), []
    wire.subscribe("/tf", TF, Quality.RELIABLE, got.append)
    wire.listen()
    message = Maker().transforms(7, [("odom", "base", Pose2(1.0, 2.0, 0.0))])
    data = bytes(store().cdr_to_ros1(bytes(store().serialize_cdr(message, TF)), TF))
    rospy.subscribed["/tf"](raw("tf/tfMessage", data))
    assert store().deserialize_cdr(got[0].data, TF).transforms[0].child_frame_id == "base"


def test_maps_go_out_as_ros_1_has_them(rospy):
    grid = OccupancyGrid(np.array([[0.0, 1.0, np.nan]], np.float32), 0.05, (-1.0, -2.0))
    message = Maker().grid(8, grid, "map")
    outlet = Ros1Wire("slams").advertise("/map", MAP, Quality.LATCHED)
    outlet.send(bytes(store().serialize_cdr(message, MAP)))
    out = rospy.published["/map"]
    assert out.latch
    assert outlet.readers == 2
    assert out.sent[0].kind == "nav_msgs/OccupancyGrid"
    found = ROS1.deserialize_ros1(out.sent[0].data, MAP)
    assert found.data.tolist() == [0, 100, -1]
    assert found.header.frame_id == "map"
    tf = Ros1Wire("slams").advertise("/tf", TF, Quality.RELIABLE)
    assert not rospy.published["/tf"].latch
    assert tf.readers == 2


def test_topics_have_the_names_of_ros_2(rospy):
    assert Ros1Wire("slams").topics() == {"/scan": SCAN, "/tf": TF}


def test_without_a_master_or_rospy_it_is_said(rospy, monkeypatch):
    rospy.online = False
    monkeypatch.setenv("ROS_MASTER_URI", "http://robot:11311")
    with pytest.raises(ValueError, match="no ROS 1 master at http://robot:11311; start roscore"):
        Ros1Wire("slams")
    monkeypatch.setitem(sys.modules, "rospy", None)
    with pytest.raises(LookupError, match="--ros1 needs rospy"):
        Ros1Wire("slams")


def test_a_scan_goes_through_the_whole_node(rospy, monkeypatch):
    import threading

    from slams.live import LiveSlam, node
    from slams.live.options import NodeOptions

    monkeypatch.setattr(node, "SETTLING", 0.0)
    monkeypatch.setattr(node, "WITHOUT_TF", 0.0)
    wire = Ros1Wire("slams")
    live = LiveSlam("odometry", warm_up=False)
    one = node.Node(live, wire, NodeOptions(map_every=0.0, wait=0.0), lambda said: None)
    scan = Maker().scan(10**9, "laser", laser(91), np.full(91, 2.0, np.float32), 0.1)
    data = bytes(store().cdr_to_ros1(bytes(store().serialize_cdr(scan, SCAN)), SCAN))
    timer = threading.Timer(
        0.05, lambda: rospy.subscribed["/scan"](raw("sensor_msgs/LaserScan", data))
    )
    timer.start()
    one.start(threading.Event())
    one.run(SimpleNamespace(is_set=lambda: not len(one.inbox)), lambda: None)
    one.close()
    assert len(rospy.published["/pose"].sent) == 1
    assert len(rospy.published["/tf"].sent) == 1
