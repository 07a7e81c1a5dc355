"""Parameters of the published program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from slams.grid_bounds import max_cells
from slams.params import Params, RosNames, param
from tsd.ros import ORIGINAL_ROS_NAMES

ORIGINAL = "original code"


@dataclass(frozen=True)
class OriginalParams(Params):
    """Parameters of ohm_tsd_slam with the values of the launch file of [Koch15]."""

    ROS: ClassVar[RosNames | None] = ORIGINAL_ROS_NAMES

    registration: str = param(
        "tsd",
        "1",
        "icp: ICP alone; tsd: first RANSAC, scored by the field",
        source="original code, modes 0 and 3",
        choices=("icp", "tsd"),
        ros=("registration_mode",),
    )
    cell: float = param(
        0.025, "m", "edge of a cell", source=ORIGINAL, low=0.002, high=1.0, ros=("cellsize",)
    )
    truncation: float = param(
        0.075,
        "m",
        "largest distance kept in a cell",
        source="original code: 3 cells",
        low=0.004,
        high=5.0,
        ros=("truncation_radius",),
    )
    max_weight: float = param(32.0, "1", "largest weight of a cell", source=ORIGINAL, low=1.0)
    push_translation: float = param(
        0.05, "m", "push again after this distance", source=ORIGINAL, low=0.0
    )
    push_rotation: float = param(
        0.03, "rad", "push again after this rotation", source=ORIGINAL, low=0.0
    )
    map_size: int = param(
        10,
        "1",
        "cells per edge of the grid at the start, power of two",
        source=ORIGINAL,
        low=5,
        high=14,
        ros=("map_size",),
    )
    max_cells: int = max_cells(1 << 27)
    grows: bool = param(
        True, "1", "whether the grid may grow", source="ours: the program ends at the edge"
    )
    weight_unit: float = param(0.01, "1", "weight of a measured cell", source=ORIGINAL, low=1e-6)
    shortest: float = param(
        0.0,
        "m",
        "shorter ranges are dropped",
        source="original code: 0.26 for the authors' robot",
        low=0.0,
        ros=("las_min_range", "laser_min_range"),
    )
    longest: float = param(
        30.0, "m", "longer ranges are free space", source=ORIGINAL, low=0.1, ros=("max_range",)
    )
    low_reflectivity: float = param(
        2.0,
        "m",
        "radius that a beam without return marks as free",
        source=ORIGINAL,
        low=0.0,
        ros=("low_reflectivity_range",),
    )
    jump_angle: float = param(
        0.05235987755982989,
        "rad",
        "chord angle of a range jump; below it the far side is dropped",
        source=ORIGINAL,
        low=0.0,
        high=1.5,
    )
    footprint: float = param(
        1.0,
        "m",
        "edge of the square marked as free around the start",
        source=ORIGINAL,
        low=0.0,
        ros=("footprint_width",),
    )
    footprint_offset: float = param(
        0.28, "m", "its offset ahead of the laser", source=ORIGINAL, ros=("footprint_x_offset",)
    )
    icp_iterations: int = param(
        30, "1", "ICP iterations", source=ORIGINAL, low=1, high=1_000, ros=("icp_iterations",)
    )
    widest_gate: float = param(
        0.4,
        "m",
        "initial distance gate of pairs",
        source=ORIGINAL,
        low=1e-3,
        ros=("dist_filter_max",),
    )
    narrowest_gate: float = param(
        0.02, "m", "minimum gate of pairs", source=ORIGINAL, low=1e-4, ros=("dist_filter_min",)
    )
    max_translation: float = param(
        1.0, "m", "longer steps are rejected", source=ORIGINAL, low=0.0, ros=("reg_trs_max",)
    )
    max_rotation: float = param(
        0.5235987755982988,
        "rad",
        "larger rotations are rejected",
        source=ORIGINAL,
        low=0.0,
        high=1.57,
        ros=("reg_sin_rot_max",),
    )
    trials: int = param(
        100, "1", "model points tried", source=ORIGINAL, low=1, high=10_000, ros=("trials",)
    )
    control_set: int = param(
        360,
        "1",
        "largest number of scene points in the score",
        source=ORIGINAL,
        low=1,
        high=10_000,
        ros=("sizeControlSet",),
    )
    scene_points: int = param(
        180, "1", "mean number of scene points kept", source=ORIGINAL, low=3, high=10_000
    )
    phi_max: float = param(
        0.7853981633974483,
        "rad",
        "largest rotation of a hypothesis",
        source=ORIGINAL,
        low=0.0,
        high=1.58,
        ros=("ransac_phi_max",),
    )
    z_random: float = param(
        0.05,
        "1",
        "probability of a random measurement, mode tsd",
        source=ORIGINAL,
        low=1e-6,
        high=1.0,
        ros=("zrand",),
    )
