"""Fields, scans and parameters that several tests of tsd use."""

from functools import partial

import numpy as np

from slams.scan.end_points import MIN_GAP_THRESHOLD
from slams.scan.scan_kernels import end_points, scan_moments
from slams.types import IDENTITY
from tests.rooms import box, drive, driven, made
from tsd import TsdParams
from tsd.map import TileField
from tsd.map_kernels import layer_of, read_field
from tsd.scan_kernels import Beams, SurfaceRule

BOX = np.array(box(-3.0, -2.0, 2.5, 2.2))
PLANE = np.array([(-50.0, 2.0, 50.0, 2.0)])
CORNER = np.array([(-3.0, 2.0, 3.0, 2.0), (3.0, 2.0, 3.0, -2.0), (3.0, -2.0, -3.0, -2.0)])


default = partial(made, "tsd")
original = partial(made, "tsd@original", map_size=9)


def field_of(**changes):
    return TileField(TsdParams().replace(**changes))


def field_at(slam, x, y, normal):
    return read_field(slam._map.kernel, layer_of(*normal), x, y)


def scanned(n=10, **changes):
    """A default after a drive, and the elements of the last scan."""
    slam = driven("tsd", drive(n=n), **changes)
    view = slam._scan
    return slam, view.elements[: view.count].copy()


def read(ranges, lidar):
    """End points (4, n) and moments (6, n + 1) of a standing laser."""
    points, moments = np.zeros((4, lidar.n_beams)), np.zeros((6, lidar.n_beams + 1))
    count, _ = end_points(ranges, lidar.directions, IDENTITY, (0.1, 30.0), 0.0, points)
    scan_moments(points, count, IDENTITY, lidar.angle_increment, MIN_GAP_THRESHOLD, moments)
    return Beams(0.0, 0.0, lidar.angle_increment), points, count, moments


def sums_of(points):
    """Moments (6, n + 1) of points (n, 2)."""
    moments = np.zeros((6, len(points) + 1))
    scan_moments(
        np.ascontiguousarray(np.transpose(points)), len(points), IDENTITY, 0.01, 9.0, moments
    )
    return moments


RULE = SurfaceRule(0.12, 0.01, 8.0, 0.02**2, 0.2, 0.15, False)
PILLARS = [(-6.0, 0.7), (2.1, -1.0), (7.5, 0.7)]
