"""The room that tests of CRSM drive through, and what they need of it."""

import math

import numpy as np

from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.registry import find
from slams.types import IDENTITY, Laser, Pose2, Scan

LASER = Laser(-2.35, 4.7 / 360, 361, 0.05, 30.0)
# walls of a room with a bay and a box, as segments x0, y0, x1, y1
ROOM = np.array(
    [
        (-3, -2, 4, -2), (4, -2, 4, 1), (4, 1, 5, 1), (5, 1, 5, 3), (5, 3, -3, 3), (-3, 3, -3, -2),
        (1, 0.5, 1.6, 0.5), (1.6, 0.5, 1.6, 1.1), (1.6, 1.1, 1, 1.1), (1, 1.1, 1, 0.5),
    ],
    float,
)  # fmt: skip


def cast(pose, laser=LASER, walls=ROOM, noise=0.0, rng=None):
    """Ranges of a laser at the base pose `pose` among wall segments."""
    at = pose @ laser.mount
    a = at.theta + laser.angles
    d = np.stack((np.cos(a), np.sin(a)), 1)[:, None]
    p, e = walls[:, :2] - (at.x, at.y), walls[:, 2:] - walls[:, :2]
    cross = d[..., 0] * e[:, 1] - d[..., 1] * e[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        r = (p[:, 0] * e[:, 1] - p[:, 1] * e[:, 0]) / cross
        u = (p[:, 0] * d[..., 1] - p[:, 1] * d[..., 0]) / cross
    r = np.where((r > 0) & (u >= 0) & (u <= 1), r, np.inf).min(axis=1)
    r = r + (rng.normal(0.0, noise, r.shape) if noise else 0.0)
    ranges = r.astype(np.float32)
    ranges.flags.writeable = False
    return ranges


def drive(n=60, start=IDENTITY):
    """A curve through the room."""
    poses = [start]
    for _ in range(n - 1):
        poses.append(poses[-1] @ Pose2(0.02, 0.0, 0.02))
    return poses


def scans_of(poses, laser=LASER, noise=0.01, **extra):
    rng = np.random.default_rng(3)
    return [
        Scan(0.1 * i, cast(p, laser, noise=noise, rng=rng), laser, **extra)
        for i, p in enumerate(poses)
    ]


def Parameters(**changes):
    """Those of a small map, all of whose cells can be looked at."""
    return CrsmParams(**{"max_cells": 1 << 16} | changes)


def run(scans, **changes):
    entry = find(f"crsm@{changes.pop('preset', 'default')}")
    slam = entry.cls(entry.params().replace(**changes))
    return slam, np.array([slam.update(s) for s in scans])


def errors(poses, truth):
    e = [truth[0].between(t).between(Pose2(*p)) for p, t in zip(poses, truth, strict=True)]
    return np.array([(math.hypot(x.x, x.y), abs(x.theta)) for x in e])


def reader_of(pose=IDENTITY, laser=LASER, **extra):
    reader = ScanReader(Parameters())
    reader.take(Scan(0.0, cast(pose, laser), laser, **extra), IDENTITY)
    return reader


def noisy_view(seed=4, pose=IDENTITY):
    """A scan with walls and lone points: the box of the room is a thing of 3 beams here."""
    ranges = cast(pose, noise=0.01, rng=np.random.default_rng(seed)).copy()
    ranges[40:360:32] -= 0.4
    reader = ScanReader(Parameters())
    reader.take(Scan(0.0, ranges, LASER), IDENTITY)
    return reader


def off_the_walls(points):
    """Distance of each point (n, 2) to the nearest wall of the room."""
    p, e = ROOM[:, :2], ROOM[:, 2:] - ROOM[:, :2]
    along = ((points[:, None] - p) * e).sum(axis=2) / (e * e).sum(axis=1)
    foot = p + np.clip(along, 0.0, 1.0)[..., None] * e
    return np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1)
