"""Robots for tests: nodes on a network in memory, fed by the player or message by message.

What is sent arrives at once, in the thread that sends it.
"""

import threading
from types import SimpleNamespace

import numpy as np

import slams
from slams import LiveSlam
from slams.live import node
from slams.live.node import Node
from slams.live.options import NodeOptions, Quality, topic_names
from slams.live.recorder import Recorder
from slams.live.robot import Robot
from slams.player import replay
from slams.ros import messages
from slams.ros.maker import Maker
from slams.ros.messages import IMU_TYPE, ODOMETRY_TYPE, SCAN_TYPE, TF_TYPE, Record, typestore
from slams.scanlog import TimeSeries
from slams.types import Pose2
from tests.rooms import drive, drive_poses, laser, scan_at

LASER = laser(91)
MOUNT = Pose2(0.2, -0.05, 0.3)


def robot_log(n=40, first=0.0, gyro=True, time_increment=0.0):
    """Scans at 10 Hz, odometry at 30 from `first` [s], a gyro at 100, on stamps of their own."""
    lidar = laser(181, mount=MOUNT, time_increment=time_increment)
    log = drive(n=n, rate=10.0, lidar=lidar)
    t = np.arange(first, log.t[-1] + 0.2, 1.0 / 30.0) + 0.003
    poses = drive_poses(len(t), 1.0 / 30.0) + np.array([5.0, 1.0, 3.1])  # headings pass pi
    poses[:, 2] = slams.types.wrap_angle(poses[:, 2])
    turning = np.arange(0.0, log.t[-1] + 0.2, 0.01)
    rate = TimeSeries(turning + 100.0, np.gradient(0.8 * np.sin(0.245 * turning), turning) + 0.001)
    wheels = TimeSeries(t + 100.0, poses)
    yaw_rate, name = rate if gyro else None, {"name": "robot"}
    return slams.ScanLog(log.t + 100.0, log.ranges, log.laser, wheels, None, yaw_rate, name)


class Bus:
    """Topics that several transports share; `sent` gives all messages of a topic, decoded."""

    def __init__(self):
        self.types, self.callbacks, self.kept, self.raw = {}, {}, {}, {}

    def transport(self):
        return BusTransport(self)

    def sent(self, topic):
        return [typestore().deserialize_cdr(d, self.types[topic]) for d in self.raw.get(topic, [])]

    def publish(self, topic, msgtype, message, quality=Quality.RELIABLE):
        data = bytes(typestore().serialize_cdr(message, msgtype))
        self.transport().advertise(topic, msgtype, quality).publish(data)


class BusTransport:
    def __init__(self, bus):
        self.bus, self.wanted = bus, []
        self.closed = False

    def subscribe(self, topic, msgtype, quality, callback):
        self.wanted.append((topic, msgtype, callback))

    def advertise(self, topic, msgtype, quality):
        bus = self.bus
        bus.types[topic] = msgtype

        def publish(data):
            bus.raw.setdefault(topic, []).append(data)
            if quality is Quality.LATCHED:
                bus.kept[topic] = data
            for kind, callback in bus.callbacks.get(topic, []):
                if kind == msgtype:
                    callback(Record(topic, msgtype, len(bus.raw[topic]), data))

        return SimpleNamespace(publish=publish, subscribers=1)

    def listen(self):
        for topic, msgtype, callback in self.wanted:
            self.bus.callbacks.setdefault(topic, []).append((msgtype, callback))
            if topic in self.bus.kept:
                callback(Record(topic, msgtype, 0, self.bus.kept[topic]))

    def published(self, msgtype):
        return sorted(topic for topic, kind in self.bus.types.items() if kind == msgtype)

    def close(self):
        self.closed = True


class Ending:
    """An end that is asked for at the `n`-th look; `action` is done at the third."""

    def __init__(self, n, action=lambda: None):
        self.looks, self.n, self.action = 0, n, action

    def is_set(self):
        self.looks += 1
        if self.looks == 3:
            self.action()
        return self.looks >= self.n

    def wait(self, seconds):
        """Nothing else happens meanwhile."""


class Idle:
    """An end that comes when no scan waits, or none is taken any more."""

    def __init__(self, scans):
        self.scans, self.waited = scans, None

    def is_set(self):
        before, self.waited = self.waited, len(self.scans)
        return self.waited in (0, before)


class Stand:
    """A node and its bus; `notes` are its messages to the user, `file` is its recording."""

    def __init__(
        self, monkeypatch, algorithm="odometry", file=None, bus=None, begin=None, **options
    ):
        for time in ("TF_SETTLING_TIME", "MAX_TF_WAIT", "POLL_PERIOD"):
            monkeypatch.setattr(node, time, 0.0)
        self.bus, self.notes, self.make = bus or Bus(), [], Maker()
        usual = {"map_every": 0.0, "wait": 0.0}
        self.algorithm, self.file = algorithm, file
        self.live = LiveSlam(algorithm, warm_up=False, **(begin or {}))
        self.transport = self.bus.transport()
        options = NodeOptions(**(usual | options))
        self.node = Node(self.live, self.transport, options, self.notes.append)
        self.node.recorder = None if file is None else Recorder(file, options)
        self.transport.listen()
        self.transport.wanted.clear()

    def start(self, *stamps, ending=None):
        """After scans of these stamps [s], if there are any."""
        for t in stamps:
            self.scan(t)
        self.node.start(ending or threading.Event())

    def drive(self):
        self.node.run(Idle(self.node.scans), lambda: None)

    def start_and_drive(self, *stamps):
        self.start(*stamps)
        self.drive()

    def recorded(self, **load):
        """What the node recorded, and the algorithm after a run of it: the node's poses again."""
        self.node.close()
        log, slam = slams.load(self.file, **load), slams.create(self.algorithm)
        run = replay(slam, log)
        assert np.array_equal(self.node.drive.t, run.t)
        assert np.array_equal(self.node.drive.poses, run.poses)
        return log, slam

    def scans_seen(self):
        """The scans that the algorithm gets from now on."""
        seen, push = [], self.live.push_scan
        self.live.push_scan = lambda scan: seen.append(scan) or push(scan)
        return seen

    def look(self):
        self.node.check()

    def play(self, log):
        robot = Robot(log, self.bus.transport(), topic_names())
        for moment in robot.schedule:
            robot.send(moment)

    def tf(self, *edges, t=0, static=True):
        topic = "/tf_static" if static else "/tf"
        quality = Quality.LATCHED if static else Quality.RELIABLE
        self.bus.publish(topic, TF_TYPE, self.make.transforms(t, edges), quality)

    def scan(self, t, frame="laser", pose=(0.0, 0.0, 0.0), topic="/scan"):
        self.bus.publish(topic, SCAN_TYPE, scan_message(t, frame, pose))

    def odometry(self, t, pose, child="base_link"):
        message = self.make.odometry(round(1e9 * t), Pose2(*pose), "odom", child)
        self.bus.publish("/odom", ODOMETRY_TYPE, message)

    def moved(self, t, pose, child="base_link"):
        self.tf(("odom", child, Pose2(*pose)), t=round(1e9 * t), static=False)

    def gyro(self, t, rate, frame="imu"):
        self.bus.publish("/imu", IMU_TYPE, self.make.imu(round(1e9 * t), rate, frame))


def mounted(monkeypatch, **options):
    stand = Stand(monkeypatch, **options)
    stand.tf(("base_link", "laser", MOUNT))
    return stand


def scan_message(t, frame="laser", pose=(0.0, 0.0, 0.0)):
    return Maker().scan(round(1e9 * t), frame, LASER, scan_at(pose, LASER).ranges, 0.1)


def scan_record(t, topic="/scan"):
    return Record(topic, SCAN_TYPE, 0, bytes(typestore().serialize_cdr(scan_message(t), SCAN_TYPE)))


def planar(where, rotation):
    return Pose2(where.x, where.y, messages.yaw_of(rotation))


def close(a, b):
    return np.allclose(a, b, rtol=0.0, atol=1e-12)
