"""Conflicts: beams that end where the map is free."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import ALGORITHMS, box, cast, laser, made

HALL = np.array(box(-14.0, -14.0, 14.0, 14.0))
SPARSE = laser(181, math.pi)


def read(slam, share):
    """A scan of the hall as the slam takes it, ranges times `share`."""
    return slam._scan.read(Scan(0.0, share * cast(HALL, IDENTITY, SPARSE), SPARSE), IDENTITY)


@pytest.mark.parametrize("name", ["hector", "tsd", "crsm"])
def test_one_scan_makes_no_cell_free_and_three_do(name):
    slam = made(name)
    for number in (1, 2, 3):
        slam._map.insert(read(slam, 1.0), IDENTITY)
        inliers, conflicts = slam._map.evaluate(read(slam, 0.7), IDENTITY)
        assert inliers < 0.01
        assert conflicts > 0.7 if number == 3 else conflicts < 0.2
    inliers, conflicts = slam._map.evaluate(read(slam, 1.0), IDENTITY)
    assert inliers > 0.8 and conflicts < 0.02


@pytest.mark.parametrize(
    ("name", "ends"),
    [("hector", 181), ("tsd", 181), ("crsm", 181), ("hector@paper", 0), ("tsd@paper", 0)],
)
def test_ends_count_as_far_as_the_laser_reaches(name, ends):
    """A wall 50 m off is matched by: on a campus there is nothing nearer. The papers' end at 30."""
    slam = made(name)
    far = replace(SPARSE, range_max=80.0)
    ranges = cast(np.array(box(-50.0, -50.0, 50.0, 50.0)), IDENTITY, far)
    assert slam._scan.read(Scan(0.0, ranges, far), IDENTITY).n == ends


def test_a_rough_surface_whose_normals_are_not_those_of_the_map_is_no_conflict():
    slam = made("tsd")
    for _ in range(3):
        slam._map.insert(read(slam, 1.0), IDENTITY)
    scan = read(slam, 1.0)
    x, y = scan.elements[: scan.count, 2:4].copy().T
    c, s = math.cos(0.9), math.sin(0.9)
    scan.elements[: scan.count, 2], scan.elements[: scan.count, 3] = c * x - s * y, s * x + c * y
    assert slam._map.evaluate(scan, IDENTITY)[0] > 0.8


@pytest.mark.parametrize("name", ALGORITHMS)
@pytest.mark.parametrize(("beams", "counted"), [(5, 0), (20, 3)])
def test_scans_with_many_ends_where_the_map_is_free_are_counted(name, beams, counted):
    slam = made(name)
    for k in range(43):
        seen = cast(HALL, Pose2(0.1 * k, 0.0, 0.0), SPARSE)
        if k >= 40:
            first = 40 * (k - 39)
            seen[first : first + beams] *= 0.6  # of 181: somebody walks by
        slam.update(Scan(0.1 * k, seen, SPARSE))
    assert slam.report()["in_conflict"] == counted
