"""Surfaces that go on where beams are far apart."""

import math

import numpy as np

from tests.tsd.cases import RULE
from tsd.scan_kernels import Beams, find_runs

BEAMS = Beams(0.0, 0.0, 0.01)


def runs_of(points):
    hits = np.array([(x, y, math.hypot(x, y), k) for k, (x, y) in enumerate(points)])
    runs = np.zeros((len(hits), 2))
    find_runs(hits, len(hits), BEAMS, RULE, runs)
    return [(int(first), int(last)) for first, last in runs]


def test_a_wall_that_is_seen_aslant_goes_on_from_its_first_hit_and_to_its_last():
    wall, before, behind = [(5.0, 1.0), (7.0, 1.0), (11.0, 1.0)], (3.0, 2.0), (4.0, 9.0)
    assert runs_of([before, *wall]) == [(0, 1), *3 * [(1, 4)]]
    assert runs_of([*wall, behind]) == [*3 * [(0, 3)], (3, 4)]


def test_hits_far_apart_that_are_not_in_line_are_no_surface():
    assert runs_of([(5.0, 1.0), (7.0, 1.5), (11.0, 1.0)]) == [(0, 1), (1, 2), (2, 3)]
