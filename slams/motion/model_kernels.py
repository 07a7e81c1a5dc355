"""Kernels of what a match teaches of the motion: of the velocity, the wheels and the gyro."""

from __future__ import annotations

import math
from typing import Any

from slams.jit import njit
from slams.motion.reading_kernels import alike, settle
from slams.motion.scale_kernels import calibrate, calibrate_gyro, calibrate_veer
from slams.motion.source_kernels import compare
from slams.motion.velocity_kernels import TURN, contradict, correct, correct_velocity, pass_over
from slams.types import Records


@njit(borrows=True)
def learn(
    axes: Records,
    overs: Records,
    wheels: Records,
    gyro: Records,
    laws: Records,
    step: Any,
    match: Any,
    last: Any,
) -> bool:
    """Learn from a step that a match found; whether the wheels contradict it. ours.

    match, last: the variances ahead, aside and of the turn of the matches at both ends of the step
    (inf: not known). Their errors add, and that of the heading at its start swings the step.
    """
    dt, wrong = overs[0].dt, False
    swing = last[2] * step[0] * step[0] if step[0] != 0.0 else 0.0
    both = (match[0] + last[0], match[1] + last[1] + swing, match[2] + last[2])
    if dt > 0.0 and wheels[0].variance < math.inf:
        wrong = compare(wheels, laws, step, both, dt)
    if dt > 0.0 and gyro[0].variance < math.inf:
        compare(gyro, laws, step, both, dt)
    learn_velocity(axes, overs, wheels, gyro, laws, step, (match[0], match[1] + swing, match[2]))
    settle(wheels, step, dt)
    if 0.0 < dt <= laws[0].witness_time:  # over more half of what is matched is new ground
        calibrate(wheels[0], step[0], match[0], last[0])
        way = wheels[0].told
        calibrate_veer(wheels[TURN], way, step[TURN], match[TURN], last[TURN], laws[0])
        calibrate_gyro(gyro[0], step[TURN], match[TURN], last[TURN], dt)
    return wrong


@njit(inner=True, borrows=True)
def learn_velocity(
    axes: Records,
    overs: Records,
    wheels: Records,
    gyro: Records,
    laws: Records,
    step: Any,
    match: Any,
) -> None:
    """Learn the velocity from a step; where its match tells none, from wheels and gyro. ours."""
    dt, doubt = overs[0].dt, laws[0].doubt
    if dt <= 0.0:
        return
    for i in range(len(axes)):
        axis, said = axes[i], wheels[i]
        pass_over(axis, overs[0])
        unsettled = 0.0 < doubt**2 * said.doubted < match[i]  # the match says nothing
        if unsettled:
            contradict(axis, said.doubted, dt)
        if match[i] < math.inf:
            correct(axis, step[i], match[i], dt)
        if i == TURN and gyro[0].variance < said.variance:
            said = gyro[0]
        blind = match[i] > axis.unknown * dt * dt  # no more than is known of all robots
        if (blind or unsettled) and said.variance < math.inf:
            variance = said.variance + alike(said, dt)
            correct_velocity(axis, said.said / dt, variance / (dt * dt), dt)
        axis.x -= step[i]  # the pose is now reported further
