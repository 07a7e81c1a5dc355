"""How good a map is: the occupancy grid of a run against the true one.

The run's map is brought into the true map's frame by one rigid motion: by definition the true base
pose of the first scan, so that drift counts against the map. A cell is occupied above a probability
of 0.5 and free below; nan and 0.5 are unknown, and unknown is never free. Measures that compare
cells do so in the run's grid: there a cell is truly occupied when a part of it is (walls may be
thinner than a cell), else truly free when a part of it is. Distances are between the centers of
occupied cells and need no common grid.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bench.judge.map_cells import Cells, Mask, cells_of, cut, resampled, true_window
from bench.judge.map_measures import FEWEST_WALLS, coverage, distances, overlap, thickness
from slams.types import Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from bench.sim.world import World
    from slams.scanlog import ScanLog
    from slams.types import Laser

POSES = 2000  # of a log that the world is looked at from, evenly spread
FINE = 256  # parts of a cell in which outlines are drawn
LEAST_SHARE = 0.1  # of the true map that a run must know to be judged by it


def truth_map(log: ScanLog, most: int = POSES) -> OccupancyGrid | None:
    """What a perfect mapper could know of a simulated log's world; None when not simulated.

    Free are the free cells that lie within the outline of a scan seen from a true pose (every k-th
    scan, at most `most`), exact ranges up to the laser's limit. Occupied are the walls' cells that
    share an edge with one of these. All else is unknown: rooms never looked into, insides of walls.
    """
    from bench.sim.rays import true_poses
    from bench.sim.simulation import world_of

    world = world_of(log)
    if world is None or log.truth is None:
        return None
    poses = true_poses(log, log.t[:: max(1, math.ceil(len(log) / most))])
    poses = poses[np.isfinite(poses).all(axis=tuple(range(1, poses.ndim)))]
    free = _looked_at(world, log.laser, poses) & world.free
    walls = world.occupied & _beside(free)
    p = np.full(free.shape, np.nan, np.float32)
    p[free], p[walls] = 0.0, 1.0
    return OccupancyGrid(p, world.resolution, world.origin)


def compare(
    grid: OccupancyGrid, truth: OccupancyGrid, T_world_map: Pose2
) -> dict[str, float | None]:
    """Every measure of a run's map; None where it would mean nothing.

    - iou: cells occupied in both over cells occupied in either, of those known in both.
    - adnn_to_truth: average distance [m] from an occupied cell to the nearest true wall: accuracy.
    - adnn_from_truth: average distance [m] from a true wall to the nearest occupied cell:
      completeness. Where cells of 0.05 m meet true ones of 0.02 m, either is 0.01 to 0.02 at best.
    - wall_thickness: area of the walls over half of their outline [m].
    - true_wall_thickness: of the true walls in the run's grid, what a perfect map would have.
    - coverage: share of the cells known in the true map that the run's map knows.

    Args:
        grid: the run's map.
        truth: the true map, nan where no scan could tell.
        T_world_map: the frame of the run's map in that of the true one.
    """
    window = true_window(truth, grid, T_world_map)
    here, there = cut(grid, window), resampled(truth, grid, T_world_map, window)
    known = here.known & there.known
    walls = cells_of(grid.p).occupied
    iou, to_truth, from_truth = None, None, None
    if _are_comparable(walls, known, there):
        iou = overlap(here.occupied & known, there.occupied & known)
        to_truth, from_truth = distances(grid, truth, T_world_map)
    return {
        "iou": iou,
        "adnn_to_truth": to_truth,
        "adnn_from_truth": from_truth,
        "wall_thickness": thickness(walls, grid.resolution),
        "true_wall_thickness": thickness(there.occupied, grid.resolution),
        "coverage": coverage(known, there.known),
    }


def _looked_at(world: World, laser: Laser, poses: Floats) -> Mask:
    """Cells inside the outline of an exact scan from one of the poses (n, 3) or (n, b, 3)."""
    import cv2

    from bench.sim.rays import rays_of

    seen = np.zeros(world.occupied.shape, np.uint8)
    for k in range(len(poses)):
        (rays,) = rays_of(laser, poses[k : k + 1])
        reach = np.minimum(world.cast(rays), laser.range_max)
        sights = np.stack([reach * np.cos(rays[:, 2]), reach * np.sin(rays[:, 2])], axis=1)
        corners = np.vstack([rays[:1, :2], rays[:, :2] + sights])
        outline = (corners - np.array(world.origin)) / world.resolution - 0.5
        cv2.fillPoly(seen, [np.round(FINE * outline).astype(np.int32)], 1, 8, FINE.bit_length() - 1)
    return seen.astype(bool)


def _beside(mask: Mask) -> Mask:
    """Cells that share an edge with one of the mask."""
    padded = np.pad(mask, 1)
    beside: Mask = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    return beside


def _are_comparable(walls: Mask, known: Mask, there: Cells) -> bool:
    """Whether both maps have walls enough, and the run's knows some of what could be seen."""
    enough = min(walls.sum(), there.occupied.sum()) >= FEWEST_WALLS
    return bool(enough and known.sum() >= LEAST_SHARE * there.known.sum())
