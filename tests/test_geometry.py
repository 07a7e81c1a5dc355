import math

import pytest

from slams.geometry import wrap_angle
from slams.types import wrap_angle as plain


@pytest.mark.parametrize("angle", [0.0, 1.0, -1.0, math.pi, -math.pi, 4.0, -4.0, 100.0, -100.5])
def test_compiled_wrap_angle_equals_the_plain_one(angle):
    assert wrap_angle(angle) == plain(angle)
