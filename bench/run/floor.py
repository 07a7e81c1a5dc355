"""What map quality is at best: maps drawn at the true poses, beside those of the algorithms.

No algorithm's own mapper can be asked to draw at a given pose, so a plain one stands for them all:
log-odds of hits and misses [Moravec85] in square cells. What an algorithm's map lacks against it
comes from its poses or its mapper; what that one lacks, from cells and noise alone. An algorithm
may be better than it: by walls known to less than a cell, or by a rule that leaves noise out.
"""

from __future__ import annotations

import math

import numpy as np

from bench.judge.map_cells import resampled, true_window
from bench.judge.mapquality import MapQuality, compare, map_frame, truth_map
from bench.run.floor_kernels import Odds, PlainMap, insert_scans
from bench.sim.rays import rays_of, true_poses
from slams.scanlog import ScanLog
from slams.types import Floats, OccupancyGrid, Pose2, Ranges

RESOLUTION = 0.05  # m, of the cells, as the algorithms' defaults
POSES = 2000  # of a log that scans are drawn from, evenly spread
BLOCK = 200  # scans at once
# log-odds of OctoMap's defaults (Hornung et al. 2013): probabilities 0.7, 0.4, 0.1192, 0.971
ODDS = Odds(hit=0.85, miss=-0.4, low=-2.0, high=3.5)
AT_TRUTH = "plain mapper at true poses"
TRUE_CELLS = "true map in cells of {:g} cm"


def floor_rows(
    log: ScanLog, truth: OccupancyGrid | None = None, resolution: float = RESOLUTION
) -> dict[str, MapQuality]:
    """Quality of the maps that nothing but cells and noise spoil, by name.

    Args:
        log: a simulated log; of others there is nothing to know.
        truth: its true map, as by `bench.judge.mapquality.truth_map`; made where it is not given.
        resolution: of the cells [m].
    """
    frame = _frame(log)
    truth = truth_map(log) if truth is None else truth
    if frame is None or truth is None:
        return {}
    blank = _blank(truth, frame, resolution)
    maps = {
        AT_TRUTH: map_at_truth(log, blank, frame),
        TRUE_CELLS.format(1e2 * resolution): _in_cells(truth, blank, frame),
    }
    return {name: compare(grid, truth, frame) for name, grid in maps.items()}


def map_at_truth(log: ScanLog, blank: OccupancyGrid, T_world_map: Pose2) -> OccupancyGrid:
    """The map (ny, nx) of a plain mapper that inserts scans at their true poses.

    `blank` tells the cells. Every k-th scan, so that there are at most `POSES`; those without a
    truth, and beams without a return, tell nothing.
    """
    grid = PlainMap(np.zeros(blank.p.shape), np.zeros(blank.p.shape, np.int32))
    part = slice(None, None, max(1, math.ceil(len(log) / POSES)))
    t, ranges = log.t[part], log.ranges[part]
    for start in range(0, len(t), BLOCK):
        rays, cells = _in_map(
            log, t[start : start + BLOCK], ranges[start : start + BLOCK], blank, T_world_map
        )
        insert_scans(grid, rays, cells, start + 1, ODDS)
    p = 1.0 / (1.0 + np.exp(-grid.log_odds))
    p[grid.latest == 0] = np.nan
    return OccupancyGrid(p.astype(np.float32), blank.resolution, blank.origin)


def _frame(log: ScanLog) -> Pose2 | None:
    """The frame of a run's map in the world: the true pose of the first scan."""
    at_scans = log.truth_at(log.t[:1])
    return None if at_scans is None else map_frame(at_scans, at_scans)


def _blank(truth: OccupancyGrid, T_world_map: Pose2, resolution: float) -> OccupancyGrid:
    """An empty map that holds all that is known of the true one."""
    corner = OccupancyGrid(np.full((1, 1), np.nan, np.float32), resolution, (0.0, 0.0))
    window = true_window(truth, corner, T_world_map)
    p = np.full((window.ny, window.nx), np.nan, np.float32)
    return OccupancyGrid(p, resolution, (window.ix * resolution, window.iy * resolution))


def _in_cells(truth: OccupancyGrid, blank: OccupancyGrid, T_world_map: Pose2) -> OccupancyGrid:
    """The true map itself, occupied where a part of a cell is."""
    found = resampled(truth, blank, T_world_map, true_window(truth, blank, T_world_map))
    p = np.full(blank.p.shape, np.nan, np.float32)
    p[found.free], p[found.occupied] = 0.0, 1.0
    return OccupancyGrid(p, blank.resolution, blank.origin)


def _in_map(
    log: ScanLog, t: Floats, ranges: Ranges, blank: OccupancyGrid, T_world_map: Pose2
) -> tuple[Floats, Ranges]:
    """Rays (n, b, 3) and ranges (n, b) of scans in cells of the map."""
    poses = true_poses(log, t)
    covered = np.isfinite(poses).all(axis=tuple(range(1, poses.ndim)))
    rays = rays_of(log.laser, poses[covered])
    starts = T_world_map.inverse().transform(rays[..., :2].reshape(-1, 2))
    cells = (starts - np.array(blank.origin)) / blank.resolution
    rays[..., :2] = cells.reshape(*rays.shape[:2], 2)
    rays[..., 2] -= T_world_map.theta
    return rays, ranges[covered] / np.float32(blank.resolution)
