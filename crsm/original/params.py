"""Parameters of the published program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from crsm.ros import CODE, ORIGINAL_ROS_NAMES
from slams.grid_bounds import max_cells
from slams.params import Params, RosNames, param


@dataclass(frozen=True)
class OriginalParams(Params):
    """crsm_slam's own parameters and values."""

    ROS: ClassVar[RosNames | None] = ORIGINAL_ROS_NAMES
    # At 5 Hz the 40 scans at rest are 8 s: if the robot moves by then, the error is a meter.
    SENSORS: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        laser: {"hold": 4} for laser in ("rplidar-a1", "lds01", "lds02")
    }

    cell: float = param(
        0.02,
        "m",
        "edge of a map cell",
        source=CODE,
        low=0.005,
        high=1.0,
        ros=("slam_occupancy_grid_dimentionality",),
    )
    density: float = param(
        40.0,
        "1",
        "update of a free cell: gray levels per meter of mean range difference",
        source=CODE,
        low=0.0,
        ros=("map_update_density",),
    )
    obstacle_density: float = param(
        3.0,
        "1",
        "update of a hit, as a multiple of that of a free cell",
        source=CODE,
        low=0.0,
        ros=("map_update_obstacle_density",),
    )
    max_cells: int = max_cells(1 << 28)
    side: int = param(
        500,
        "cell",
        "edge of the first map",
        source=CODE,
        low=101,
        high=20000,
        ros=("slam_container_size",),
    )
    disparity: int = param(
        40,
        "cell",
        "edge of the search window",
        source=CODE,
        low=8,
        high=1000,
        ros=("hill_climbing_disparity",),
    )
    iterations: int = param(
        40000,
        "1",
        "evaluated poses per scan",
        source=CODE,
        low=0,
        high=1_000_000,
        ros=("max_hill_climbing_iterations",),
    )
    picked_rays: int = param(
        40,
        "1",
        "desired number of picked rays",
        source=CODE,
        low=1,
        high=10_000,
        ros=("desired_number_of_picked_rays",),
    )
    jump: float = param(
        0.3,
        "m",
        "minimum range difference of a discontinuity",
        source=CODE,
        low=0.0,
        ros=("scan_density_lower_boundary",),
    )
    hold: int = param(
        40, "1", "scans during which the pose stays at the start", source=CODE, low=0, high=10_000
    )
    robot_width: float = param(
        0.6, "m", "free area at the start", source=CODE, low=0.0, high=2.0, ros=("robot_width",)
    )
    robot_length: float = param(
        0.75, "m", "free area at the start", source=CODE, low=0.0, high=2.0, ros=("robot_length",)
    )
