import math

import pytest

from bench.run.comparing import spread_over_starts, start_scans


def test_starts_are_even_over_a_tenth_of_the_log():
    assert start_scans(5505, 19)[:2] == [0, 28] and start_scans(5505, 19)[-1] == 500
    assert start_scans(1000, 5) == [0, 25, 50, 75, 100]
    assert start_scans(1000, 1) == [0]
    assert start_scans(25, 10) == [0, 1, 2], "a short log has no more"
    assert start_scans(1, 3) == [0]


def test_starts_by_hand():
    found = spread_over_starts([0.02, 0.05, 0.01, 0.04], 0.03)
    assert (found["n"], found["above"]) == (4, 2)
    assert (found["mean"], found["median"], found["worst"]) == pytest.approx((0.03, 0.03, 0.05))


def test_a_lost_run_is_as_bad_as_can_be():
    found = spread_over_starts([0.02, None, 0.04], 0.1)
    assert (found["above"], found["worst"]) == (1, math.inf)
    assert (found["mean"], found["median"]) == pytest.approx((0.03, 0.04))
    half = spread_over_starts([0.02, None], 0.1)
    assert half["median"] == math.inf
    none = spread_over_starts([None, None], 0.1)
    assert math.isnan(none["mean"]) and none["median"] == math.inf
