"""A virtual drive: an algorithm's own map of an occupancy grid, from scans the grid would give.

Every algorithm keeps a map of its own kind. Instead of converting grids into each, a laser is set
in free places that together see the whole map; what it would measure there, by ray casting, is
given to the algorithm with its known pose. The drive's frame has its origin at the first place, for
maps that grow around the start.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from slams.localize.distance_kernels import measure
from slams.localize.distance_map import DistanceMap
from slams.localize.hooks import Localizes
from slams.types import Floats, Laser, Pose2, Ranges, Scan

PITCH = 1.0  # m between two places: each wall is seen from several sides
CLEARANCE = 0.3  # m from any wall; in narrower rooms less
NARROW = 0.1
PERIOD = 1.0  # s between two scans; who thinks of speed sees a slow robot
N_BEAMS = 1440
NEAREST, FARTHEST = 0.05, 30.0  # m
AROUND = Laser(-math.pi, 2.0 * math.pi / N_BEAMS, N_BEAMS, NEAREST, FARTHEST)


def stations(distances: DistanceMap) -> Floats:
    """Places (n, 2) [m] in the map's frame that together see its free space, in a way to drive.

    In every square of `PITCH` the free cell with most room around it, if it has any.
    """
    room = distances.gap * distances.resolution
    cells = max(1, round(PITCH / distances.resolution))
    found = []
    for row, y0 in enumerate(range(0, room.shape[0], cells)):
        columns = range(0, room.shape[1], cells)
        for x0 in columns if row % 2 == 0 else reversed(columns):
            part = np.minimum(room[y0 : y0 + cells, x0 : x0 + cells], CLEARANCE)
            if part.max() >= NARROW:
                iy, ix = _most_central(part)
                found.append((x0 + ix + 0.5, y0 + iy + 0.5))
    return np.array(found).reshape(-1, 2) * distances.resolution + distances.origin


def _most_central(room: Floats) -> tuple[float, float]:
    """Of the cells with most room the one nearest to the middle of a square."""
    iy, ix = np.nonzero(room == room.max())
    middle = 0.5 * np.array(room.shape)
    best = int(np.argmin((iy + 0.5 - middle[0]) ** 2 + (ix + 0.5 - middle[1]) ** 2))
    return float(iy[best]), float(ix[best])


def ranges_at(distances: DistanceMap, pose: Pose2, laser: Laser = AROUND) -> Ranges:
    """What a laser at `pose` (the laser's own) measures in a map (n_beams,) [m].

    nan where the map does not know what is there, or nothing is in reach.
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
    """The scans of a virtual drive and the poses (in the map's frame) that they are taken at."""
    for number, (x, y) in enumerate(stations(distances).tolist()):
        pose = Pose2(x, y, 0.0)
        ranges = ranges_at(distances, pose)
        if np.isfinite(ranges).any():
            yield Scan(PERIOD * number, ranges, AROUND), pose


def build(slam: Localizes, distances: DistanceMap) -> Pose2:
    """Let an algorithm that has seen nothing yet make its own map of a distance map; freeze it.

    Returns the drive's frame: where the algorithm's origin is in the map's.

    Raises:
        ValueError: no wall can be seen from any place of the map.
    """
    origin: Pose2 | None = None
    for scan, pose in scans_of(distances):
        origin = origin or pose
        slam.insert_at(scan, origin.between(pose))
    if origin is None:
        raise ValueError("no wall can be seen from any free place of the map")
    slam.frozen = True
    return origin
