"""Parameters of CRSM."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from crsm.ros import CODE, ROS_NAMES
from slams.frontend.params import FrontendParams
from slams.grid_bounds import max_cells
from slams.params import RosNames, param
from slams.refine.params import RefineParams


@dataclass(frozen=True)
class CrsmParams(RefineParams, FrontendParams):
    """Parameters of the default, `Crsm`."""

    ROS: ClassVar[RosNames | None] = ROS_NAMES
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any] | str]] = {
        "original": "crsm.original:Original",
        # more rays, as no fit to lines follows
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
        "standard deviation of a wall in the map; at least that of the laser's noise",
        source="ours: 1 joins near walls, 0.5 loses position along corridors",
        low=0.3,
        high=5.0,
    )
    free: float = param(
        0.3,
        "1",
        "weight of a beam that passes a cell; a beam that ends in it has 1",
        source="original code: a hit changes a cell three times as much",
        low=0.0,
    )
    max_weight: float = param(
        100.0,
        "1",
        "maximum weight of a cell, in hits; new hits change it by their share",
        source="ours: less lets the map drift, more keeps old walls longer",
        low=1.0,
    )
    critical_rays: int = param(
        90,
        "1",
        "number of critical rays",
        source="ours: as many as the original takes on a UTM-30LX",
        low=3,
        high=2000,
    )
    insert_distance: float = param(
        0.2,
        "m",
        "distance since the last scan that entered the map",
        source="ours: a map that every scan enters drifts with the pose",
        low=0.0,
    )
    insert_angle: float = param(
        0.2,
        "rad",
        "rotation since the last scan that entered the map",
        source="ours: a map that every scan enters drifts with the pose",
        low=0.0,
    )
    settle: int = param(
        10,
        "1",
        "scans at the start that all enter the map",
        source="ours: one scan alone leaves gaps and its noise",
        low=1,
        high=10_000,
    )
    max_cells: int = max_cells()
    enough: float = param(
        0.9, "1", "share of the mean fitness that ends the restarts", source="ours: an early end"
    )
    restarts: int = param(
        200, "1", "random restarts that are scored", source="ours", low=0, high=10_000
    )
    climbs: int = param(
        5, "1", "restarts of the best scores, climbed from", source="ours", low=0, high=1000
    )
    search_distance: float = param(
        0.4,
        "m",
        "maximum distance of a restart from the start, in x and in y",
        source="ours: twice the original's",
        low=0.0,
    )
    search_angle: float = param(
        0.5, "rad", "maximum rotation of a restart from the start", source=CODE, low=0.0, high=3.2
    )
