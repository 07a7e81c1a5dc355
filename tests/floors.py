"""Maps as grids of the rooms that tests know as segments."""

import cv2
import numpy as np

from slams.localize import GlobalLocalizer
from slams.types import OccupancyGrid, Pose2
from tests.rooms import ROOM, box, drive_poses, laser, moved, scan_at

CELL, MARGIN = 0.05, 0.5
LIDAR = laser(541)
START = Pose2(0.3, -0.2, 0.4)  # of a way in the map of the room


def grid_of(segments=ROOM, inside=(0.0, 0.0), cell=CELL):
    """The grid of segments (n, 4) [m]: walls of one cell, free what `inside` is of."""
    low = segments.reshape(-1, 2).min(axis=0) - MARGIN
    high = segments.reshape(-1, 2).max(axis=0) + MARGIN
    nx, ny = np.ceil((high - low) / cell).astype(int)
    walls = np.zeros((ny, nx), np.uint8)
    for x0, y0, x1, y1 in segments:
        n = int(np.ceil(10.0 * np.hypot(x1 - x0, y1 - y0) / cell)) + 2
        x, y = np.linspace(x0, x1, n), np.linspace(y0, y1, n)
        walls[((y - low[1]) / cell).astype(int), ((x - low[0]) / cell).astype(int)] = 1
    _, part = cv2.connectedComponents(1 - walls, connectivity=4)
    iy, ix = int((inside[1] - low[1]) / cell), int((inside[0] - low[0]) / cell)
    p = np.where(walls > 0, 1.0, np.where(part == part[iy, ix], 0.0, np.nan))
    return OccupancyGrid(p.astype(np.float32), cell, (float(low[0]), float(low[1])))


def searched(index, scan):
    """The candidates of a search for one scan, the most likely first."""
    localizer = GlobalLocalizer(index)
    localizer.add(scan)
    return localizer.candidates


def is_wall(grid, x, y):
    """Whether a cell within one of (x, y) is occupied."""
    ix, iy = ((np.array([x, y]) - grid.origin) / grid.resolution).astype(int)
    return bool(np.nanmax(grid.p[iy - 1 : iy + 2, ix - 1 : ix + 2]) > 0.5)


def noisy(pose, seed=0, lidar=LIDAR, segments=ROOM, **more):
    return scan_at(pose, lidar, segments, 0.01, np.random.default_rng(seed), **more)


def truth(n=40):
    """The poses (n, 3) of a way that begins at START."""
    return moved(START, drive_poses(n, 0.05))


def seen(n, lidar):
    """What a laser sees on this way: ranges (n, b)."""
    rng = np.random.default_rng(0)
    poses = map(Pose2._make, truth(n).tolist())
    return np.array([scan_at(pose, lidar, noise=0.01, rng=rng).ranges for pose in poses])


# a corridor between two rooms that are alike but for what is outside of their doors
ALIKE = np.array(
    [
        *[(left, 0.0, right, 0.0) for left, right in ((-9.0, -5.0), (-4.0, 4.0), (5.0, 9.0))],
        (-9.0, -2.0, 9.0, -2.0),
        *[(x, -2.0, x, 0.0) for x in (-9.0, 9.0)],
        *[(x, 0.0, x, 4.0) for x in (-7.0, -2.0, 2.0, 7.0)],
        *[(x - 2.5, 4.0, x + 2.5, 4.0) for x in (-4.5, 4.5)],
        *[wall for x in (-5.5, 3.5) for wall in box(x, 2.6, x + 0.5, 3.2)],
        *box(5.8, -1.6, 6.6, -1.1),
    ]
)
