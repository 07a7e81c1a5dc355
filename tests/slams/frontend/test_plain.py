"""PlainEstimator: where a paper's match starts."""

import math

import pytest

from slams.frontend.params import FrontendParams
from slams.frontend.plain import PlainEstimator
from slams.types import Pose2
from tests.slams.frontend.test_filter import scan


def test_the_start_is_the_last_pose_moved_by_the_wheels():
    estimator = PlainEstimator(FrontendParams())
    estimator.predict(scan(0.0, Pose2(5.0, 0.0, math.pi / 2)))
    prior = estimator.predict(scan(0.2, Pose2(5.0, 0.3, math.pi / 2 + 0.1)))
    assert prior.pose == pytest.approx((0.3, 0.0, 0.1))
    assert not prior.information.any()


@pytest.mark.parametrize("wrong", [Pose2(0.1, 0.0, 1.5), Pose2(-40.0, 0.0, 0.0)])
def test_wheels_that_jump_are_not_followed(wrong):
    """The driver began anew, or a message is broken: the last step is made once more."""
    estimator = PlainEstimator(FrontendParams(), motion_model=True)
    estimator.predict(scan(0.0, Pose2(0.0, 0.0, 0.0)))
    before = estimator.predict(scan(0.2, Pose2(0.1, 0.0, 0.0)))
    after = estimator.predict(scan(0.4, Pose2(0.1, 0.0, 0.0) @ wrong))
    assert after.pose == pytest.approx((0.2, 0.0, 0.0))
    assert after.information[2, 2] < before.information[2, 2]
    assert estimator.counts["odometry"] == 1


def test_stamps_that_jitter_make_no_jump_of_a_step():
    estimator = PlainEstimator(FrontendParams())
    estimator.predict(scan(0.0, Pose2(0.0, 0.0, 0.0)))
    prior = estimator.predict(scan(0.01, Pose2(0.3, 0.0, 0.0)))
    assert prior.pose == pytest.approx((0.3, 0.0, 0.0))
