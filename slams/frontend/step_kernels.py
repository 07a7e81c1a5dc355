"""Kernels of steps between scans: steps that no robot makes move the pose and leave the twist.

Recorders hold scans back, with their odometry, and write them between later ones. Such a scan
shows the robot where it was, so the pose jumps there and back.
"""

from __future__ import annotations

import math

from slams.frontend.timing import MIN_LASER_OFFSET
from slams.geometry import wrap_angle
from slams.jit import njit
from slams.types import Floats

# m/s, rad/s, between two steps of a robot; by acceleration, stamps that jitter would be jumps
MAX_RATE_CHANGE = 3.0


@njit(inner=True, borrows=True)
def midpoint_step(before: Floats, pose: Floats, out: Floats) -> None:
    """Step (3,) between two poses in the frame at half of the rotation. ours."""
    dx, dy, rotation = pose[0] - before[0], pose[1] - before[1], wrap_angle(pose[2] - before[2])
    half = before[2] + 0.5 * rotation
    c, s = math.cos(half), math.sin(half)
    out[0], out[1], out[2] = c * dx + s * dy, c * dy - s * dx, rotation


@njit(inner=True, borrows=True)
def is_jump(step: Floats, dt: float, rate: Floats) -> bool:
    """Whether no robot makes a step (3,) in dt [s] after one of this rate (3,).

    ours: by the rate of the last step, not by the twist, so that a wrong twist does not last, and a
    robot that is pushed jumps for one scan only.
    """
    change = 0.0
    if dt > MIN_LASER_OFFSET:  # else two lasers scan at the same moment
        for i in range(3):
            change = max(change, abs(step[i] / dt - rate[i]))
    return change > MAX_RATE_CHANGE


@njit(inner=True, borrows=True)
def isolate(P: Floats, first: int) -> None:
    """Remove the correlation of three states, from the first on, with all others. ours."""
    for i in range(first, first + 3):
        for k in range(P.shape[0]):
            if k < first or k >= first + 3:
                P[i, k] = P[k, i] = 0.0
