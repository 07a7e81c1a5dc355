"""Compiles all kernels before the first scan, so that no scan waits for the compiler."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from slams.localize.hooks import Localizes
from slams.params import Params
from slams.types import IDENTITY, Corrected, Scan, Slam


def warm_up(slam_class: type[Slam], params: Params) -> None:
    """Run throw-away instances on scans of a test world: at rest, moving, deskewed, lost, placed.

    Global localization and loop closure are run once, too; otherwise the first robot that is lost
    or returns to a mapped area would wait for their compilation.
    """
    from slams.localize.global_localizer import GlobalLocalizer
    from slams.test_world import drive, laser, scan_at

    for increment, measured in ((0.0, True), (5e-4, False)):
        lidar = laser(n_beams=91, time_increment=increment)
        log = drive(n=8, rate=5.0, lidar=lidar).select(odometry=measured)
        slam = slam_class(params)
        for scan in (*log, scan_at((2.0, 1.5, 2.0), lidar, t=2.0)):
            slam.update(scan)
        with suppress(ValueError):  # a baseline's map has no free cells
            GlobalLocalizer(slam.map()).add(scan_at((0.0, 0.0, 0.0), lidar, t=2.1))
        if isinstance(slam, Localizes):
            slam.insert_at(scan_at((0.0, 0.0, 0.0), lidar, t=2.2), IDENTITY)
        if isinstance(slam, Corrected):
            _warm_up_loops(scan_at((0.0, 0.0, 0.0), lidar, t=2.3))


def _warm_up_loops(scan: Scan) -> None:
    from slams.frontend.correlative import Window
    from slams.loops import PoseGraph
    from slams.loops.matching import LocalMap, keyframe, read_end_points

    new_keyframe, graph = keyframe(scan, IDENTITY), PoseGraph()
    for _ in range(2):
        graph.append(IDENTITY, np.ones(3))
    graph.uncertainty(0)
    graph.iterate()
    local_map = LocalMap([new_keyframe], [IDENTITY])
    local_map.search(new_keyframe.ends, Window(IDENTITY, 1.0, 0.1), 0.0)
    local_map.fit(read_end_points(scan, IDENTITY)[0], IDENTITY)
    local_map.match_score(new_keyframe.ends, IDENTITY)
