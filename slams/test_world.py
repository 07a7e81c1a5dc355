"""A small room of line segments and drives through it, by plain numpy.

Used by the checks of the contract, the tests and the warm-up of `LiveSlam`. The simulator of the
benchmark is in `bench`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from slams.scanlog import ScanLog, TimeSeries
from slams.types import IDENTITY, Floats, Laser, Pose2, Scan

Segment = tuple[float, float, float, float]


def box(x0: float, y0: float, x1: float, y1: float) -> list[Segment]:
    """The four sides of a rectangle."""
    return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]


ROOM: Floats = np.array(
    [
        *box(-4.0, -3.0, 5.0, 4.0),
        *box(2.5, 1.0, 3.3, 2.2),
        *box(-2.6, -1.9, -2.0, -1.2),
        (-4.0, 2.2, -2.0, 2.2),
        (0.5, -3.0, 0.9, -1.8),
    ]
)


def laser(
    n_beams: int = 361,
    fov: float = 1.5 * math.pi,
    mount: Pose2 = IDENTITY,
    time_increment: float = 0.0,
    range_max: float = 30.0,
) -> Laser:
    """A laser that faces ahead with a field of view of `fov` [rad]."""
    step = fov / (n_beams - 1) if n_beams > 1 else 0.0
    return Laser(-0.5 * fov, step, n_beams, 0.1, range_max, mount, time_increment)


def cast(segments: Floats, poses: Sequence[float] | Floats, lidar: Laser) -> Floats:
    """Exact ranges (n_beams,) [m] from a base pose (3,), or one of each beam (n_beams, 3).

    inf where a beam hits nothing.
    """
    sensors = np.array([Pose2(*pose) @ lidar.mount for pose in np.atleast_2d(poses)])
    angles = lidar.angles + sensors[:, 2]
    d = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None, :]
    a = segments[None, :, :2] - sensors[:, None, :2]
    e = (segments[:, 2:] - segments[:, :2])[None]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
        r = (a[..., 0] * e[..., 1] - a[..., 1] * e[..., 0]) / cross
        u = (a[..., 0] * d[..., 1] - a[..., 1] * d[..., 0]) / cross
    r[~((r > 0.0) & (u >= 0.0) & (u <= 1.0))] = np.inf
    nearest: Floats = r.min(axis=1)
    return nearest


def scan_at(
    pose: Sequence[float] | Floats,
    lidar: Laser | None = None,
    segments: Floats = ROOM,
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
    t: float = 0.0,
    odometry: Pose2 | None = None,
    yaw: float | None = None,
) -> Scan:
    """The scan from a pose; `noise` [m] is drawn from `rng`."""
    lidar = lidar or laser()
    ranges = cast(segments, pose, lidar)
    if noise and rng is not None:
        ranges = ranges + rng.normal(0.0, noise, len(ranges))
    single = ranges.astype(np.float32)
    single.flags.writeable = False
    return Scan(t, single, lidar, odometry, yaw)


def drive_poses(n: int, dt: float) -> Floats:
    """Poses (n, 3) of a smooth drive around the room, at most about 0.6 m/s and 0.6 rad/s."""
    s = 0.35 * dt * np.arange(n)
    x, y = 1.2 * np.sin(s), 0.9 * np.sin(2.0 * s) * 0.6
    theta = 0.8 * np.sin(0.7 * s)
    return np.stack([x, y, theta], axis=1)


def drive(
    n: int = 200,
    rate: float = 20.0,
    noise: float = 0.01,
    seed: int = 0,
    lidar: Laser | None = None,
    segments: Floats = ROOM,
) -> ScanLog:
    """A log of the room with truth, drifting odometry and a gyro."""
    rng = np.random.default_rng(seed)
    lidar = lidar or laser()
    t = np.arange(n) / rate
    poses = scan_poses = drive_poses(n, 1.0 / rate)
    if lidar.time_increment:  # beams are measured one after the other while moving
        b = lidar.n_beams
        stamps = t[:, None] + lidar.time_increment * np.arange(b)
        samples = np.rint(stamps * rate * b).astype(int)
        scan_poses = drive_poses(n * b, 1.0 / (rate * b))[np.minimum(samples, n * b - 1)]
    ranges = np.array([cast(segments, scan, lidar) for scan in scan_poses])
    noisy = (ranges + rng.normal(0.0, noise, ranges.shape)).astype(np.float32)
    odom = TimeSeries(t, _drifting(poses, rng))
    true_rate = np.gradient(poses[:, 2], t) if n > 1 else np.zeros(1)
    yaw_rate = TimeSeries(t, true_rate + 0.001)
    return ScanLog(t, noisy, lidar, odom, TimeSeries(t, poses), yaw_rate, {"name": "room"})


def _drifting(poses: Floats, rng: np.random.Generator) -> Floats:
    """Odometry (n, 3) in its own frame: 2 % too long, with slip."""
    steps = [Pose2(*a).between(Pose2(*b)) for a, b in pairwise(poses)]
    odom = [Pose2(3.0, -2.0, 0.5)]
    for step in steps:
        slip = rng.normal(0.0, 0.02, 3) * np.array([abs(step.x), abs(step.x), abs(step.theta)])
        moved = Pose2(step.x * 1.02 + slip[0], step.y + slip[1], step.theta + slip[2])
        odom.append(odom[-1] @ moved)
    return np.array(odom)


def odd_scans() -> dict[str, Scan]:
    """Scans with the faults of real lasers, by name."""
    lidar = laser()
    good = scan_at((0.0, 0.0, 0.0), lidar)

    def _scan(t: float, values: object, fan: Laser = lidar, odom: Pose2 | None = None) -> Scan:
        ranges = np.array(values, np.float32)
        ranges.flags.writeable = False
        return Scan(t, ranges, fan, odom)

    n = lidar.n_beams
    return {
        "nothing but inf": _scan(1.0, np.full(n, np.inf)),
        "nothing but nan": _scan(2.0, np.full(n, np.nan)),
        "one beam": _scan(3.0, [2.0], Laser(0.0, 0.0, 1, 0.1, 30.0)),
        "two beams": _scan(3.1, [2.0, np.nan], Laser(0.0, 0.1, 2, 0.1, 30.0)),
        "zeros": _scan(4.0, np.zeros(n)),
        "another beam count": scan_at((0.0, 0.0, 0.0), laser(91), t=5.0),
        "clockwise": scan_at((0.0, 0.0, 0.0), Laser(2.0, -0.02, 200, 0.1, 30.0), t=6.0),
        "stamp jumps back": _scan(0.5, good.ranges),
        "same stamp": _scan(0.5, good.ranges),
        "far jump of odometry": _scan(7.0, good.ranges, lidar, Pose2(1e3, -1e3, 3.0)),
        "many more beams": scan_at((0.0, 0.0, 0.0), laser(1441), t=8.0),
        "odometry of nan": _scan(9.0, good.ranges, lidar, Pose2(math.nan, math.nan, math.nan)),
        "odometry of inf": _scan(9.1, good.ranges, lidar, Pose2(math.inf, 0.0, 0.0)),
        "infinite heading": _scan(9.2, good.ranges, lidar, Pose2(0.0, 0.0, math.inf)),
        "yaw of nan": replace(good, t=9.3, yaw=math.nan),
        "infinite yaw": replace(good, t=9.4, yaw=math.inf),
    }
