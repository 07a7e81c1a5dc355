"""Parameters of CRSM."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from crsm.ros import ROS as ROS_NAMES
from slams.extent import max_cells
from slams.motion.params import MotionParams
from slams.params import RosNames, param
from slams.refine.params import RefineParams

CODE = "original code"


@dataclass(frozen=True)
class CrsmParams(RefineParams, MotionParams):
    """Parameters of the default, `Crsm`; the published program has its own."""

    ROS: ClassVar[RosNames | None] = ROS_NAMES
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any] | str]] = {
        "original": "crsm.original:Original",
        # without a fit behind it the climb must end on a finer field and see more
        "paper": {"refine": False, "relocate": False, "sharp": 5, "critical_rays": 200},
    }

    cell: float = param(
        0.1,
        "m",
        "edge of a map cell",
        source="ours: walls have sub-cell position; original code 0.02",
        low=0.005,
        high=1.0,
    )
    density: float = param(
        0.25,
        "1",
        "map update of free cells: first step as a share of the way to white",
        source="ours: the original's shape of gain",
        low=0.0,
    )
    obstacle_density: float = param(
        3.0,
        "1",
        "how much stronger a hit is drawn than a free cell",
        source=CODE,
        low=0.0,
        ros=("map_update_obstacle_density",),
    )

    critical_rays: int = param(
        90,
        "1",
        "rays that the hill climbing looks at",
        source="ours: as many as the original takes on a UTM-30LX",
        low=3,
        high=2000,
    )
    lone_noise: float = param(
        0.03,
        "m",
        "standard deviation of a lone point, in x and y",
        source="ours: beam spacing on small things",
        low=0.001,
    )
    compat: float = param(
        0.7,
        "1",
        "least cosine between two normals of one wall; keeps both faces of a thin wall apart",
        source="ours: 45 degrees",
        low=0.5,
        high=1.0,
    )
    max_weight: float = param(
        1000.0,
        "1",
        "points a wall element averages over; then it follows slowly",
        source="ours: drift against change",
        low=1.0,
    )
    insert_step: float = param(
        0.2,
        "m",
        "way (or turn, in rad) between two scans that enter the map",
        source="ours: a map that learns from every scan drifts with the pose",
        low=0.0,
    )
    insert_rest: float = param(
        2.0,
        "s",
        "a scan enters the map after so long, also when the robot stands",
        source="ours: standing still helps the map; people pass",
        low=0.0,
    )
    fade: float = param(
        0.2,
        "1",
        "share of a wall element's weight that one beam through it takes",
        source="ours: ghosts fade",
        low=0.0,
        high=1.0,
    )
    max_cells: int = max_cells()
    fine: int = param(
        2, "1", "grey cells along one map cell", source="ours: map to look at", low=1, high=20
    )
    sharp: int = param(
        2,
        "1",
        "cells of the field that is climbed, along one map cell",
        source="ours: wide enough to climb from afar, a fit is behind it",
        low=1,
        high=20,
    )
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
        "restarts lie within this of the prediction in x and y",
        source="ours: twice the original's",
        low=0.0,
    )
    search_angle: float = param(
        0.5, "rad", "restarts lie within this heading", source=CODE, low=0.0, high=3.2
    )
    lost_below: float = param(
        0.35,
        "1",
        "share of the usual evidence below which the map does not explain a scan",
        source="ours",
        low=0.0,
        high=1.0,
    )
