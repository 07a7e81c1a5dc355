"""A virtual drive: converts an occupancy grid to an algorithm's own kind of map.

A simulated laser stands at free positions all over the grid. Its scans, by ray casting, are
inserted into the algorithm's map at their known poses. The origin of the drive's frame is the first
position, because maps grow around their start.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from slams.localize.distance_kernels import measure
from slams.localize.distance_map import DistanceMap
from slams.localize.hooks import Localizes
from slams.types import Floats, Laser, Pose2, Ranges, Scan

STATION_SPACING = 1.0  # m: each wall is observed from several positions
STATION_CLEARANCE = 0.3  # m from any wall, if the space is wide enough
MIN_CLEARANCE = 0.1  # m from any wall of a laser
VIRTUAL_SCAN_PERIOD = 1.0  # s: the speed of a slow robot
VIRTUAL_LASER = Laser(-math.pi, 2.0 * math.pi / 1440, 1440, 0.05, 30.0)


def stations(distances: DistanceMap) -> Floats:
    """Positions (n, 2) [m] in the map's frame that cover its free space, in the order of a drive.

    In every square of `STATION_SPACING` the free cell with the greatest clearance.
    """
    clearance = distances.gap * distances.resolution
    cells = max(1, round(STATION_SPACING / distances.resolution))
    found = []
    for row, y0 in enumerate(range(0, clearance.shape[0], cells)):
        columns = range(0, clearance.shape[1], cells)
        for x0 in columns if row % 2 == 0 else reversed(columns):
            part = np.minimum(clearance[y0 : y0 + cells, x0 : x0 + cells], STATION_CLEARANCE)
            if part.max() >= MIN_CLEARANCE:
                iy, ix = _most_central(part)
                found.append((x0 + ix + 0.5, y0 + iy + 0.5))
    return np.array(found).reshape(-1, 2) * distances.resolution + distances.origin


def _most_central(clearance: Floats) -> tuple[float, float]:
    """The cell nearest to the middle of a square, among those with the greatest clearance."""
    iy, ix = np.nonzero(clearance == clearance.max())
    middle = 0.5 * np.array(clearance.shape)
    best = int(np.argmin((iy + 0.5 - middle[0]) ** 2 + (ix + 0.5 - middle[1]) ** 2))
    return float(iy[best]), float(ix[best])


def ranges_at(distances: DistanceMap, pose: Pose2, laser: Laser = VIRTUAL_LASER) -> Ranges:
    """Ranges (n_beams,) [m] that a laser measures in a map; `pose` is that of the laser.

    nan where a beam meets no wall within the laser's range, or unknown cells.
    """
    cell, measured = distances.resolution, np.empty(laser.n_beams)
    far = laser.range_max / cell
    measure(distances.distances, distances.in_cells(pose), laser.angles, far, measured)
    measured *= cell
    measured[~(measured >= laser.range_min)] = np.nan
    ranges = measured.astype(np.float32)
    ranges.flags.writeable = False
    return ranges


def scans_of(distances: DistanceMap) -> Iterator[tuple[Scan, Pose2]]:
    """The scans of a virtual drive, with their poses in the map's frame."""
    for number, (x, y) in enumerate(stations(distances).tolist()):
        pose = Pose2(x, y, 0.0)
        ranges = ranges_at(distances, pose)
        if np.isfinite(ranges).any():
            yield Scan(VIRTUAL_SCAN_PERIOD * number, ranges, VIRTUAL_LASER), pose


def build(slam: Localizes, distances: DistanceMap) -> Pose2:
    """Build the map of a new algorithm from a distance map, and freeze it.

    Returns the algorithm's frame in the map's frame.

    Raises:
        ValueError: no wall is visible from any position in the map.
    """
    origin: Pose2 | None = None
    for scan, pose in scans_of(distances):
        origin = origin or pose
        slam.insert_at(scan, origin.between(pose))
    if origin is None:
        raise ValueError("no wall is visible from any free position in the map")
    slam.frozen = True
    return origin
