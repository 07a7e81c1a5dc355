"""Parameters of the published program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from hector.ros import CODE, LAUNCH, ORIGINAL_ROS_NAMES
from slams.params import Params, RosNames, param


@dataclass(frozen=True)
class OriginalParams(Params):
    """hector_mapping 0.5.2 with the values of its mapping_default.launch."""

    ROS: ClassVar[RosNames | None] = ORIGINAL_ROS_NAMES
    # Spinning lasers at 5 Hz: without a prediction and without deskewing the error of the program
    # is meters on every simulated log, with both its ATE is 2 to 4 cm.
    SENSORS: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        laser: {"start": "auto", "deskew": True} for laser in ("rplidar-a1", "lds01", "lds02")
    }

    resolution: float = param(
        0.05,
        "m",
        "cell of the finest level",
        source=LAUNCH,
        low=0.005,
        high=1.0,
        ros=("map_resolution",),
    )
    levels: int = param(
        2,
        "1",
        "grids of the pyramid, each twice as coarse as the one before",
        source=LAUNCH,
        low=1,
        high=6,
        ros=("map_multi_res_levels",),
    )
    map_size: int = param(
        2048,
        "cell",
        "edge of the finest grid; beams that leave it are skipped",
        source=LAUNCH,
        low=8,
        high=16384,
        ros=("map_size",),
    )
    free: float = param(
        0.4,
        "1",
        "probability of occupied in a cell that a beam passes",
        source=LAUNCH,
        low=0.01,
        high=0.49,
        ros=("map_update_factor_free", "update_factor_free"),
    )
    occupied: float = param(
        0.9,
        "1",
        "probability of occupied in a cell that a beam ends in",
        source=LAUNCH,
        low=0.51,
        high=0.99,
        ros=("map_update_factor_occupied", "update_factor_occupied"),
    )
    ceiling: float = param(50.0, "1", "log-odds above which nothing is added", source=CODE, low=1.0)
    insert_distance: float = param(
        0.4,
        "m",
        "distance since the last scan that entered the map",
        source=LAUNCH,
        low=0.0,
        ros=("map_update_distance_thresh",),
    )
    insert_angle: float = param(
        0.06,
        "rad",
        "rotation since the last scan that entered the map",
        source=LAUNCH,
        low=0.0,
        ros=("map_update_angle_thresh",),
    )
    min_range: float = param(
        0.4,
        "m",
        "nearer end points are not used",
        source=CODE,
        low=0.0,
        ros=("laser_min_dist",),
    )
    max_range: float = param(
        30.0, "m", "farther end points are not used", source=CODE, low=0.5, ros=("laser_max_dist",)
    )
    body_radius: float = param(
        0.70710678,
        "m",
        "nearer end points behind the laser are on the robot's own body",
        source="original code: sqrt(0.5), hard-coded",
        low=0.0,
    )
    start: str = param(
        "last",
        "1",
        "start of a match: last pose, constant velocity (rotation by the gyro), or odometry where "
        "a scan has it (auto)",
        source="original code; velocity and auto: ours, for lasers at 5 Hz",
        choices=("last", "velocity", "auto"),
        ros=("use_tf_pose_start_estimate",),
    )
    steps_coarse: int = param(
        4, "1", "Gauss-Newton steps on a coarse level", source=CODE, low=1, high=100
    )
    steps_fine: int = param(
        6, "1", "Gauss-Newton steps on the finest level", source=CODE, low=1, high=100
    )
    max_turn: float = param(0.2, "rad", "maximum rotation of one step", source=CODE, low=0.001)
    deskew: bool = param(
        False,
        "1",
        "deskew scans that have a time per beam",
        source="original code; true: ours, for lasers at 5 Hz",
    )
