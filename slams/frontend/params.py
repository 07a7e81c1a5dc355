"""Parameters of the front end: sources of motion, their noise, one switch per mechanism."""

from __future__ import annotations

from dataclasses import dataclass

from slams.params import Params, param

SKID = "ours: tracked and skid-steer robots on public logs"


@dataclass(frozen=True)
class FrontendParams(Params):
    """Parameters of the pose estimator, the same for every algorithm and log."""

    estimator: str = param(
        "filter",
        "1",
        "filter: the whole front end; plain: the prediction starts the match, it is accepted",
        source="ours: plain is the paper's mechanism alone",
        choices=("filter", "plain"),
    )
    wheels: bool = param(True, "1", "use wheel odometry where a scan has it", source="ours: user")
    gyro: bool = param(True, "1", "use the gyro's heading where a scan has it", source="ours: user")
    smooth_stamps: bool = param(
        True,
        "1",
        "filter the stamps of scans if they jitter",
        source="ours: recorders stamp late by half an interval",
        switch=True,
    )
    learn_acceleration: bool = param(
        True,
        "1",
        "learn the acceleration of the robot from the matches",
        source="ours: [SageHusa69]; handheld lasers and slow robots differ a hundredfold",
        switch=True,
    )
    learn_odometry: bool = param(
        True,
        "1",
        "learn the noise of wheels and gyro from the matches",
        source="ours: wheels slip and stall",
        switch=True,
    )
    degeneracy: bool = param(
        True,
        "1",
        "keep the prediction along a direction that a scan does not observe",
        source="ours: [Zhang16], bare corridors",
        switch=True,
    )
    search: bool = param(
        True,
        "1",
        "correlative search in the window of the prior if a match scores below the mean",
        source="ours: [Olson15]",
        switch=True,
    )
    relocate: bool = param(
        True, "1", "relocalize a lost robot in its own map", source="ours: user", switch=True
    )
    slip: float = param(
        0.02, "m", "deviation of the wheels' distance after one meter", source=SKID, low=0.0
    )
    slip_sideways: float = param(
        0.01, "m", "lateral and heading [rad] deviation after one meter", source=SKID, low=0.0
    )
    slip_rotation: float = param(
        0.04, "rad", "deviation of the wheels' rotation after one radian", source=SKID, low=0.0
    )
    gyro_noise: float = param(
        4e-4, "rad", "drift of the heading after one second", source="ours: a MEMS gyro", low=1e-6
    )
