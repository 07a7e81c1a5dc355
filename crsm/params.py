"""Parameters of CRSM."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from crsm.ros import ROS as ROS_NAMES
from slams.frontend.params import FrontendParams
from slams.grid_bounds import max_cells
from slams.params import RosNames, param
from slams.refine.params import RefineParams

CODE = "original code"


@dataclass(frozen=True)
class CrsmParams(RefineParams, FrontendParams):
    """Parameters of the default, `Crsm`; the published program has its own."""

    ROS: ClassVar[RosNames | None] = ROS_NAMES
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any] | str]] = {
        "original": "crsm.original:Original",
        # without a fit behind it the climb must see more
        "paper": {"estimator": "plain", "refine": False, "critical_rays": 200},
    }

    cell: float = param(
        0.05,
        "m",
        "edge of a map cell",
        source="ours: cells have sub-cell position; original code 0.02",
        low=0.005,
        high=1.0,
    )
    stroke: float = param(
        0.7,
        "cell",
        "width of a wall in the map, its standard deviation; that of the laser's noise at least",
        source="ours: 1 draws near walls together, 0.5 slips in corridors",
        low=0.3,
        high=5.0,
    )
    free: float = param(
        0.3,
        "1",
        "weight of a beam that passes a cell; one that ends there has 1",
        source="original code: hits are drawn three times as strongly",
        low=0.0,
    )
    max_weight: float = param(
        100.0,
        "1",
        "weight that a cell remembers, in hits; then it follows slowly",
        source="ours: drift against change",
        low=1.0,
    )
    critical_rays: int = param(
        90,
        "1",
        "rays that the hill climbing looks at",
        source="ours: as many as the original takes on a UTM-30LX",
        low=3,
        high=2000,
    )
    insert_distance: float = param(
        0.2,
        "m",
        "way since the last scan that entered the map",
        source="ours: a map that learns from every scan drifts with the pose",
        low=0.0,
    )
    insert_angle: float = param(
        0.2,
        "rad",
        "turn since the last scan that entered the map",
        source="ours: a map that learns from every scan drifts with the pose",
        low=0.0,
    )
    settle: int = param(
        10,
        "1",
        "scans at the start that all enter the map",
        source="ours: of the first alone there are gaps and its noise",
        low=1,
        high=10_000,
    )
    max_cells: int = max_cells()
    enough: float = param(
        0.9, "1", "share of the usual fitness that ends a search", source="ours: an early end"
    )
    restarts: int = param(
        200, "1", "random restarts that are looked at", source="ours", low=0, high=10_000
    )
    climbs: int = param(
        5, "1", "restarts that are climbed from, the best", source="ours", low=0, high=1000
    )
    search_distance: float = param(
        0.4,
        "m",
        "restarts lie within this of the start in x and y",
        source="ours: twice the original's",
        low=0.0,
    )
    search_angle: float = param(
        0.5, "rad", "restarts lie within this heading", source=CODE, low=0.0, high=3.2
    )
