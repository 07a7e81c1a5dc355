"""What an algorithm says of its errors is so: neither ten times too sure, nor a tenth."""

from functools import cache

import numpy as np
import pytest

from tests.honesty import NAMES, drive, normalized


@cache
def drives(odometry):
    return [drive(seed, odometry) for seed in range(4)]


@pytest.mark.parametrize("odometry", [True, False])
@pytest.mark.parametrize("name", NAMES)
def test_the_covariance_of_a_pose_is_honest(name, odometry):
    """Measured over 4 drives: 0.5 to 0.8, and 1.3 to 2.6 in the first pose's frame."""
    fitted, first = np.mean([normalized(name, log) for log in drives(odometry)], axis=0)
    assert 0.4 < fitted < 1.5
    assert 0.5 < first < 2.9
