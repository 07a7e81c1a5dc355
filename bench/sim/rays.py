"""Rays of a log's beams in the world frame, and their end points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats, Laser

if TYPE_CHECKING:
    from slams.scanlog import ScanLog

SCANS_PER_BLOCK = 200  # processed at once, to limit the memory


def true_poses(log: ScanLog, t: Floats) -> Floats:
    """True base poses (n, 3) at the stamps, or (n, b, 3) for the beams of a turning laser."""
    assert log.truth is not None
    if not log.laser.time_increment:
        return log.truth.poses_at(t)
    delays = log.laser.time_increment * np.arange(log.laser.n_beams)
    return log.truth.poses_at((t[:, None] + delays).ravel()).reshape(len(t), len(delays), 3)


def rays_of(laser: Laser, poses: Floats) -> Floats:
    """Start and direction of every beam (n, b, 3) in the world frame."""
    bases = poses[:, None] if poses.ndim == 2 else poses
    c, s = np.cos(bases[..., 2]), np.sin(bases[..., 2])
    rays = np.empty((len(poses), laser.n_beams, 3))
    rays[..., 0] = bases[..., 0] + c * laser.mount.x - s * laser.mount.y
    rays[..., 1] = bases[..., 1] + s * laser.mount.x + c * laser.mount.y
    rays[..., 2] = bases[..., 2] + laser.mount.theta + laser.angles
    return rays


def ends_of(rays: Floats, ranges: NDArray[np.floating]) -> Floats:
    """End points (..., 2) [m] of ranges (...) [m] along rays (..., 3)."""
    x = rays[..., 0] + ranges * np.cos(rays[..., 2])
    y = rays[..., 1] + ranges * np.sin(rays[..., 2])
    return np.stack([x, y], axis=-1)
