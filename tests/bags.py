"""Bags for tests, written by the rosbags library as a robot's recorder would."""

import math
import sqlite3
import tracemalloc

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import slams
from slams.ros.maker import Maker
from slams.ros.messages import MULTI_ECHO_TYPE, OLD_TF_TYPE, PATH_TYPE, TF_TYPE
from slams.types import Laser, Pose2

MUCH = 32 << 20  # bytes that a refusal may take
STRING = "std_msgs/msg/String"
PACKED = {"folder-zstd": CompressionMode.STORAGE, "folder-db3-each": CompressionMode.MESSAGE}
KINDS = ("bag", "bag-bz2", "bag-lz4", "db3", "mcap", "folder-db3", "folder-mcap", "folder-zstd")

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)
for _name in (TF_TYPE, OLD_TF_TYPE):
    ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _name))


class Make(Maker):
    """Messages of one ROS generation; angles in radians, stamps in seconds."""

    def __init__(self, store):
        self.store = store

    def _header(self, stamp, frame):
        fields = super()._header(stamp, frame)
        return fields if self.store is ROS2 else (0, *fields)

    def quaternion(self, yaw, roll=0.0):
        """Roll about x first, then yaw about z."""
        cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
        cr, sr = math.cos(roll / 2), math.sin(roll / 2)
        return self.of("geometry_msgs/msg/Quaternion", cy * sr, sy * sr, sy * cr, cy * cr)

    def scan(self, t, ranges, frame="laser", angles=(-1.5, 0.1), limits=(0.1, 30.0), beam=0.0):
        fan = Laser(*angles, len(ranges), *limits, time_increment=beam)
        return super().scan(ns(t), frame, fan, ranges, 0.1)

    def echoes(self, t, echoes, frame="laser"):
        beams = [
            self.of("sensor_msgs/msg/LaserEcho", np.array(beam, np.float32)) for beam in echoes
        ]
        numbers = (-1.5, -1.5 + 0.1 * (len(echoes) - 1), 0.1, 0.0, 0.1, 0.1, 30.0)
        return self.of(MULTI_ECHO_TYPE, self._header(ns(t), frame), *numbers, beams, [])

    def odometry(self, t, x, y, yaw, child="base_link", frame="odom"):
        return super().odometry(ns(t), Pose2(x, y, yaw), frame, child)

    def posed(self, t, x, y, yaw):
        return self.pose(ns(t), Pose2(x, y, yaw), "world")

    def path(self, t, rows):
        """The poses (t, x, y, yaw) so far."""
        return self.of(PATH_TYPE, self._header(ns(t), "map"), [self.posed(*row) for row in rows])

    def posed_with_covariance(self, t, x, y, yaw):
        return super().pose_with_covariance(ns(t), Pose2(x, y, yaw), np.zeros((3, 3)), "world")

    def imu(self, t, rates, frame="imu", given=True, roll=0.0):
        message = super().imu(ns(t), rates[2], frame)
        message.orientation_covariance[0] = 0.0
        message.orientation = self.quaternion(0.0, roll)
        message.angular_velocity = self.of("geometry_msgs/msg/Vector3", *rates)
        message.angular_velocity_covariance[0] = 0.0 if given else -1.0
        message.linear_acceleration.z = 9.81
        return message

    def tf(self, t, *transforms, old=False):
        """Each transform: parent, child, (x, y, z), yaw, roll."""
        edges = [(parent, child, Pose2(*xyz[:2], yaw)) for parent, child, xyz, yaw, _ in transforms]
        items = self.transforms(ns(t), edges).transforms
        for item, (_, _, (_, _, z), yaw, roll) in zip(items, transforms, strict=True):
            item.transform.translation.z = z
            item.transform.rotation = self.quaternion(yaw, roll)
        return self.of(OLD_TF_TYPE if old else TF_TYPE, items)

    def string(self, text):
        return self.of(STRING, text)


def ns(t):
    return round(1e9 * t)


def write(folder, kind, messages, name="drive"):
    """A bag of `messages(make)`, a list of (topic, t received, message); returns its path."""
    folder.mkdir(parents=True, exist_ok=True)
    if kind.startswith("bag"):
        return _write1(folder / f"{name}.bag", kind.partition("-")[2], messages(Make(ROS1)))
    plugin = StoragePlugin.SQLITE3 if "db3" in kind else StoragePlugin.MCAP
    path = _write2(folder / name, plugin, messages(Make(ROS2)), PACKED.get(kind))
    if kind.startswith("folder"):
        return path
    return next(path.glob(f"*.{kind}")).rename(folder / f"{name}.{kind}")


def refused(path, **choices):
    """The one sentence in which a log is not read."""
    with pytest.raises(ValueError, match="^" + str(path)) as caught:
        slams.load(path, **choices)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def cheaply_refused(work, path):
    """The one sentence, not a long one, of a refusal that takes little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=path.name) as caught:
            work()
        assert tracemalloc.get_traced_memory()[1] < MUCH
    finally:
        tracemalloc.stop()
    assert len(str(caught.value).splitlines()) == 1
    assert len(str(caught.value)) < 1000
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
        writer.set_compression(packed, CompressionFormat.ZSTD)
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
