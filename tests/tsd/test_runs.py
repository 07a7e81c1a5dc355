"""Surfaces that go on where beams are far apart."""

import math

import numpy as np

from tests.tsd.cases import RULE
from tsd.scan_kernels import Beams, find_runs, fit_best_line, fit_line, sum_moments

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


def test_a_window_beside_is_taken_only_if_it_is_twice_as_smooth():
    rng, reach, k, beside = np.random.default_rng(0), 4, 10, []
    for _ in range(200):
        hits = np.zeros((21, 4))
        hits[:, 0], hits[:, 1] = 0.05 * np.arange(21), rng.normal(0.0, 0.01, 21)
        sums = np.zeros((22, 5))
        sum_moments(hits, 21, sums)
        around = fit_line(sums, k - reach, k + reach + 1)
        before, after = fit_line(sums, k - 2 * reach, k + 1), fit_line(sums, k, k + 2 * reach + 1)
        best, limit = around, 0.5 * around[4]
        for side in (before, after):
            if side[4] < limit:
                best, limit = side, side[4]
        found = fit_best_line(sums, k, reach, 0, 21, 0.0)
        assert found == best
        assert fit_best_line(sums, k, reach, 0, 21, 1.001 * around[4]) == around
        beside.append(best is not around)
    assert 5 < sum(beside) < 100
