"""Parameters of TSD SLAM."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from slams.frontend.params import FrontendParams
from slams.grid_bounds import max_cells
from slams.params import RosNames, param
from slams.scan.params import ScanParams
from tsd.ros import ROS as ROS_NAMES

ORIGINAL = "original code"


@dataclass(frozen=True)
class TsdParams(ScanParams, FrontendParams):
    """Parameters of the default, `Tsd`; the published program has its own."""

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
    min_range: float = param(
        0.1,
        "m",
        "nearer ends are not used",
        source="ours: the laser's own",
        low=0.0,
        ros=("las_min_range", "laser_min_range"),
    )
    max_range: float = param(
        80.0,
        "m",
        "farther ends are not used",
        source="ours: a SICK LMS; 30 in the original",
        low=0.5,
        ros=("max_range",),
    )
    range_noise: float = param(
        0.01, "m", "standard deviation of a range", source="ours: UTM-30LX data sheet", low=1e-4
    )
    normal_window: float = param(
        0.12,
        "m",
        "half length of the window a surface line is fitted in",
        source="ours: noise 1/6 of a beam's at 2 m",
        low=0.0,
    )
    spacing: float = param(
        0.05, "m", "distance of surface elements along a wall", source="ours: a cell", low=0.0
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
        15, "1", "most Gauss-Newton iterations", source="ours: 3 are usual", low=1, high=1_000
    )
    robust: float = param(
        0.03,
        "m",
        "distance at which a residual loses half its say",
        source="ours: 3 range noises",
        low=1e-3,
    )
    map_noise: float = param(
        1.0,
        "1",
        "error of the field per residual of the last match",
        source="ours: its errors are alike",
        low=0.0,
    )
    max_cells: int = max_cells()
    refine: bool = param(
        True,
        "1",
        "fit the scan to the field itself, behind ICP",
        source="ours: the paper ends with ICP",
        switch=True,
    )
    rays: int = param(
        90,
        "1",
        "most rays of the model scan",
        source="ours: two elements of the scan to each",
        low=8,
        high=10_000,
    )
    icp_iterations: int = param(
        30, "1", "most ICP rounds", source="original code; 5 are usual", low=1, high=1000
    )
    widest_gate: float = param(
        0.4, "m", "greatest pair distance at first", source=ORIGINAL, low=1e-3
    )
    narrowest_gate: float = param(
        0.05, "m", "least gate", source="ours: 5 range noises; original code: 0.02", low=1e-3
    )
    pair_window: int = param(
        2,
        "1",
        "rays to either side among which a pair is looked for",
        source="ours: pairs by projection; original code: of all",
        low=0,
        high=100,
    )
    search_translation: float = param(
        0.6,
        "m",
        "half width of RANSAC's window",
        source="ours: the original searches all of its map",
        low=0.0,
    )
    search_rotation: float = param(
        0.6,
        "rad",
        "half width of RANSAC's window",
        source="ours: the original searches all of its map",
        low=0.0,
    )
    convincing: float = param(
        0.97,
        "1",
        "share of the usual agreement below which RANSAC is tried",
        source="ours: a pose beside the right one still explains most of a scan",
        low=0.0,
        high=1.0,
    )
    min_known: float = param(
        0.15,
        "1",
        "least share of elements on known surfaces of an accepted match",
        source="ours: fewer pairs are chance",
        low=0.0,
        high=1.0,
    )
    trials: int = param(
        100,
        "1",
        "points of the model scan that propose poses in RANSAC",
        source=ORIGINAL,
        low=1,
        high=10_000,
    )
