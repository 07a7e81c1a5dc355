"""Drives through the room and scans of it, as tests of CRSM need them."""

import numpy as np

from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.types import IDENTITY, Pose2
from tests.rooms import driven, laser, scan_at

LASER = laser(721)


def drive(n):
    poses = [IDENTITY]
    for _ in range(n - 1):
        poses.append(poses[-1] @ Pose2(0.02, 0.0, 0.02))
    return poses


def mapped(n=10, **changes):
    """CRSM after a drive with a noisy laser."""
    rng, poses = np.random.default_rng(3), enumerate(drive(n))
    scans = (scan_at(pose, LASER, noise=0.01, rng=rng, t=0.1 * i) for i, pose in poses)
    return driven("crsm", scans, **changes)


def reader_of(scan):
    return ScanReader(CrsmParams()).read(scan, IDENTITY)


def noisy_view(seed=4, pose=IDENTITY):
    """A scan with walls and isolated points."""
    scan = scan_at(pose, LASER, noise=0.01, rng=np.random.default_rng(seed))
    scan.ranges.flags.writeable = True
    scan.ranges[40:720:64] -= 0.4
    return reader_of(scan)
