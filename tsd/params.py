"""Parameters of TSD SLAM and its two presets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from slams.params import Params, RosNames, param
from tsd.ros import ROS as ROS_NAMES

ORIGINAL = "original code"


@dataclass(frozen=True)
class TsdParams(Params):
    """Parameters of `Tsd`; those of one registration are unused by the other."""

    ROS: ClassVar[RosNames | None] = ROS_NAMES
    # Ranges of the LDS deviate by 2 cm at 1 m: with the UTM-30LX's 1 cm every other scan looks
    # like a bad match and is searched for. Error per scan down by a sixth, CPU time to a seventh.
    SENSORS: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        laser: {"range_noise": 0.04, "robust": 0.06} for laser in ("lds01", "lds02")
    }
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "original": {
            "registration": "tsd",
            "cell": 0.025,
            "truncation": 0.075,
            "max_weight": 32.0,
            "prediction": False,
        }
    }

    registration: str = param(
        "direct",
        "1",
        "direct: scan to field; icp: original mode 0; exp, pdf, tsd: RANSAC before it",
        source="ours: direct alignment (A1); the others: original code, modes 0 to 3",
        choices=("direct", "icp", "exp", "pdf", "tsd"),
        ros=("registration_mode",),
    )
    prediction: bool = param(
        True,
        "1",
        "start from odometry, gyro or the last motion, not from the last pose",
        source="ours: A3; the original has none",
    )
    cell: float = param(
        0.05,
        "m",
        "edge of a cell",
        source="ours: lines are linear fields; original code: 0.025",
        low=0.002,
        high=1.0,
        ros=("cellsize",),
    )
    truncation: float = param(
        0.15,
        "m",
        "greatest distance kept in a cell",
        source="original code: 3 cells",
        low=0.004,
        high=5.0,
        ros=("truncation_radius",),
    )
    max_weight: float = param(
        100.0, "1", "cap of a cell's weight", source="ours: 100 views; original code: 32", low=1.0
    )
    push_translation: float = param(
        0.05, "m", "push again after this distance", source=ORIGINAL, low=0.0
    )
    push_rotation: float = param(
        0.03, "rad", "push again after this turn", source=ORIGINAL, low=0.0
    )
    lost_scans: int = param(
        20,
        "1",
        "scans in a row without a match before mapping starts anew at the prediction",
        source="ours: R2",
        low=1,
    )

    range_noise: float = param(
        0.01, "m", "standard deviation of a range", source="ours: UTM-30LX data sheet", low=1e-4
    )
    window: float = param(
        0.12,
        "m",
        "half length of the window a surface line is fitted in",
        source="ours: A5, noise 1/6 of a beam's at 2 m",
        low=0.0,
    )
    spacing: float = param(
        0.05, "m", "distance of surface elements along a wall", source="ours: S4", low=0.0
    )
    max_slope: float = param(
        8.0,
        "1",
        "range step per beam spacing that breaks a surface",
        source="ours: 7 degrees; original code: 3 degrees",
        low=1.0,
    )
    beam_width: float = param(
        0.2, "1", "blur of a beam across, in beam spacings", source="ours: oblique hits", low=0.0
    )
    roughness: float = param(
        2.0,
        "1",
        "range noises off its line that make a surface rough",
        source="ours: smaller window, then the hit itself",
        low=0.5,
    )
    iterations: int = param(
        15, "1", "most Gauss-Newton iterations", source="ours: 3 are usual", low=1
    )
    robust: float = param(
        0.03, "m", "distance at which a residual loses half its say", source="ours: A1", low=1e-3
    )
    map_noise: float = param(
        1.0, "1", "error of the field per residual seen so far", source="ours: A6", low=0.0
    )
    prior_translation: float = param(
        0.02, "m", "deviation of the predicted position", source="ours: A7", low=1e-4
    )
    prior_rotation: float = param(
        0.05, "rad", "deviation of the predicted heading", source="ours: A7", low=1e-4
    )
    odometry_noise: float = param(
        0.3,
        "1",
        "deviation of odometry per difference to the last motion",
        source="ours: A3; wheels slip and drivers stall",
        low=0.0,
    )
    coarse_cell: float = param(
        0.1, "m", "cell of the coarse field for the wide start", source="ours: A1", low=0.01
    )
    coarse_truncation: float = param(
        0.5, "m", "truncation of the coarse field", source="ours: A1", low=0.02
    )
    search_translation: float = param(
        0.6, "m", "half width of the wide search, doubled when it fails", source="ours: R2", low=0.0
    )
    search_rotation: float = param(
        0.6,
        "rad",
        "half width of the wide search, doubled when it fails",
        source="ours: R2",
        low=0.0,
    )
    convincing: float = param(
        0.97,
        "1",
        "share of the usual agreement below which other starts are tried",
        source="ours: A3",
        low=0.0,
        high=1.0,
    )
    min_close: float = param(
        0.5,
        "1",
        "least agreement of the known elements of an accepted match",
        source="ours: A7",
        low=0.0,
        high=1.0,
    )
    min_known: float = param(
        0.15,
        "1",
        "least share of elements on known surfaces of an accepted match",
        source="ours: A7",
        low=0.0,
        high=1.0,
    )

    map_size: int = param(
        10,
        "1",
        "cells per edge of the original grid, power of two",
        source=ORIGINAL,
        low=5,
        high=15,
        ros=("map_size",),
    )
    grows: bool = param(
        True,
        "1",
        "whether the original grid may grow at its edge",
        source="ours: the original ends there (D6)",
    )
    weight_unit: float = param(
        0.01, "1", "weight of a measured cell", source="original code (D1)", low=1e-6
    )
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
        "radius that a beam without return frees",
        source=ORIGINAL,
        low=0.0,
        ros=("low_reflectivity_range",),
    )
    jump_angle: float = param(
        0.05235987755982989,
        "rad",
        "chord angle that drops the far side of a range jump",
        source=ORIGINAL,
        low=0.0,
        high=1.5,
    )
    footprint: float = param(
        1.0,
        "m",
        "edge of the square freed around the start",
        source=ORIGINAL,
        low=0.0,
        ros=("footprint_width",),
    )
    footprint_offset: float = param(
        0.28, "m", "its center ahead of the laser", source=ORIGINAL, ros=("footprint_x_offset",)
    )
    icp_iterations: int = param(
        30, "1", "ICP rounds", source=ORIGINAL, low=1, ros=("icp_iterations",)
    )
    widest_gate: float = param(
        0.4,
        "m",
        "greatest pair distance at first",
        source=ORIGINAL,
        low=1e-3,
        ros=("dist_filter_max",),
    )
    narrowest_gate: float = param(
        0.02, "m", "least gate", source=ORIGINAL, low=1e-4, ros=("dist_filter_min",)
    )
    max_translation: float = param(
        1.0, "m", "longer steps are refused", source=ORIGINAL, low=0.0, ros=("reg_trs_max",)
    )
    max_rotation: float = param(
        0.5235987755982988,
        "rad",
        "larger turns are refused",
        source=ORIGINAL,
        low=0.0,
        high=1.57,
        ros=("reg_sin_rot_max",),
    )
    trials: int = param(100, "1", "model points tried", source=ORIGINAL, low=1, ros=("trials",))
    control_set: int = param(
        360, "1", "most scene points that score", source=ORIGINAL, low=1, ros=("sizeControlSet",)
    )
    scene_points: int = param(180, "1", "scene points kept on average", source=ORIGINAL, low=3)
    phi_max: float = param(
        0.7853981633974483,
        "rad",
        "largest turn of a hypothesis",
        source=ORIGINAL,
        low=0.0,
        high=1.58,
        ros=("ransac_phi_max",),
    )
    hit_distance: float = param(
        0.15, "m", "distance of a hit, mode exp", source=ORIGINAL, low=1e-3, ros=("epsThresh",)
    )
    z_random: float = param(
        0.05,
        "1",
        "weight of chance, modes pdf and tsd",
        source=ORIGINAL,
        low=1e-6,
        high=1.0,
        ros=("zrand",),
    )
    z_hit: float = param(
        0.2, "1", "weight of a hit, mode pdf", source=ORIGINAL, low=0.0, ros=("zhit",)
    )
    z_short: float = param(
        0.2, "1", "weight of a short range, mode pdf", source=ORIGINAL, low=0.0, ros=("zshort",)
    )
    z_max: float = param(
        0.2, "1", "weight of no return, mode pdf", source=ORIGINAL, low=0.0, ros=("zmax",)
    )
    sigma_hit: float = param(
        0.1, "m", "deviation of a hit, mode pdf", source=ORIGINAL, low=1e-3, ros=("sighit",)
    )
    decay_short: float = param(
        0.08,
        "1",
        "decay of short ranges per metre, mode pdf",
        source=ORIGINAL,
        low=1e-4,
        ros=("lamshort",),
    )
    max_angle: float = param(
        0.026179938779914945,
        "rad",
        "beam distance of a pair, mode pdf",
        source=ORIGINAL,
        low=0.0,
        ros=("maxAngleDiff",),
    )
    paired_share: float = param(
        0.6,
        "1",
        "least share of paired points, mode pdf",
        source=ORIGINAL,
        low=0.0,
        high=1.0,
        ros=("percentagePointsInC",),
    )
