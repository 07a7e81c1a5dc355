"""Parameters of Hector SLAM."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from hector.ros import CODE, LAUNCH, ROS_NAMES
from slams.frontend.params import FrontendParams
from slams.grid_bounds import max_cells
from slams.params import RosNames, param
from slams.refine.params import RefineParams


@dataclass(frozen=True)
class HectorParams(RefineParams, FrontendParams):
    """Parameters of the default, `Hector`."""

    ROS: ClassVar[RosNames | None] = ROS_NAMES
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any] | str]] = {
        "original": "hector.original:Original",
        "paper": {"estimator": "plain", "refine": False, "max_range": 30.0},
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
        3,
        "1",
        "grids of the pyramid, each twice as coarse as the one before",
        source="ours: the launch file has 2; 3 converge from farther, at 5 Hz",
        low=1,
        high=6,
        ros=("map_multi_res_levels",),
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
        0.25,
        "m",
        "distance since the last scan that entered the map",
        source="ours: more views make the lines in cells more exact",
        low=0.0,
        ros=("map_update_distance_thresh",),
    )
    insert_angle: float = param(
        0.25,
        "rad",
        "rotation since the last scan that entered the map",
        source="ours: more views make the lines in cells more exact",
        low=0.0,
        ros=("map_update_angle_thresh",),
    )
    settle: int = param(
        10,
        "1",
        "scans at the start that all enter the map",
        source="ours: the noise of one scan alone would stay in every later pose",
        low=1,
        high=10_000,
    )
    min_range: float = param(
        0.1,
        "m",
        "nearer end points are not used",
        source="ours: the laser's own",
        low=0.0,
        ros=("laser_min_dist",),
    )
    max_range: float = param(
        80.0,
        "m",
        "farther end points are not used",
        source="ours: a SICK LMS; 30 in the original",
        low=0.5,
        ros=("laser_max_dist",),
    )
    max_cells: int = max_cells()
    steps: int = param(
        12,
        "1",
        "maximum number of Gauss-Newton steps on each level",
        source="ours: until converged; 4 and 6 in the original",
        low=1,
        high=100,
    )
    damping: float = param(
        1e-3,
        "1",
        "share of H's diagonal added to it",
        source="ours: Levenberg; bounds the steps in corridors",
        low=0.0,
    )
    max_shift: float = param(
        0.3, "m", "maximum length of one step", source="ours: the original has no limit", low=0.001
    )
    max_turn: float = param(0.2, "rad", "maximum rotation of one step", source=CODE, low=0.001)
