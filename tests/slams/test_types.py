import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slams.types import IDENTITY, Laser, Pose2, Scan, wrap_angle
from tests.rooms import laser

number = st.floats(-50.0, 50.0)
poses = st.builds(Pose2, number, number, st.floats(-math.pi, math.pi))


def close(a, b):
    turn = wrap_angle(a.theta - b.theta)
    return math.hypot(a.x - b.x, a.y - b.y) < 1e-9 and abs(turn) < 1e-9


@given(poses, poses, poses)
def test_composition_is_associative(a, b, c):
    assert close((a @ b) @ c, a @ (b @ c))


@given(poses)
def test_inverse_undoes(a):
    assert close(a @ a.inverse(), IDENTITY)
    assert close(a.inverse() @ a, IDENTITY)


@given(poses, poses)
def test_between_is_the_step_to_the_other(a, b):
    assert close(a @ a.between(b), b)
    assert close(a.between(b), a.inverse() @ b)


def test_composition_by_hand():
    assert close(
        Pose2(1.0, 2.0, math.pi / 2) @ Pose2(3.0, 0.0, 0.1), Pose2(1.0, 5.0, math.pi / 2 + 0.1)
    )


def test_transform_moves_points_like_poses():
    pose = Pose2(1.0, -2.0, 0.7)
    moved = pose.transform(np.array([[3.0, 4.0]]))[0]
    expected = pose @ Pose2(3.0, 4.0, 0.0)
    assert moved == pytest.approx([expected.x, expected.y])


def test_poses_do_not_add():
    with pytest.raises(TypeError, match="compose with @"):
        IDENTITY + IDENTITY


@given(st.floats(-1000.0, 1000.0))
def test_wrap_angle_stays_in_range_and_keeps_the_direction(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi + 1e-12
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


def test_wrap_angle_of_arrays_and_the_open_end():
    assert wrap_angle(np.array([-math.pi, math.pi, 3.0 * math.pi])) == pytest.approx(math.pi)
    assert wrap_angle(-math.pi) == math.pi


def test_laser_angles():
    laser = Laser(-1.0, 0.5, 5, 0.1, 30.0)
    assert laser.angles == pytest.approx([-1.0, -0.5, 0.0, 0.5, 1.0])
    assert laser.directions[3] == pytest.approx([math.cos(0.5), math.sin(0.5)])


def test_odometry_and_heading_that_are_no_numbers_were_not_measured():
    lidar, ranges = laser(5), np.ones(5, np.float32)
    for bad in (np.nan, np.inf, -np.inf):
        for k in range(3):
            pose = Pose2(*(bad if i == k else 1.0 for i in range(3)))
            scan = Scan(0.0, ranges, lidar, pose, bad)
            assert scan.odometry is None
            assert scan.yaw is None
    scan = Scan(0.0, ranges, lidar, Pose2(1.0, 2.0, 3.0), 0.5)
    assert (scan.odometry, scan.yaw) == (Pose2(1.0, 2.0, 3.0), 0.5)
