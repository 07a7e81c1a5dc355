"""How a robot moves, in numbers: what its wheels and gyro are worth and what it can do."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slams.params import Params, param

SKID = "ours: a tracked or skid-steer rescue robot, 1 % of the way and 5 % of the turns"
THRUN = "[Thrun05] 5.4, noise per meter and radian; size: "
MEMS = "ours: a calibrated MEMS gyro on a vibrating base"


@dataclass(frozen=True)
class MotionParams(Params):
    """A robot's wheels, gyro, habits and limits; the same for all algorithms and logs.

    Slips are deviations after the first meter or radian: they grow with the root of the way.
    Scales are wrong for a whole drive: they grow with the way itself.
    """

    wheels: bool = param(True, "1", "use wheel odometry where a scan has it", source="ours: user")
    gyro: bool = param(True, "1", "use the gyro's heading where a scan has it", source="ours: user")

    relocate: bool = param(
        True, "1", "look for a lost robot in all of its own map", source="ours: user", switch=True
    )

    way_scale: float = param(
        0.01, "1", "deviation of the wheels' scale of the way", source=SKID, low=0.0
    )
    turn_scale: float = param(
        0.042, "1", "deviation of the wheels' scale of a turn, floor included", source=SKID, low=0.0
    )
    veer: float = param(
        0.01, "rad", "turn per meter that the wheels do not see", source=SKID, low=0.0
    )
    way_slip: float = param(
        0.003, "m", "slip along one meter", source=THRUN + "skid steer", low=0.0
    )
    way_slip_turning: float = param(
        0.002, "m", "slip along while turning one radian", source=THRUN + "skid steer", low=0.0
    )
    turn_slip: float = param(
        0.01, "rad", "slip of a turn of one radian", source=THRUN + "skid steer", low=0.0
    )
    turn_slip_way: float = param(
        0.004, "rad", "slip of the heading along one meter", source=THRUN + "skid steer", low=0.0
    )
    side_slip: float = param(
        0.001,
        "m",
        "slip aside along one meter, beside what the heading's slip explains",
        source="[Thrun05] 5.4 has none; casters, slopes and rubble have",
        low=0.0,
    )
    stall: float = param(
        0.02,
        "m/s",
        "speed a robot may have whose wheels count nothing; in rad/s for turns",
        source="ours: a tick not yet full, a push, a belt that slips",
        low=1e-4,
    )

    gyro_noise: float = param(4e-4, "rad", "drift after one second of rest", source=MEMS, low=1e-6)
    gyro_bias: float = param(0.002, "rad/s", "deviation of the bias", source=MEMS, low=0.0)
    gyro_scale: float = param(0.003, "1", "deviation of the scale", source=MEMS, low=0.0)

    acceleration: float = param(
        0.15,
        "m/s^2",
        "deviation ahead, to begin with",
        source="ours: a third of the most of a rescue robot; learned from the matches",
        low=1e-4,
    )
    acceleration_aside: float = param(
        0.0015,
        "m/s^2",
        "deviation aside, to begin with",
        source="ours: wheels do not go sideways; a hand does: learned from the matches",
        low=1e-4,
    )
    turn_acceleration: float = param(
        0.5,
        "rad/s^2",
        "deviation of the turn's, to begin with",
        source="ours: a third of the most of a rescue robot; learned from the matches",
        low=1e-4,
    )
    acceleration_time: float = param(
        0.2,
        "s",
        "how long an acceleration lasts",
        source="ours: predicts best at 5 and 40 Hz, in the arena and in two buildings",
        low=0.01,
    )
    witness_time: float = param(
        0.5,
        "s",
        "longest interval over which the velocity may contradict the wheels",
        source="ours: from 0.5 m/s a robot stops within a second",
        low=0.0,
    )
    velocity_time: float = param(
        2.0,
        "s",
        "after which a velocity that nothing confirmed is as good as forgotten",
        source="ours: robots stop and turn every few seconds",
        low=0.01,
    )
    learn_time: float = param(
        10.0, "s", "over which accelerations are learned", source="ours: a few bends", low=0.1
    )

    caution: float = param(
        50.0,
        "1",
        "times the variance of a prediction, as a prior of a scan that sees all directions",
        source="ours: the errors of a map are alike from scan to scan, and it was drawn by "
        "these very predictions, which would hold the pose off old walls",
        low=1.0,
    )
    scale_time: float = param(
        2.0,
        "s",
        "in which what the wheels are worth may change by e, as matches find it",
        source="ours: a few turns; wheels of two public logs err 4 times more than these",
        low=0.1,
    )

    top_speed: float = param(
        5.0, "m/s", "no robot indoors is faster", source="ours: a run", low=0.1
    )
    top_turn_rate: float = param(
        2.0 * math.pi, "rad/s", "no robot turns faster", source="ours: once a second", low=0.1
    )
    top_acceleration: float = param(
        5.0, "m/s^2", "no robot does more", source="ours: half of g, the grip of a tire", low=0.1
    )
    top_turn_acceleration: float = param(
        20.0, "rad/s^2", "no robot does more", source="ours: a small robot's wheels", low=0.1
    )
    leap: float = param(
        0.05,
        "m",
        "beyond what is possible that is let pass; in rad for turns",
        source="ours: odometry published in bursts",
        low=0.0,
    )

    doubt: float = param(
        4.0, "1", "deviations from which two sources contradict each other", source="ours", low=1.0
    )
    doubt_time: float = param(
        2.0,
        "s",
        "over which a contradiction is remembered",
        source="ours: a wheel that spins does so for seconds",
        low=0.1,
    )


def without_wheels(params: MotionParams) -> MotionParams:
    """The same, but nothing says that it cannot go sideways: a laser alone may be carried."""
    return params.replace(acceleration_aside=params.acceleration)
