"""The room that tests match against, and what only they need of it."""

import math
from types import SimpleNamespace

import numpy as np

from slams import run
from slams.geometry import Prior
from slams.registry import BASELINES, BUILT_IN, find, names
from slams.registry import create as made
from slams.test_world import ROOM, box, cast, drive, drive_poses, laser, scan_at  # noqa: F401
from slams.types import IDENTITY, Pose2

ALGORITHMS = [name for name in BUILT_IN if name not in BASELINES]
ORIGINALS = [f"{name}@original" for name in ALGORITHMS]
LIDAR = laser(181)
NOTHING = Prior(IDENTITY, np.zeros((3, 3)))  # is known before a scan
CORRIDOR = np.array([(-50.0, -1.0, 50.0, -1.0), (-50.0, 1.0, 50.0, 1.0)])


def moved(motion, poses):
    """Poses (n, 3) as they are in a frame in which theirs lies at `motion`."""
    return np.array([motion @ Pose2(*pose) for pose in poses.tolist()])


def error(a, b):
    """How far two poses are apart, and how much turned."""
    step = Pose2(*a).between(Pose2(*b))
    return math.hypot(step.x, step.y), abs(step.theta)


def mirrored(segments):
    return segments * np.array([1.0, -1.0, 1.0, -1.0])


def labels():
    """Every algorithm with each of its presets."""
    of = {name: find(name).cls.Params.presets()[1:] for name in names()}
    return [label for name in of for label in (name, *(f"{name}@{preset}" for preset in of[name]))]


def command(*arguments):
    """The exit code of `slams run`."""
    return run.main([str(argument) for argument in arguments])


def still(k, **more):
    """The k-th scan of a robot that stands at the origin."""
    return scan_at((0.0, 0.0, 0.0), LIDAR, t=0.1 * k, **more)


def fields_of(scan):
    """The fields of a scan's message, the stamp in seconds, and its odometry."""
    names = ("angle_min", "angle_increment", "range_min", "range_max", "time_increment")
    fan = {name: getattr(scan.laser, name) for name in names}
    return fan | {"stamp": scan.t, "ranges": scan.ranges, "odometry": scan.odometry}


def push_fields(live, stamp, **fields):
    """Give a `LiveSlam` a message of these fields, and the readings among them."""
    names = ("odometry", "yaw", "attitude", "mid_odometry", "mid_yaw")
    readings = {name: fields.pop(name) for name in names if name in fields}
    message = SimpleNamespace(header=SimpleNamespace(stamp=stamp), **fields)
    return live.push_message(message, **readings)


def rewritten(source, target, **changes):
    """A copy of an npz with other arrays; None takes one away."""
    with np.load(source) as archive:
        arrays = dict(archive) | changes
    np.savez(target, **{key: value for key, value in arrays.items() if value is not None})
    return target


def calls(monkeypatch, owner, name):
    """The arguments of every call of a method from now on."""
    method, made = getattr(owner, name), []

    def noted(*args, **more):
        made.append((*args, *more.values()))
        return method(*args, **more)

    monkeypatch.setattr(owner, name, noted)
    return made


def driven(label, scans, **changes):
    """An algorithm after these scans."""
    slam = made(label, **changes)
    for scan in scans:
        slam.update(scan)
    return slam


def settled(label, n, odometry=None, **changes):
    """An algorithm after `n` scans of a robot that stands still."""
    return driven(label, (still(k, odometry=odometry) for k in range(n)), **changes)
