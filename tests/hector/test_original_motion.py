"""The prediction from stamps, odometry and gyro."""

import numpy as np
import pytest

from hector.original.motion import Motion
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import laser


def stamped(t, odometry=None, yaw=None):
    return Scan(t, np.zeros(1, np.float32), laser(1), odometry, yaw)


def test_prediction_by_velocity_odometry_gyro_or_not_at_all():
    for source, odometry, yaw, expected in (
        ("last", None, None, (1.0, 0.0, 0.0)),
        ("velocity", None, None, (2.0, 0.0, 0.0)),
        ("velocity", 1, None, (2.0, 0.0, 0.0)),
        ("auto", 1, None, (1.0, 0.5, 0.2)),
        ("velocity", None, 0.3, (2.0, 0.0, 0.3)),
    ):
        motion = Motion(source)
        frames = [Pose2(5.0, 5.0, 0.0), Pose2(6.0, 5.0, 0.0), Pose2(6.0, 5.5, 0.2)]
        yaws = [0.0, 0.0, yaw]
        pose = IDENTITY
        for k in range(2):
            scan = stamped(0.1 * k, odometry and frames[k], yaw and yaws[k])
            assert motion.predict(pose, scan) is not None
            pose = Pose2(float(k), 0.0, 0.0)
            motion.moved(pose, scan)
        scan = stamped(0.2, odometry and frames[2], yaw and yaws[2])
        assert motion.predict(pose, scan) == pytest.approx(expected)
        used = (2 if source == "auto" else 0, 2 if yaw else 0)
        assert (motion.odometry, motion.gyro) == used


def test_prediction_scales_with_the_interval_until_stamps_prove_ragged():
    motion, pose = Motion("auto"), IDENTITY
    for k, t in enumerate((0.0, 0.1, 0.2)):
        motion.predict(pose, stamped(t))
        pose = Pose2(0.1 * k, 0.0, 0.0)
        motion.moved(pose, stamped(t))
    assert motion.predict(pose, stamped(0.4)).x == pytest.approx(0.4)
    motion, pose = Motion("auto"), IDENTITY
    t = 0.0
    for k in range(30):
        t += 0.05 if k % 2 else 0.35
        motion.predict(pose, stamped(t))
        pose = Pose2(0.1 * k, 0.0, 0.0)
        motion.moved(pose, stamped(t))
    assert motion.predict(pose, stamped(t + 0.35)).x == pytest.approx(pose.x + 0.1)
