"""Parameters of GMapping."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from gmapping.ros import ROS as ROS_NAMES
from slams.frontend.params import FrontendParams
from slams.grid_bounds import max_cells
from slams.params import RosNames, param
from slams.scan.params import ScanParams

ORIGINAL = "original code"


@dataclass(frozen=True)
class GMappingParams(ScanParams, FrontendParams):
    """Parameters of the default, `GMapping`; the published program has its own."""

    ROS: ClassVar[RosNames | None] = ROS_NAMES
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any] | str]] = {
        "original": "gmapping.original:Original",
        "paper": {"estimator": "plain", "refine": False, "spread": 1.0},
    }

    refine: bool = param(
        True,
        "1",
        "match to surfaces inside the cells, in place of the end points' climb",
        source="ours: exact to below a cell",
        switch=True,
    )
    n_particles: int = param(
        15,
        "1",
        "number of particles",
        source="ours: 30 take twice the time of a keyframe",
        low=1,
        high=20_000,
        ros=("particles",),
    )
    resolution: float = param(
        0.05, "m", "edge of a cell", source=ORIGINAL, low=0.01, high=1.0, ros=("delta",)
    )
    linear_update: float = param(
        0.2,
        "m",
        "way between keyframes",
        source="ours: every scan is matched",
        low=0.0,
        ros=("linearUpdate",),
    )
    angular_update: float = param(
        0.2,
        "rad",
        "turn between keyframes",
        source="ours: every scan is matched",
        low=0.0,
        ros=("angularUpdate",),
    )
    settle: int = param(
        10,
        "1",
        "scans at the start that are all keyframes",
        source="ours: or the first scan's noise stays in every later pose",
        low=1,
        high=10_000,
    )
    resample_threshold: float = param(
        0.5,
        "1",
        "n_eff over n_particles below which particles are resampled",
        source="[Grisetti07] adaptive resampling: N / 2",
        low=0.0,
        high=1.0,
        ros=("resampleThreshold",),
    )
    way_noise: float = param(
        0.01,
        "1",
        "noise of the tracked way between keyframes [m, rad] per m and rad of it",
        source="ours: matching decides, not odometry",
        low=0.0,
    )
    key_noise: float = param(
        0.005,
        "m",
        "noise [m, rad] between keyframes beside that of the motion",
        source="ours: rate of the scans does not matter",
        low=1e-5,
    )
    band: int = param(
        2,
        "cell",
        "cells kept on either side of a surface, and reach of the first step",
        source="ours: the basin",
        low=1,
        high=8,
    )
    cap: float = param(
        100.0, "1", "greatest weight of a cell: the map can follow changes", source="ours", low=1.0
    )
    width: float = param(
        0.03, "m", "deviation of an outlier at the last step", source="ours", low=0.001
    )
    steps: int = param(8, "1", "Gauss-Newton steps at most", source="ours", low=1, high=1_000)
    independent: float = param(
        100.0,
        "1",
        "independent beams in a scan, for the weights",
        source="ours: in place of ogain",
        low=1.0,
    )
    spread: float = param(
        0.5,
        "1",
        "draws from the proposal, in its standard deviations",
        source="[Grisetti07] improved proposal, which has 1",
        low=0.0,
    )
    grain: float = param(
        0.04,
        "m",
        "beams that end so close together become their mean",
        source="ours: the basin",
        low=0.0,
    )
    max_range: float = param(
        80.0,
        "m",
        "longer ranges are not used",
        source=ORIGINAL,
        low=0.1,
        ros=("maxRange", "maxUrange"),
    )
    max_cells: int = max_cells()
    max_tiles: int = param(
        50_000,
        "1",
        "tiles of 6 kB at most, over all particles",
        source="ours: memory",
        low=100,
        high=1 << 19,
    )
    occupied: float = param(
        0.25,
        "1",
        "share of hits above which a cell of the original's picture is a wall",
        source=ORIGINAL,
        low=0.01,
        high=0.99,
        ros=("occ_thresh",),
    )
