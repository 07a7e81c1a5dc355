"""The bound of a filter: each scan a fix at the Cramer-Rao bound, wheels and gyro in between.

Two independent fixes (`bench.judge.bound`) are no limit of the motion between two scans where the
wheels tell of it too. This is the Kalman filter that knows everything but the pose: the map, the
covariance of each scan's fix, and how the simulator's wheels and gyro err
(`bench.sim.wheels`). All is linear and Gaussian but for angles of milliradians.

- What stays wrong for the whole drive, or wanders, are states that the filter learns: scale,
  turning, straightness and floor of the wheels, bias and scale of the gyro. As an inflated noise
  they would be forgotten at every step, and the bound would be too large by just that.
- What wheels and gyro both say of a turn gives, beside the best turn, one difference that does not
  depend on the turn: it measures the states.
- Sideways the simulator's wheels never slip, and the filter knows. That is worth much: a robot
  that moves tells its heading and its place across the way by it.
- Slip counts as white along the way, as if the wheels were read at the scan's stamp. Between two
  readings they are interpolated, with noise that neighbors share; the filter does not use that.
- The error of a motion needs both poses: their common covariance comes from the product of the
  filter's steps between them. An error that both share, as of the heading, drops out.

No estimator that has only seen what was before has a smaller mean square error of its pose. The
motion over a span is the difference of two such poses. It bounds nothing by itself: who holds
corrections back, or looks ahead, may be smoother over short spans and pays for it elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bench.judge.bound import Bound, Expected, mean_length
from bench.judge.metrics import SPANS, Common, pairs
from bench.sim.wheels import GYRO, WHEELS, steps
from slams.metrics import Indices
from slams.scanlog import ScanLog
from slams.types import Floats

# states: x, y, theta of the pose in the world, then what wheels and gyro get wrong
SCALE, TURNING, STRAIGHT, FLOOR, BIAS, GAIN = range(3, 9)
STATES = 9
UNKNOWN = 100.0  # m and rad, of the pose before the first fix
STILL = 1e-7  # m and rad: at rest the wheels are exact, which no matrix can be inverted with

Spans = dict[str, dict[str, float]]


class Motion(NamedTuple):
    """What happens between k + 1 scans: true motions, and all of way and turn on them, each (k,).

    `seconds`; `ahead` and `turn` [m, rad] net, `way` and `turned` without their signs; `heading`
    [rad] half way; `moved` (k, 2) [m] in the world.
    """

    seconds: Floats
    ahead: Floats
    turn: Floats
    way: Floats
    turned: Floats
    heading: Floats
    moved: Floats


@dataclass(frozen=True, eq=False)
class Filtered:
    """Covariances (n, 9, 9) of the filter's state at each pose (n, 3).

    `steps` (n - 1, 9, 9) take the state's error from one pose to the next.
    """

    poses: Floats
    covariance: Floats
    steps: Floats

    def pairs(self, first: Indices, second: Indices) -> Expected:
        """Mean errors of the motion from pose first[k] to the later second[k]."""
        dx, dy, _ = (self.poses[second] - self.poses[first]).T
        lever = np.zeros((len(first), 3, 3))
        lever[:] = np.eye(3)
        lever[:, 0, 2], lever[:, 1, 2] = -dy, dx
        a = self.covariance[first]
        across = (_between(self.steps, first, second) @ a)[:, :3, :3] @ lever.transpose(0, 2, 1)
        both = lever @ a[:, :3, :3] @ lever.transpose(0, 2, 1) + self.covariance[second, :3, :3]
        both = both - across - across.transpose(0, 2, 1)
        return Expected(mean_length(both[:, :2, :2]), np.sqrt(2.0 / math.pi * both[:, 2, 2]))


def filter_spans(log: ScanLog, limit: Bound, truth: Common) -> Spans | None:
    """Mean errors of the filter's motions over each span, [m] and [rad].

    Without the gyro those of a filter with wheels alone; None where the log was not simulated or
    has no wheels.

    Args:
        log: the simulated log.
        limit: of its scans, as by `bench.judge.bound.bound_of`.
        truth: its stamps tell which scans have a truth, its poses what is a span apart.
    """
    found = filtered(log, limit, np.flatnonzero(np.isin(log.t, truth.t)))
    if found is None:
        return None
    spans: Spans = {}
    for span in SPANS:
        first, second = pairs(truth, span)
        if len(first):
            expected = found.pairs(first, second)
            spans[span.name] = {
                "translation_m": float(expected.translation.mean()),
                "rotation_rad": float(expected.rotation.mean()),
            }
    return spans


def filtered(log: ScanLog, limit: Bound, scans: Indices) -> Filtered | None:
    """The filter's covariances at the given scans, which must have a truth; None as above."""
    from bench.sim.simulation import setting_of

    if log.odom is None or log.truth is None or setting_of(log) is None or not len(scans):
        return None
    poses = limit.poses[scans].copy()
    poses[:, 2] = np.unwrap(poses[:, 2])
    gap = None if log.yaw_rate is None else float(np.median(np.diff(log.yaw_rate.in_order[0])))
    motion = _motion(log, scans, poses)
    return Filtered(poses, *_run(motion, gap, limit.information[scans]))


def _motion(log: ScanLog, scans: Indices, poses: Floats) -> Motion:
    """True motion from scan to scan."""
    assert log.truth is not None
    stamps, values = log.truth.in_order
    fine = np.column_stack([values[:, :2], np.unwrap(values[:, 2])])
    ahead, aside, turn = steps(fine)
    t, no = log.t[scans], np.zeros(1)
    way = np.interp(t, stamps, np.append(no, np.cumsum(np.hypot(ahead, aside))))
    turned = np.interp(t, stamps, np.append(no, np.cumsum(np.abs(turn))))
    net, _, turn = steps(poses)
    heading, moved = poses[:-1, 2] + 0.5 * turn, np.diff(poses[:, :2], axis=0)
    return Motion(np.diff(t), net, turn, np.diff(way), np.diff(turned), heading, moved)


def _run(motion: Motion, gyro_step: float | None, information: Floats) -> tuple[Floats, Floats]:
    """The filter's covariances (n, 9, 9) and the steps (n - 1, 9, 9) of its error."""
    gains, noises = _readings(motion, gyro_step)
    transitions, diffusions = _predictions(motion, gains, noises)
    differences = _differences(motion, noises) if gyro_step is not None else None
    covariances = np.empty((len(information), STATES, STATES))
    steps = np.empty_like(transitions)
    kept, covariance = _fix(_prior(), information[0])
    covariances[0] = covariance
    for k in range(len(steps)):
        step = transitions[k]
        if differences is not None:
            learned, covariance = _measured(covariance, differences[0][k], differences[1][k])
            step = step @ learned
        covariance = transitions[k] @ covariance @ transitions[k].T + diffusions[k]
        kept, covariance = _fix(covariance, information[k + 1])
        covariances[k + 1], steps[k] = covariance, kept @ step
    return covariances, steps


def _prior() -> Floats:
    """Covariance (9, 9) before the first scan."""
    wheels = (WHEELS.scale, WHEELS.turning, WHEELS.straight, WHEELS.floor)
    return np.diag(np.square([UNKNOWN, UNKNOWN, UNKNOWN, *wheels, GYRO.bias, GYRO.scale]))


def _fix(covariance: Floats, information: Floats) -> tuple[Floats, Floats]:
    """What a scan's information (3, 3), which may be singular, leaves of the error, and after it.

    The information form for three of nine states: (P^-1 + I)^-1 = (1 - P (1 + I P)^-1 I) P.
    """
    gain = covariance[:, :3] @ np.linalg.solve(
        np.eye(3) + information @ covariance[:3, :3], information
    )
    kept = np.eye(STATES)
    kept[:, :3] -= gain
    after = kept @ covariance
    return kept, 0.5 * (after + after.T)


def _measured(covariance: Floats, row: Floats, variance: float) -> tuple[Floats, Floats]:
    """The same of one number, row (9,) @ state, with a variance."""
    seen = covariance @ row
    gain = seen / (row @ seen + variance)
    return np.eye(STATES) - np.outer(gain, row), covariance - np.outer(gain, seen)


def _readings(motion: Motion, gyro_step: float | None) -> tuple[Floats, Floats]:
    """The best way ahead and turn from what is read: gains (k, 2, m), noise of it (k, m, m).

    Read are ahead and turn by the wheels, and the turn by the gyro: m = 3, or 2 without gyro.
    """
    noises = np.zeros((len(motion.way), 3, 3))
    way, turned = motion.way, motion.turned
    noises[:, 0, 0] = WHEELS.ahead_by_way**2 * way + WHEELS.ahead_by_turn**2 * turned + STILL**2
    noises[:, 1, 1] = WHEELS.turn_by_way**2 * way + WHEELS.turn_by_turn**2 * turned + STILL**2
    noises[:, 0, 1] = noises[:, 1, 0] = WHEELS.ahead_by_turn * WHEELS.turn_by_turn * turned
    told = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    if gyro_step is None:
        noises, told = noises[:, :2, :2], told[:2]
    else:
        noises[:, 2, 2] = GYRO.noise**2 * gyro_step * motion.seconds
    weighted = told.T @ np.linalg.inv(noises)
    return np.linalg.solve(weighted @ told, weighted), noises


def _wrong(motion: Motion) -> Floats:
    """What each state adds to the three readings (k, 3, 9)."""
    wrong = np.zeros((len(motion.way), 3, STATES))
    wrong[:, 0, SCALE] = motion.ahead
    wrong[:, 1, TURNING] = wrong[:, 1, FLOOR] = wrong[:, 2, GAIN] = motion.turn
    wrong[:, 1, STRAIGHT] = motion.way
    wrong[:, 2, BIAS] = motion.seconds
    return wrong


def _predictions(motion: Motion, gains: Floats, noises: Floats) -> tuple[Floats, Floats]:
    """Transition of the state's error from scan to scan, and the covariance it gains (k, 9, 9)."""
    (dx, dy), heading = motion.moved.T, motion.heading
    moves = np.zeros((len(heading), STATES, 2))  # by errors of way and turn
    moves[:, 0, 0], moves[:, 1, 0] = np.cos(heading), np.sin(heading)
    moves[:, 0, 1], moves[:, 1, 1], moves[:, 2, 1] = -0.5 * dy, 0.5 * dx, 1.0
    read = moves @ gains
    transitions = np.eye(STATES) - read @ _wrong(motion)[:, : noises.shape[1]]
    transitions[:, 0, 2] -= dy
    transitions[:, 1, 2] += dx
    keep = np.exp(-motion.seconds / WHEELS.floor_memory)
    transitions[:, FLOOR, FLOOR] = keep
    diffusions = read @ noises @ read.transpose(0, 2, 1)
    diffusions[:, FLOOR, FLOOR] += WHEELS.floor**2 * (1.0 - keep**2)
    diffusions[:, BIAS, BIAS] += GYRO.walk**2 * motion.seconds
    return transitions, diffusions


def _differences(motion: Motion, noises: Floats) -> tuple[Floats, Floats]:
    """The turn by the wheels less that by the gyro: what it says of the states, its variance."""
    rows = _wrong(motion)
    return rows[:, 1] - rows[:, 2], noises[:, 1, 1] + noises[:, 2, 2]


def _between(steps: Floats, first: Indices, second: Indices) -> Floats:
    """Products (k, 9, 9) of the steps from first[k] up to second[k], by powers of two."""
    found = np.broadcast_to(np.eye(STATES), (len(first), STATES, STATES)).copy()
    at, left, length = first.copy(), second - first, 1
    while left.any():
        odd = left % 2 == 1
        found[odd] = steps[at[odd]] @ found[odd]
        at[odd] += length
        left = left // 2
        if left.any():
            steps, length = steps[length:] @ steps[:-length], 2 * length
    return found
