"""The code blocks of the README run."""

import math
import re
import sys
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

from slams.contract import CLAUSES, broken
from slams.player import replay
from slams.registry import find
from slams.summary import truth_errors
from tests import bags
from tests.rooms import drive, fields_of, push_fields
from tests.test_readme import README


def block(word):
    return next(b for b in re.findall(r"```python\n(.*?)```", README, re.S) if word in b)


def test_from_a_bag_to_a_map_in_ten_lines(tmp_path, monkeypatch):
    code = block("slams.load")
    assert len([line for line in code.splitlines() if line.strip()]) <= 10
    log = drive(n=20)
    fan = (log.laser.angle_min, log.laser.angle_increment)
    scans = zip(log.t + 1.0, log.ranges, strict=True)
    bags.write(
        tmp_path, "bag", lambda make: [("/scan", t, make.scan(t, r, angles=fan)) for t, r in scans]
    )
    monkeypatch.chdir(tmp_path)
    exec(code, scope := {})
    assert math.hypot(*np.subtract(scope["pose"], log.truth.values[-1])[:2]) < 0.01
    assert (tmp_path / "map.pgm").stat().st_size > 1000
    assert (tmp_path / "map.yaml").exists()


def test_the_example_of_live_slam_works():
    exec(block("live.push_scan(Scan("), scope := {})
    assert scope["estimate"].used
    assert not scope["estimate"].lost
    assert np.allclose(scope["estimate"].pose, 0.0, atol=1e-3)
    assert np.isfinite(scope["grid"].p).any()


class Node:
    """A stand-in for rclpy's that keeps what a node does."""

    def __init__(self, name):
        self.subscriptions, self.published = {}, []

    def create_publisher(self, kind, topic, qos):
        return SimpleNamespace(publish=self.published.append)

    def create_subscription(self, kind, topic, callback, qos):
        self.subscriptions[topic] = callback

    def create_timer(self, seconds, callback):
        self.timer = callback

    def get_clock(self):
        return MagicMock()


class Buffer:
    def lookup_transform(self, target, source, stamp):
        rotation = SimpleNamespace(z=math.sin(0.25), w=math.cos(0.25))
        transform = SimpleNamespace(translation=SimpleNamespace(x=3.0, y=-2.0), rotation=rotation)
        return SimpleNamespace(transform=transform)


def test_the_node_of_the_readme_publishes_the_correction_and_the_map(monkeypatch):
    """By a ROS where there is none."""
    sent, packages = [], ("geometry_msgs", "nav_msgs", "sensor_msgs")
    names = ["rclpy", "rclpy.node", "rclpy.qos", "tf2_ros", *packages]
    for name in [*names, *(f"{package}.msg" for package in packages)]:
        monkeypatch.setitem(sys.modules, name, MagicMock())
    sys.modules["rclpy.node"].Node, sys.modules["tf2_ros"].Buffer = Node, Buffer
    sys.modules["tf2_ros"].TransformException = KeyError
    sys.modules["tf2_ros"].TransformBroadcaster().sendTransform = sent.append
    sys.modules["geometry_msgs.msg"].TransformStamped = MagicMock
    code = block("class SlamNode")
    assert len([line for line in code.splitlines() if line.strip()]) <= 65
    exec(code, scope := {})
    scope["main"]()
    node = scope["SlamNode"]()
    topic = SimpleNamespace(push_message=lambda scan, **_: node.subscriptions["scan"](scan))
    for scan in drive(n=3):
        stamp = SimpleNamespace(sec=int(scan.t), nanosec=round(scan.t % 1 * 1e9))
        push_fields(topic, **(fields_of(scan) | {"stamp": stamp}))
    assert len(sent) == 3
    assert (sent[0].header.frame_id, sent[0].child_frame_id) == ("map", "odom")
    theta = 2.0 * math.atan2(sent[0].transform.rotation.z, sent[0].transform.rotation.w)
    assert theta == pytest.approx(-0.5)
    node.timer()
    info, grid = node.published[0].info, node.live.map()
    assert len(node.published[0].data) == info.height * info.width == grid.p.size
    assert set(node.published[0].data) <= set(range(-1, 101))


def test_the_example_algorithm_works_and_keeps_the_contract(tmp_path, monkeypatch):
    code = block("class Icp")
    assert len([line for line in code.splitlines() if line.strip()]) <= 30
    (tmp_path / "mine.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    entry = find("mine:Icp")
    sys.modules.pop("mine", None)
    log, slam = drive(n=60), entry.cls(entry.params())
    done = replay(slam, log)
    assert truth_errors(done, log)["per_update"]["translation_m"]["mean"] < 0.02
    assert (slam.map().p == 1.0).any()
    assert [broken(entry, clause) for clause in CLAUSES.values()] == [None] * len(CLAUSES)
