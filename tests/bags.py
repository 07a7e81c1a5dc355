"""Bags for tests, written by the rosbags library as a robot's recorder would."""

import math
import sqlite3

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import slams

SCAN, ECHOES = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/MultiEchoLaserScan"
ODOMETRY, IMU = "nav_msgs/msg/Odometry", "sensor_msgs/msg/Imu"
POSE, POSE_COV = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"
PATH = "nav_msgs/msg/Path"
TF, OLD_TF, STRING = "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage", "std_msgs/msg/String"
KINDS = ("bag", "bag-bz2", "bag-lz4", "db3", "mcap", "folder-db3", "folder-mcap", "folder-zstd")

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)
for _name in (TF, OLD_TF):
    ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _name))


class Make:
    """Messages of one ROS generation; angles in radians, stamps in seconds."""

    def __init__(self, store):
        self.store, self.types = store, store.types

    def of(self, name, *fields):
        return self.types[name](*fields)

    def header(self, t, frame):
        time = self.of("builtin_interfaces/msg/Time", *divmod(round(t * 1e9), 10**9))
        fields = (time, frame) if self.store is ROS2 else (0, time, frame)
        return self.of("std_msgs/msg/Header", *fields)

    def quaternion(self, yaw, roll=0.0):
        """Roll about x first, then yaw about z."""
        cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
        cr, sr = math.cos(roll / 2), math.sin(roll / 2)
        return self.of("geometry_msgs/msg/Quaternion", cy * sr, sy * sr, sy * cr, cy * cr)

    def pose(self, x, y, yaw):
        point = self.of("geometry_msgs/msg/Point", x, y, 0.0)
        return self.of("geometry_msgs/msg/Pose", point, self.quaternion(yaw))

    def vector(self, x, y, z):
        return self.of("geometry_msgs/msg/Vector3", x, y, z)

    def scan(self, t, ranges, frame="laser", angles=(-1.5, 0.1), limits=(0.1, 30.0), beam=0.0):
        ranges = np.asarray(ranges, np.float32)
        end = angles[0] + angles[1] * (len(ranges) - 1)
        numbers = (angles[0], end, angles[1], beam, 0.1, *limits)
        nothing = np.zeros(0, np.float32)
        return self.of(SCAN, self.header(t, frame), *numbers, ranges, nothing)

    def echoes(self, t, echoes, frame="laser"):
        beams = [
            self.of("sensor_msgs/msg/LaserEcho", np.array(beam, np.float32)) for beam in echoes
        ]
        end = -1.5 + 0.1 * (len(echoes) - 1)
        return self.of(
            ECHOES, self.header(t, frame), -1.5, end, 0.1, 0.0, 0.1, 0.1, 30.0, beams, []
        )

    def odometry(self, t, x, y, yaw, child="base_link", frame="odom"):
        zero = np.zeros(36)
        pose = self.of("geometry_msgs/msg/PoseWithCovariance", self.pose(x, y, yaw), zero)
        twist = self.of("geometry_msgs/msg/Twist", self.vector(0, 0, 0), self.vector(0, 0, 0))
        twist = self.of("geometry_msgs/msg/TwistWithCovariance", twist, zero)
        return self.of(ODOMETRY, self.header(t, frame), child, pose, twist)

    def posed(self, t, x, y, yaw):
        return self.of(POSE, self.header(t, "world"), self.pose(x, y, yaw))

    def path(self, t, rows):
        """The poses (t, x, y, yaw) so far."""
        return self.of(PATH, self.header(t, "map"), [self.posed(*row) for row in rows])

    def posed_with_covariance(self, t, x, y, yaw):
        pose = self.of("geometry_msgs/msg/PoseWithCovariance", self.pose(x, y, yaw), np.zeros(36))
        return self.of(POSE_COV, self.header(t, "world"), pose)

    def imu(self, t, rates, frame="imu", given=True, roll=0.0):
        nine = np.zeros(9)
        rate = np.array([0.0 if given else -1.0, *[0.0] * 8])
        w, a = self.vector(*rates), self.vector(0.0, 0.0, 9.81)
        return self.of(
            IMU, self.header(t, frame), self.quaternion(0.0, roll), nine, w, rate, a, nine
        )

    def tf(self, t, *transforms, old=False):
        """Each transform: parent, child, (x, y, z), yaw, roll."""
        items = [
            self.of(
                "geometry_msgs/msg/TransformStamped",
                self.header(t, parent),
                child,
                self.of(
                    "geometry_msgs/msg/Transform", self.vector(*place), self.quaternion(yaw, roll)
                ),
            )
            for parent, child, place, yaw, roll in transforms
        ]
        return self.of(OLD_TF if old else TF, items)

    def string(self, text):
        return self.of(STRING, text)


def write(folder, kind, messages, name="drive"):
    """A bag of `messages(make)`, a list of (topic, t received, message); returns its path."""
    folder.mkdir(parents=True, exist_ok=True)
    if kind.startswith("bag"):
        return _write1(folder / f"{name}.bag", kind.partition("-")[2], messages(Make(ROS1)))
    plugin = StoragePlugin.SQLITE3 if "db3" in kind else StoragePlugin.MCAP
    path = _write2(folder / name, plugin, messages(Make(ROS2)), kind == "folder-zstd")
    if kind.startswith("folder"):
        return path
    return next(path.glob(f"*.{kind}")).rename(folder / f"{name}.{kind}")


def refused(path, **choices):
    """The one sentence in which a log is not read."""
    with pytest.raises(ValueError, match="^" + str(path)) as caught:
        slams.load(path, **choices)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def _write1(path, compression, messages):
    writer = Writer1(path)
    writer.chunk_threshold = 1 << 15
    if compression:
        writer.set_compression(writer.CompressionFormat[compression.upper()])
    with writer:
        _put(writer, ROS1, ROS1.serialize_ros1, messages)
    return path


def _write2(path, plugin, messages, packed):
    writer = Writer2(path, version=9, storage_plugin=plugin)
    if packed:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        _put(writer, ROS2, ROS2.serialize_cdr, messages)
    return path


def _put(writer, store, serialize, messages):
    connections = {}
    for topic, t, message in messages:
        key = topic, message.__msgtype__
        if key not in connections:
            connections[key] = writer.add_connection(*key, typestore=store)
        data = serialize(message, message.__msgtype__)
        writer.write(connections[key], round(t * 1e9), bytes(data))


def forget_definitions(path):
    """Make a db3 as Foxy recorded it: topics and messages, no definitions, no versions."""
    database = sqlite3.connect(path)
    for table in ("message_definitions", "schema", "metadata"):
        database.execute(f"DROP TABLE {table}")
    database.execute("ALTER TABLE topics DROP COLUMN type_description_hash")
    database.commit()
    database.close()


def ros1_in_mcap(folder, messages):
    """Messages of ROS 1 in an mcap, as `mcap convert` makes them of a bag."""
    with Writer2(folder / "one", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        for topic, t, message in messages(Make(ROS1)):
            name = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic,
                    name.replace("/msg/", "/"),
                    msgdef=ROS1.generate_msgdef(name)[0],
                    rihs01="none",
                    serialization_format="ros1",
                )
            data = bytes(ROS1.serialize_ros1(message, name))
            writer.write(connections[topic], round(t * 1e9), data)
    path = folder / "one" / "one.mcap"
    path.write_bytes(path.read_bytes().replace(b"ros2msg", b"ros1msg"))
    return path
