"""A small room of line segments and drives through it, by plain numpy: what tests match against."""

import numpy as np

from slams.scanlog import ScanLog, Track
from slams.types import IDENTITY, Laser, Pose2, Scan


def box(x0, y0, x1, y1):
    return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]


ROOM = np.array(
    [
        *box(-4.0, -3.0, 5.0, 4.0),
        *box(2.5, 1.0, 3.3, 2.2),
        *box(-2.6, -1.9, -2.0, -1.2),
        (-4.0, 2.2, -2.0, 2.2),
        (0.5, -3.0, 0.9, -1.8),
    ]
)
CORRIDOR = np.array([(-50.0, -1.0, 50.0, -1.0), (-50.0, 1.0, 50.0, 1.0)])


def mirrored(segments):
    return segments * np.array([1.0, -1.0, 1.0, -1.0])


def laser(n_beams=361, fov=1.5 * np.pi, mount=IDENTITY, time_increment=0.0, range_max=30.0):
    step = fov / (n_beams - 1) if n_beams > 1 else 0.0
    return Laser(-0.5 * fov, step, n_beams, 0.1, range_max, mount, time_increment)


def cast(segments, pose, lidar):
    """Exact ranges of one instantaneous scan from the base pose; inf where nothing is hit."""
    sensor = Pose2(*pose) @ lidar.mount
    angles = lidar.angles + sensor.theta
    d = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None, :]
    a = segments[None, :, :2] - np.array([sensor.x, sensor.y])
    e = (segments[:, 2:] - segments[:, :2])[None]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
        r = (a[..., 0] * e[..., 1] - a[..., 1] * e[..., 0]) / cross
        u = (a[..., 0] * d[..., 1] - a[..., 1] * d[..., 0]) / cross
    r[~((r > 0.0) & (u >= 0.0) & (u <= 1.0))] = np.inf
    return r.min(axis=1)


def scan_at(pose, lidar=None, segments=ROOM, noise=0.0, rng=None, t=0.0, odometry=None, yaw=None):
    lidar = lidar or laser()
    ranges = cast(segments, pose, lidar)
    if noise:
        ranges = ranges + rng.normal(0.0, noise, len(ranges))
    ranges = ranges.astype(np.float32)
    ranges.flags.writeable = False
    return Scan(t, ranges, lidar, odometry, yaw)


def way(n, dt):
    """Poses (n, 3) of a smooth drive around the room, at most about 0.6 m/s and 0.6 rad/s."""
    s = 0.35 * dt * np.arange(n)
    x, y = 1.2 * np.sin(s), 0.9 * np.sin(2.0 * s) * 0.6
    theta = 0.8 * np.sin(0.7 * s)
    return np.stack([x, y, theta], axis=1)


def drive(
    n=200, rate=20.0, noise=0.01, seed=0, lidar=None, segments=ROOM, odometry=True, gyro=True
):
    """A ScanLog of the room with truth, drifting odometry and a gyro."""
    rng = np.random.default_rng(seed)
    lidar = lidar or laser()
    t = np.arange(n) / rate
    poses = way(n, 1.0 / rate)
    if lidar.time_increment:
        fine = way(n * lidar.n_beams, 1.0 / (rate * lidar.n_beams))
        ranges = np.empty((n, lidar.n_beams))
        for i in range(n):
            for k in range(lidar.n_beams):
                sample = round((t[i] + k * lidar.time_increment) * rate * lidar.n_beams)
                one = Laser(lidar.angles[k], 0.0, 1, 0.1, 30.0, lidar.mount)
                ranges[i, k] = cast(segments, fine[min(sample, len(fine) - 1)], one)[0]
    else:
        ranges = np.array([cast(segments, pose, lidar) for pose in poses])
    ranges = (ranges + rng.normal(0.0, noise, ranges.shape)).astype(np.float32)
    steps = [Pose2(*a).between(Pose2(*b)) for a, b in zip(poses[:-1], poses[1:], strict=True)]
    odom = [Pose2(3.0, -2.0, 0.5)]
    for step in steps:
        slip = rng.normal(0.0, 0.02, 3) * np.array([abs(step.x), abs(step.x), abs(step.theta)])
        odom.append(
            odom[-1] @ Pose2(step.x * 1.02 + slip[0], step.y + slip[1], step.theta + slip[2])
        )
    rate_of_turn = np.gradient(poses[:, 2], t) if n > 1 else np.zeros(1)
    return ScanLog(
        t,
        ranges,
        lidar,
        Track(t, np.array(odom)) if odometry else None,
        Track(t, poses),
        Track(t, rate_of_turn + 0.001) if gyro else None,
        {"name": "room"},
    )
