"""What several tests of tsd look at."""

import math
from functools import partial

import numpy as np

from slams.scan.scan_kernels import Limits, end_points
from slams.types import IDENTITY, Pose2
from tests.rooms import drive, made
from tsd import TsdParams
from tsd.map import TileField
from tsd.map_kernels import facing, read_field
from tsd.scan_kernels import Beams, SurfaceRule
from tsd.scan_kernels import hits_of as hits_of_points

PLANE = np.array([(-50.0, 2.0, 50.0, 2.0)])
CORNER = np.array([(-3.0, 2.0, 3.0, 2.0), (3.0, 2.0, 3.0, -2.0), (3.0, -2.0, -3.0, -2.0)])


default = partial(made, "tsd")
original = partial(made, "tsd@original", map_size=9)


def error(a, b):
    step = Pose2(*a).between(Pose2(*b))
    return math.hypot(step.x, step.y), abs(step.theta)


def field_of(**changes):
    return TileField(TsdParams().replace(**changes))


def field_at(slam, x, y, normal):
    return read_field(slam._map.kernel, facing(*normal), x, y)


def occupied(slam, x, y):
    grid = slam.map()
    ix = int((x - grid.origin[0]) / grid.resolution)
    iy = int((y - grid.origin[1]) / grid.resolution)
    return bool(np.nanmax(grid.p[iy - 1 : iy + 2, ix - 1 : ix + 2]) > 0.5)


def scanned(n=10, **changes):
    """A default that has seen a drive, and the last scan's elements."""
    slam = default(**changes)
    for scan in drive(n=n):
        slam.update(scan)
    view = slam._scan
    return slam, view.elements[: view.count].copy()


def hits_of(ranges, lidar):
    """Hits (n, 4) of a standing laser."""
    beams = Beams(0.0, 0.0, lidar.angle_increment)
    points, hits = np.zeros((3, lidar.n_beams)), np.zeros((lidar.n_beams, 4))
    count, _ = end_points(ranges, lidar.directions, IDENTITY, Limits(0.1, 30.0), points)
    hits_of_points(points, count, beams, hits)
    return beams, hits, count


RULE = SurfaceRule(0.12, 0.01, 8.0, 0.02**2, 0.2, 0.15, False)
PILLARS = [(-6.0, 0.7), (2.1, -1.0), (7.5, 0.7)]
