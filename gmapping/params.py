"""Parameters of GMapping."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from gmapping.ros import ROS_NAMES
from slams.frontend.params import FrontendParams
from slams.grid_bounds import max_cells
from slams.params import RosNames, param
from slams.scan.params import ScanParams

ORIGINAL = "original code"


@dataclass(frozen=True)
class GMappingParams(ScanParams, FrontendParams):
    """Parameters of the default, `GMapping`; those of the published program are in `original`."""

    ROS: ClassVar[RosNames | None] = ROS_NAMES
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any] | str]] = {
        "original": "gmapping.original:Original",
        "paper": {"estimator": "plain", "refine": False, "spread": 1.0},
    }

    refine: bool = param(
        True,
        "1",
        "match to surfaces inside the cells, in place of hill climbing on end points",
        source="ours: accuracy below a cell",
        switch=True,
    )
    n_particles: int = param(
        15,
        "1",
        "number of particles",
        source="ours: 30 double the time of a keyframe",
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
        "distance between keyframes",
        source="ours: every scan is matched",
        low=0.0,
        ros=("linearUpdate",),
    )
    angular_update: float = param(
        0.2,
        "rad",
        "rotation between keyframes",
        source="ours: every scan is matched",
        low=0.0,
        ros=("angularUpdate",),
    )
    settle: int = param(
        10,
        "1",
        "scans at the start that are all keyframes",
        source="ours: the noise of a single first scan would stay in every later pose",
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
        "noise [m, rad] of the tracked motion between keyframes, per m and rad of motion",
        source="ours: matching decides, not odometry",
        low=0.0,
    )
    key_noise: float = param(
        0.005,
        "m",
        "constant noise [m, rad] of the tracked motion between keyframes",
        source="ours: independent of the scan rate",
        low=1e-5,
    )
    band: int = param(
        2,
        "cell",
        "cells kept on either side of a surface, and reach of the first step",
        source="ours: basin of convergence",
        low=1,
        high=8,
    )
    cap: float = param(
        100.0, "1", "maximum weight of a cell: the map follows changes", source="ours", low=1.0
    )
    width: float = param(
        0.03, "m", "scale of the robust weights at the last step", source="ours", low=0.001
    )
    steps: int = param(8, "1", "Gauss-Newton steps at most", source="ours", low=1, high=1_000)
    independent: float = param(
        100.0,
        "1",
        "independent beams of a scan, for weights",
        source="ours: in place of ogain",
        low=1.0,
    )
    spread: float = param(
        0.5,
        "1",
        "scale of the draws from the proposal, in standard deviations",
        source="[Grisetti07] improved proposal, which has 1",
        low=0.0,
    )
    grain: float = param(
        0.04,
        "m",
        "beams that end within this distance become one piece of surface",
        source="ours: basin of convergence",
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
        "share of hits above which a cell of the map is a wall",
        source=ORIGINAL,
        low=0.01,
        high=0.99,
        ros=("occ_thresh",),
    )
