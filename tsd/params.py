"""Parameters of TSD SLAM."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from slams.frontend.params import FrontendParams
from slams.grid_bounds import max_cells
from slams.params import RosNames, param
from slams.scan.params import ScanParams
from tsd.ros import ROS_NAMES

ORIGINAL = "original code"


@dataclass(frozen=True)
class TsdParams(ScanParams, FrontendParams):
    """Parameters of the default, `Tsd`; those of the published program are in `original`."""

    ROS: ClassVar[RosNames | None] = ROS_NAMES
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any] | str]] = {
        "original": "tsd.original:Original",
        "paper": {"estimator": "plain", "refine": False, "max_range": 30.0},
    }

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
        "largest distance kept in a cell",
        source="original code: 3 cells",
        low=0.004,
        high=5.0,
        ros=("truncation_radius",),
    )
    max_weight: float = param(
        100.0, "1", "largest weight of a cell", source="ours: 100 views; original code: 32", low=1.0
    )
    push_translation: float = param(
        0.05, "m", "push again after this distance", source=ORIGINAL, low=0.0
    )
    push_rotation: float = param(
        0.03, "rad", "push again after this rotation", source=ORIGINAL, low=0.0
    )
    min_range: float = param(
        0.1,
        "m",
        "shorter ranges are not used",
        source="ours: lasers have their own limit",
        low=0.0,
        ros=("las_min_range", "laser_min_range"),
    )
    max_range: float = param(
        80.0,
        "m",
        "longer ranges are not used",
        source="ours: SICK LMS",
        low=0.5,
        ros=("max_range",),
    )
    range_noise: float = param(
        0.01, "m", "standard deviation of a range", source="ours: UTM-30LX data sheet", low=1e-4
    )
    normal_window: float = param(
        0.12,
        "m",
        "half length of the window in which a line is fitted to a surface",
        source="ours: reduces the noise to 1/6 at 2 m",
        low=0.0,
    )
    spacing: float = param(
        0.05, "m", "distance between surface elements along a wall", source="ours: a cell", low=0.0
    )
    max_slope: float = param(
        8.0,
        "1",
        "range step per beam spacing that ends a surface",
        source="ours: 7 degrees; original code: 3 degrees",
        low=1.0,
    )
    beam_width: float = param(
        0.2, "1", "width of a beam, in beam spacings", source="ours: grazing incidence", low=0.0
    )
    roughness: float = param(
        2.0,
        "1",
        "deviation from its line, in range noises, above which a surface is rough",
        source="ours: rough surfaces get a smaller window, then the hit itself",
        low=0.5,
    )
    iterations: int = param(
        15, "1", "limit of Gauss-Newton iterations", source="ours: typically 3", low=1, high=1_000
    )
    robust: float = param(
        0.03, "m", "residual that gets weight 1/2", source="ours: 3 range noises", low=1e-3
    )
    map_noise: float = param(
        1.0,
        "1",
        "error of the field per rms residual",
        source="ours: both errors are similar",
        low=0.0,
    )
    max_cells: int = max_cells()
    refine: bool = param(
        True,
        "1",
        "align with the field after ICP",
        source="ours: the paper ends with ICP",
        switch=True,
    )
    rays: int = param(
        90,
        "1",
        "limit of rays of the model scan",
        source="ours: two elements per ray",
        low=8,
        high=10_000,
    )
    icp_iterations: int = param(
        30, "1", "limit of ICP iterations", source="original code; typically 5", low=1, high=1000
    )
    widest_gate: float = param(
        0.4, "m", "initial distance gate of pairs", source=ORIGINAL, low=1e-3
    )
    narrowest_gate: float = param(
        0.05,
        "m",
        "minimum gate of pairs",
        source="ours: 5 range noises; original code: 0.02",
        low=1e-3,
    )
    pair_window: int = param(
        2,
        "1",
        "rays on either side that are searched for a pair",
        source="ours: pairs by projection; original code: nearest of all",
        low=0,
        high=100,
    )
    search_translation: float = param(
        0.6,
        "m",
        "half width of the RANSAC window",
        source="ours: the original has no limit",
        low=0.0,
    )
    search_rotation: float = param(
        0.6,
        "rad",
        "half width of the RANSAC window",
        source="ours: the original has no limit",
        low=0.0,
    )
    convincing: float = param(
        0.97,
        "1",
        "ratio to the mean inlier ratio below which RANSAC is tried",
        source="ours: next to the true pose most of a scan still matches",
        low=0.0,
        high=1.0,
    )
    min_known: float = param(
        0.15,
        "1",
        "smallest ratio of paired elements of an accepted match",
        source="ours: fewer pairs can match by chance",
        low=0.0,
        high=1.0,
    )
    trials: int = param(
        100, "1", "model points tried in RANSAC", source=ORIGINAL, low=1, high=10_000
    )
