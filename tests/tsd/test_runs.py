"""Surfaces that go on where beams are far apart."""

import numpy as np

from tests.rooms import ROOM, cast, laser
from tests.tsd import naive
from tests.tsd.cases import RULE, read
from tsd.scan_kernels import Beams, find_runs

BEAMS = Beams(0.0, 0.0, 0.01)


def firsts_of(points, n, beams):
    firsts = np.zeros(n + 1)
    find_runs(points, n, beams, RULE, firsts)
    return firsts[:n].tolist()


def firsts(points):
    numbered = [(x, y, k) for k, (x, y) in enumerate(points)]
    return firsts_of(np.ascontiguousarray(np.transpose(numbered)), len(points), BEAMS)


def test_surfaces_equal_the_naive_twin():
    lidar = laser(361)
    ranges = cast(ROOM, (0.3, -0.2, 0.5), lidar).copy()
    ranges[100:106] = np.inf
    ranges[200] = np.inf
    beams, points, n, _ = read(ranges, lidar)
    xy, beam = points[:2, :n].T, points[2, :n]
    twin = naive.runs_of(xy, np.hypot(*xy.T), beam, lidar.angle_increment, 8.0, 0.01)
    assert firsts_of(points, n, beams) == [float(first) for first, _ in twin]
    assert len({first for first, _ in twin}) > 3


def test_a_wall_that_is_seen_aslant_goes_on_from_its_first_hit_and_to_its_last():
    wall, before, behind = [(5.0, 1.0), (7.0, 1.0), (11.0, 1.0)], (3.0, 2.0), (4.0, 9.0)
    assert firsts([before, *wall]) == [0, 1, 1, 1]
    assert firsts([*wall, behind]) == [0, 0, 0, 3]


def test_hits_far_apart_that_are_not_in_line_are_no_surface():
    assert firsts([(5.0, 1.0), (7.0, 1.5), (11.0, 1.0)]) == [0, 1, 2]
