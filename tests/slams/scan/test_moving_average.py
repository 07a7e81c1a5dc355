"""A mean that forgets in seconds."""

import math

import pytest

from slams.scan.moving_average import MovingAverage


def learned(values, rate, seconds=2.0):
    average = MovingAverage(seconds, 7.0)
    for k, value in enumerate(values):
        average.learn(value, k / rate)
    return average.value


def test_of_the_first_scans_it_is_the_plain_mean():
    assert MovingAverage(2.0, 7.0).value == 7.0
    assert learned([1.0], 10) == 1.0
    assert learned([1.0, 2.0, 6.0], 10) == pytest.approx(3.0)


@pytest.mark.parametrize("rate", [10, 40])
def test_at_any_rate_a_second_is_forgotten_as_fast(rate):
    values = [0.0] * 20 * rate + [1.0] * rate
    assert learned(values, rate) == pytest.approx(1.0 - math.exp(-0.5), rel=0.02)


def test_what_a_few_scans_say_is_not_usual_however_rare_they_are():
    scans = [0.0] * 100 + [1.0] * 3
    assert learned(scans, 0.5) == pytest.approx(learned(scans, 10), abs=1e-3)


def test_a_scan_that_is_looked_at_twice_counts_once():
    average = MovingAverage(2.0)
    for value, t in ((1.0, 0.0), (5.0, 0.0), (3.0, 0.1), (9.0, 0.1)):
        average.learn(value, t)
    assert average.value == pytest.approx(2.0)


def test_a_clock_that_goes_back_is_no_end_of_learning():
    average = MovingAverage(1.0)
    for t in (100.0, 101.0, *range(3, 40)):
        average.learn(0.0 if t > 50.0 else 1.0, t)
    assert average.value > 0.9


def test_what_was_just_looked_at_is_fresh_unless_the_clock_went_back():
    average = MovingAverage(1.0)
    assert not average.is_fresh(3.0)
    average.learn(1.0, 3.0)
    assert [average.is_fresh(t) for t in (3.0, 3.05, 3.1, 2.9)] == [True, True, False, False]
