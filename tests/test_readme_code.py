"""The code blocks of the README run."""

import math
import re
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from slams.contract import CLAUSES, broken
from slams.player import replay
from slams.registry import find
from slams.summary import truth_errors
from tests import bags
from tests.places import ROOT
from tests.rooms import drive

README = "\n".join(
    path.read_text(encoding="utf-8") for path in (ROOT / "README.md", *ROOT.glob("docs/*.md"))
)


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
    exec(block("live.push("), scope := {})
    assert scope["estimate"].used
    assert not scope["estimate"].lost
    assert np.allclose(scope["estimate"].pose, 0.0, atol=1e-3)
    assert np.isfinite(scope["grid"].p).any()


class Message(SimpleNamespace):
    """A message: any field can be set, at any depth."""

    def __getattr__(self, name):
        value = Message()
        setattr(self, name, value)
        return value


@pytest.fixture
def ros(monkeypatch):
    """Stand-ins for rclpy and its messages that keep what a node does."""

    class Node:
        def __init__(self, name):
            self.subscriptions, self.published = {}, []

        def create_publisher(self, kind, topic, qos):
            return SimpleNamespace(publish=self.published.append)

        def create_subscription(self, kind, topic, callback, qos):
            self.subscriptions[topic] = callback

        def create_timer(self, seconds, callback):
            self.timer = callback

        def get_clock(self):
            return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: 0))

    class Buffer:
        pose = (3.0, -2.0, 0.5)

        def lookup_transform(self, target, source, stamp):
            x, y, theta = self.pose
            rotation = SimpleNamespace(z=math.sin(theta / 2), w=math.cos(theta / 2))
            translation = SimpleNamespace(x=x, y=y)
            return SimpleNamespace(
                transform=SimpleNamespace(translation=translation, rotation=rotation)
            )

    sent = []
    modules = {
        "rclpy": {"init": lambda: None, "spin": lambda node: None},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {
            "DurabilityPolicy": SimpleNamespace(TRANSIENT_LOCAL=1),
            "QoSProfile": lambda **_: None,
            "qos_profile_sensor_data": None,
        },
        "geometry_msgs.msg": {"TransformStamped": Message},
        "nav_msgs.msg": {"OccupancyGrid": Message},
        "sensor_msgs.msg": {"LaserScan": Message},
        "tf2_ros": {
            "Buffer": Buffer,
            "TransformListener": lambda buffer, node: None,
            "TransformBroadcaster": lambda node: SimpleNamespace(sendTransform=sent.append),
            "TransformException": KeyError,
        },
    }
    for package in ("geometry_msgs", "nav_msgs", "sensor_msgs"):
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    return sent


def test_the_node_of_the_readme_publishes_the_correction_and_the_map(ros):
    code = block("class SlamNode")
    assert len([line for line in code.splitlines() if line.strip()]) <= 65
    exec(code, scope := {})
    scope["main"]()
    node = scope["SlamNode"]()
    for scan in drive(n=3):
        stamp = SimpleNamespace(sec=int(scan.t), nanosec=round(scan.t % 1 * 1e9))
        node.subscriptions["scan"](
            SimpleNamespace(
                header=SimpleNamespace(stamp=stamp),
                ranges=scan.ranges,
                time_increment=0.0,
                **{
                    key: getattr(scan.laser, key)
                    for key in ("angle_min", "angle_increment", "range_min", "range_max")
                },
            )
        )
    assert len(ros) == 3
    assert (ros[0].header.frame_id, ros[0].child_frame_id) == ("map", "odom")
    theta = 2.0 * math.atan2(ros[0].transform.rotation.z, ros[0].transform.rotation.w)
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
