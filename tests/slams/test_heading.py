"""The heading from yaw rates, reading by reading."""

import math

import pytest

from slams.heading import LONGEST_GAP, Heading


def pushed(*readings):
    heading = Heading()
    for t, rate in readings:
        heading.push(t, rate)
    return heading


def test_the_heading_is_the_area_under_the_rates():
    heading = pushed((0.0, 0.0), (0.1, 1.0), (0.3, 0.0))
    assert heading.at(0.3) == pytest.approx(0.05 + 0.1)
    assert pushed((0.0, 0.0), (0.1, 1.0)).at(0.2) == pytest.approx(0.05 + 0.1)  # goes on


def test_a_gap_is_not_bridged():
    far = LONGEST_GAP + 0.1
    heading = pushed((0.0, 1.0), (far, 1.0))
    assert heading.at(far) == 0.0
    assert heading.at(far + 1.01 * LONGEST_GAP) is None
    assert Heading().at(0.0) is None


def test_a_reading_that_comes_late_is_left_out_and_a_clock_set_back_is_followed():
    heading = pushed((1.0, 1.0), (1.1, 1.0), (0.9, 5.0))
    assert heading.at(1.2) == pytest.approx(0.2)
    heading.push(0.1, 0.5)
    assert heading.at(0.3) == pytest.approx(0.2)


@pytest.mark.parametrize(("t", "rate"), [(math.nan, 0.0), (1.2, math.nan), (1e300, 0.0)])
def test_what_cannot_be_is_left_out(t, rate):
    heading = pushed((1.0, 1.0), (1.1, 1.0), (t, rate))
    assert heading.at(1.2) == pytest.approx(0.2)
