"""The motion filter: against naive twins, against finite differences, and with any input."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slams.frontend import filter_kernels as kernels
from slams.frontend import update_kernels
from slams.frontend.degeneracy import FULLY_OBSERVED, Observability
from slams.frontend.filter_kernels import GYRO, MIN_MATCH_STD, STAMP_STD
from slams.frontend.motion_filter import ACCELERATION_DENSITY as DENSITY
from slams.frontend.motion_filter import HANDHELD_LATERAL_DENSITY, MotionFilter
from slams.frontend.params import FrontendParams
from slams.types import IDENTITY, Laser, Pose2, Scan

LASER = Laser(-1.0, 0.1, 21, 0.1, 30.0)
ROTATING = Laser(-1.0, 0.1, 21, 0.1, 30.0, time_increment=0.01)
RANGES = np.ones(21, np.float32)
SHARP = np.diag((4e5, 4e5, 4e6))  # 1/m^2, 1/rad^2: a good match of all directions


def scan(t, odometry=None, yaw=None):
    return Scan(t, RANGES, LASER, odometry, yaw)


def state(rng):
    z = rng.normal(0.0, 0.3, kernels.N)
    A = rng.normal(0.0, 0.2, (kernels.N, kernels.N))
    return z, A @ A.T + 0.01 * np.eye(kernels.N)


def is_covariance(P):
    """Positive definite, whatever the units: by the correlations."""
    scale = 1.0 / np.sqrt(np.diag(P))
    correlation = P * scale[:, None] * scale
    return bool(np.isfinite(P).all() and np.linalg.eigvalsh(correlation).min() > -1e-13)


def test_one_reading_is_fused_as_the_textbook_does():
    rng = np.random.default_rng(1)
    z, P = state(rng)
    H = rng.normal(0.0, 1.0, kernels.N)
    K = P @ H / (H @ P @ H + 0.04)
    expected_z, expected_P = z + 0.1 * K, P - np.outer(K, H @ P)
    kernels.fuse(z, P, H, 0.1, 0.04, np.empty((2, kernels.N)))
    np.testing.assert_allclose(z, expected_z, atol=1e-12)
    np.testing.assert_allclose(P, expected_P, atol=1e-12)


@pytest.mark.parametrize(("row", "axis"), [(0, 0), (1, 1), (2, 2), (GYRO, 2)])
def test_a_reading_far_off_leaves_the_mixture_of_both_along_its_axis(row, axis):
    _, start = state(np.random.default_rng(2))
    step, twist, variance = kernels.STEP + axis, kernels.TWIST + axis, 0.01
    buffer, readings = np.zeros((3, kernels.N)), np.zeros((4, 7))
    buffer[2, step] = 1.0
    for residual in (0.02, 3.0):
        P, z = start.copy(), np.zeros(kernels.N)
        readings[row, kernels.USED_VARIANCE] = variance
        kernels.inflate(P, row, residual**2, readings, buffer)
        others = [k for k in range(kernels.N) if k not in (step, twist)]
        np.testing.assert_array_equal(P[others], start[others])
        rest = [Q[twist, twist] - Q[twist, step] ** 2 / Q[step, step] for Q in (start, P)]
        assert rest[1] == pytest.approx(rest[0]), "a match of the step decides about the twist"
        kernels.fuse(z, P, buffer[2], residual, readings[row, kernels.USED_VARIANCE], buffer)
        gain = start[step, step] / (start[step, step] + variance)
        apart = residual if residual > 1.0 else 0.0
        assert z[step] == pytest.approx(gain * residual)
        assert P[step, step] == pytest.approx((1.0 - gain) * (start[step, step] + gain * apart**2))


@pytest.mark.parametrize("theta", [0.0, 2.0, -3.1])
def test_composition_moves_the_covariance_by_its_derivatives(theta):
    z, P = state(np.random.default_rng(3))
    z[2] = theta

    def _composed(at):
        moved, unused = at.copy(), P.copy()
        kernels.compose(moved, unused)
        return moved

    eps = 1e-6
    J = np.empty((kernels.N, kernels.N))
    for k in range(kernels.N):
        d = np.zeros(kernels.N)
        d[k] = eps
        off = _composed(z + d) - _composed(z - d)
        off[2] = math.remainder(off[2], 2.0 * math.pi)
        J[:, k] = off / (2.0 * eps)
    found = P.copy()
    kernels.compose(z.copy(), found)
    np.testing.assert_allclose(found, J @ P @ J.T, atol=1e-7)


def test_propagation_is_white_acceleration_for_short_times():
    z, P = np.zeros(kernels.N), np.zeros((kernels.N, kernels.N))
    z[kernels.TWIST] = 0.5
    kernels.propagate(z, P, 0.1, np.array((0.3, 0.3, 0.3)), np.full(3, 1e3))
    assert z[3] == pytest.approx(0.05, rel=1e-3)
    np.testing.assert_allclose(P[3, 3], 0.3 * 0.1**3 / 3.0, rtol=1e-3)
    np.testing.assert_allclose(P[3, 6], 0.3 * 0.1**2 / 2.0, rtol=1e-3)
    np.testing.assert_allclose(P[6, 6], 0.3 * 0.1, rtol=1e-3)
    assert P[kernels.BIAS, kernels.BIAS] == pytest.approx(kernels.GYRO_BIAS_WALK**2 * 0.1)


def test_conditioning_on_a_pose_is_that_of_a_gaussian():
    z, P = state(np.random.default_rng(4))
    information = np.diag((50.0, 80.0, 120.0))
    H = np.eye(3, kernels.N)
    R = np.linalg.inv(information)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    off = np.array((0.05, -0.03, 0.02))
    expected = z + K @ off
    posterior = np.linalg.inv(information + np.linalg.inv(P[:3, :3]))
    found, covariance = z.copy(), P.copy()
    update_kernels.condition(found, covariance, expected[:3].copy(), posterior)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_allclose(covariance, P - K @ H @ P, atol=1e-9)


def test_a_degenerate_direction_is_decoupled_from_the_other():
    z, P = state(np.random.default_rng(5))
    z[2] = 0.7
    u = np.array((math.cos(0.3), math.sin(0.3)))
    update_kernels.decouple(z, P, u, 0.0)
    across = np.array((-u[1], u[0]))
    assert abs(u @ P[:2, :2] @ across) < 1e-12
    assert is_covariance(P)


def drive(motion, scans):
    """Feed scans; each is matched at its true pose."""
    for one, pose in scans:
        motion.predict(one)
        motion.update(pose, SHARP, FULLY_OBSERVED)


def test_a_constant_twist_is_learned():
    motion, pose, step = MotionFilter(FrontendParams()), IDENTITY, Pose2(0.05, 0.0, 0.02)
    for k in range(40):
        prior = motion.predict(scan(0.1 * k))
        motion.update(pose, SHARP, FULLY_OBSERVED)
        before, pose = pose, pose @ step
    assert math.hypot(prior.pose.x - before.x, prior.pose.y - before.y) < 5e-4
    assert prior.twist[::2] == pytest.approx((0.5, 0.2), abs=0.01)


def test_only_the_lateral_acceleration_of_a_laser_without_wheels_is_that_of_a_hand():
    held, driven = MotionFilter(FrontendParams()), MotionFilter(FrontendParams())
    held.predict(scan(0.0))
    driven.predict(scan(0.0, IDENTITY))
    lateral = [HANDHELD_LATERAL_DENSITY if axis == 1 else v for axis, v in enumerate(DENSITY)]
    for motion, expected in ((held, lateral), (driven, DENSITY)):
        np.testing.assert_array_equal(motion._default_density, expected)
        np.testing.assert_array_equal(motion._learned[0, :3], expected)


def test_a_jerk_fades_within_half_a_second():
    motion, still = MotionFilter(FrontendParams()), IDENTITY
    drive(motion, ((scan(0.1 * k), still) for k in range(20)))
    drive(motion, [(scan(2.0), Pose2(0.0, 0.0, 0.2))])
    drive(motion, ((scan(2.1 + 0.1 * k), still) for k in range(5)))
    assert abs(motion.prediction().twist.theta) < 0.05


def test_wheels_that_stall_lose_their_weight():
    trusted, stalled = MotionFilter(FrontendParams()), MotionFilter(FrontendParams())
    step, still = Pose2(0.05, 0.0, 0.0), Pose2(0.0, 0.0, 0.0)
    for motion, slip in ((trusted, step), (stalled, still)):
        pose = wheels = still
        for k in range(30):
            prior = motion.predict(scan(0.1 * k, wheels))
            motion.update(pose, SHARP, FULLY_OBSERVED)
            before, pose = pose, pose @ step
            wheels = wheels @ (slip if k > 10 else step)
        off = abs(prior.pose.x - before.x)
        assert off < (1e-3 if motion is trusted else 0.05)
    assert stalled.covariance[0, 0] > 0.0
    assert stalled._learned[1, 0] > 10.0 * trusted._learned[1, 0]


@pytest.mark.parametrize(("axis", "step"), [(0, Pose2(0.05, 0.0, 0.0)), (2, Pose2(0.0, 0.0, 0.1))])
def test_wheels_that_stop_at_once_have_the_noise_of_the_predicted_step(axis, step):
    motion, pose, variances = MotionFilter(FrontendParams()), IDENTITY, []
    for k in range(40):
        pose = pose @ step if k < 10 else pose
        motion.predict(scan(0.1 * k, pose))
        stamp = (STAMP_STD * motion._readings[axis, kernels.RATE_CHANGE]) ** 2
        variances.append(motion._readings[axis, kernels.VARIANCE] - stamp)
        motion.update(pose, SHARP, FULLY_OBSERVED)
    moving, stopping, still = variances[9], variances[10], variances[-1]
    assert stopping > 0.8 * moving
    assert still < 0.1 * moving


def test_wheels_at_a_standstill_do_not_brake_a_robot_in_a_bare_corridor():
    motion, still = MotionFilter(FrontendParams()), Pose2(0.0, 0.0, 0.0)
    pose, step, bare = still, Pose2(0.05, 0.0, 0.0), Observability(1.0, 0.0, 0.0)
    for k in range(60):
        prior = motion.predict(scan(0.1 * k, still))
        motion.update(pose if k < 40 else prior.pose, SHARP, FULLY_OBSERVED if k < 40 else bare)
        pose = pose @ step
    assert not prior.wheels
    assert motion.pose.x == pytest.approx(59 * 0.05, abs=0.05)


def test_a_gyro_that_is_stuck_is_faulty():
    motion, used = MotionFilter(FrontendParams()), []
    for k in range(30):
        motion.predict(scan(0.1 * k, yaw=0.0))
        used.append(motion.gyro)
        motion.update(Pose2(0.0, 0.0, 0.1 * k), SHARP, FULLY_OBSERVED)
    assert used[1] and not used[-1]


@pytest.mark.parametrize(("axis", "slip"), [(0, 0.02), (2, 0.04)])
@pytest.mark.parametrize("delay", [0.0, 0.1, 0.2, -0.1])
def test_a_delay_of_the_stamps_is_learned_while_a_robot_accelerates(delay, axis, slip):
    motion, direction = MotionFilter(FrontendParams()), np.eye(3)[axis]
    for k in range(60):
        t = 0.2 * k  # at mid-sweep, where a scan is matched and readings have to be read
        late, pose = (Pose2(*(math.sin(x) * direction)) for x in (t + delay, t))
        motion.predict(Scan(t, RANGES, ROTATING, IDENTITY, 0.0, None, late, late.theta))
        motion.update(pose, SHARP, FULLY_OBSERVED)
    assert motion.delay == pytest.approx(delay, abs=0.02)
    expected = slip**2 * abs(math.sin(t) - math.sin(t - 0.2))  # noise of the scan's motion
    assert motion._readings[axis, kernels.VARIANCE] == pytest.approx(expected, rel=0.1)
    assert motion.gyro and motion.prediction().wheels and (motion._learned[1, GYRO] < 1.5 or delay)


@pytest.mark.parametrize(("seconds", "costs"), [(0.1, False), (1.0, True)])
def test_a_scan_that_was_kept_back_costs_the_wheels_no_weight(seconds, costs):
    motion, step = MotionFilter(FrontendParams()), Pose2(0.05, 0.0, 0.0)
    poses, most = [Pose2(0.0, 0.0, 0.0)], 1.0
    for k in range(30):
        poses.append(poses[-1] @ step)
        motion.predict(scan(seconds * k, poses[-1]))
        motion.update(poses[-4] if k == 20 else poses[-1], SHARP, FULLY_OBSERVED)
        most = max(most, motion._learned[1, 0])
    assert (most > 2.0) == costs  # no recorder keeps a scan back for a second


@pytest.mark.parametrize("wheels", [True, False])
@pytest.mark.parametrize(("axis", "speed"), [(0, 0.5), (2, 0.5), (0, 4.0)])
def test_a_jump_and_the_way_back_leave_twist_and_calibration(axis, speed, wheels):
    motion, direction, twists = MotionFilter(FrontendParams()), np.eye(3)[axis], []
    for k in range(40):
        pose = Pose2(*(0.1 * speed * (k - 10 * (k == 30)) * direction))
        calibration = motion._z[kernels.SCALE :].copy()
        motion.predict(scan(0.1 * k, pose if wheels else None))
        twists.append(motion.twist_at(pose)[axis])
        motion.update(pose, SHARP, FULLY_OBSERVED)
        if k in (30, 31):
            np.testing.assert_allclose(motion._z[kernels.SCALE :], calibration, atol=1e-9)
    assert motion.pose[axis] == pytest.approx(3.9 * speed, abs=1e-3)
    np.testing.assert_allclose(twists[20:], speed, rtol=0.04)


def test_two_lasers_that_scan_at_the_same_moment_make_no_jumps():
    motion, rear = MotionFilter(FrontendParams()), replace(LASER, mount=Pose2(-0.2, 0.0, 3.1))
    for k in range(40):
        t = 0.1 * k
        for lidar, off in ((LASER, 0.004), (rear, -0.004)):  # m, of their mounts
            prior = motion.predict(Scan(t, RANGES, lidar, None, t))
            pose = Pose2(0.5 * t + off, 0.0, math.remainder(t, math.tau))
            motion.update(pose, SHARP, FULLY_OBSERVED)
    assert np.sqrt(np.diag(prior.covariance)).max() < 0.01
    assert prior.twist.theta == pytest.approx(1.0, abs=0.05)


def test_a_jump_of_the_wheels_is_not_delayed_as_their_other_steps_are():
    for change, expected in ((-4.5, -0.4), (-2.0, -0.2)):
        z, P, readings = np.zeros(kernels.N), np.diag([100.0] * 9 + [1e-12] * 5), np.zeros((4, 7))
        z[kernels.DELAY] = 0.1
        readings[0, :4] = 1.0, -0.4, 1e-8, change
        learned = np.concatenate([np.full((1, 4), 1.0), np.ones((1, 4))])
        kernels.predict(z, P, np.zeros((3, 3)), 0.1, learned, np.ones(3), readings)
        assert z[0] == pytest.approx(expected, abs=0.02)


def test_a_map_that_drifts_with_its_matches_constrains_the_gyro_bias_little():
    """Matches within 2 mrad of a map made of them: the walks of map and bias are left after 5 s."""
    motion = MotionFilter(FrontendParams())
    for k in range(51):
        motion.predict(scan(0.1 * k, yaw=0.0))
        assert not motion._map_noise.any()  # once for each match
        motion.update(Pose2(0.0, 0.0, 0.0), np.diag((1e6, 1e6, 0.25e6)), FULLY_OBSERVED)
    assert 1.1e-3 < math.sqrt(motion._P[kernels.BIAS, kernels.BIAS]) < 1.5e-3  # rad/s


def test_what_a_scan_does_not_observe_stays_at_the_prediction():
    motion, still = MotionFilter(FrontendParams()), IDENTITY
    drive(motion, ((scan(0.1 * k), still) for k in range(5)))
    prior = motion.predict(scan(0.5))
    moved = Pose2(prior.pose.x + 0.02, prior.pose.y, 0.0)
    motion.update(moved, SHARP, Observability(1.0, 0.0, 0.0))
    assert abs(motion.pose.x - prior.pose.x) < 1e-3
    assert motion.covariance[0, 0] > 20.0 * motion.covariance[1, 1]


@pytest.mark.parametrize("seed", range(20))
def test_the_covariance_is_positive_definite_whatever_comes(seed):
    rng = np.random.default_rng(seed)
    motion = MotionFilter(FrontendParams())
    t = 0.0
    for k in range(60):
        t += float(rng.choice((0.0, -0.3, 1e-9, 0.1, 5.0, 4000.0)))
        odometry = Pose2(*rng.normal(0.0, 10.0 ** rng.uniform(-6, 3), 3).tolist())
        odometry = odometry if rng.random() < 0.7 else Pose2(math.nan, 0.0, 0.0)
        motion.predict(scan(t, odometry, float(rng.choice((math.nan, 0.1, 1e3)))))
        assert is_covariance(motion._P), k
        information = np.zeros((3, 3))
        for _ in range(rng.integers(0, 4)):  # few beams: a singular matrix
            normal = np.append(rng.normal(0.0, 1.0, 2), rng.normal(0.0, 10.0))
            information += 10.0 ** rng.uniform(0, 6) * np.outer(normal, normal)
        if rng.random() < 0.7:
            off = rng.normal(0.0, 10.0 ** rng.uniform(-4, 1), 3)
            pose = Pose2(*(np.array(motion.pose) + off).tolist())
            along = Observability(1.0, 0.0, float(rng.choice((0.0, 0.5))))
            motion.update(pose, information, along if k % 3 else FULLY_OBSERVED)
            assert is_covariance(motion._P), k


def test_a_given_pose_is_at_rest():
    motion = MotionFilter(FrontendParams())
    motion.predict(scan(0.0))
    motion.set_pose(Pose2(1.0, 2.0, 0.5), np.diag(MIN_MATCH_STD**2))
    prior = motion.predict(scan(0.1))
    assert prior.pose == pytest.approx((1.0, 2.0, 0.5))
    assert prior.twist == pytest.approx((0.0, 0.0, 0.0))


def test_wheels_that_stall_do_not_change_their_scale():
    z, readings, H = np.zeros(kernels.N), np.zeros((4, 7)), np.empty(kernels.N)
    z[kernels.STEP] = 0.05
    assert kernels.linearize(z, 0.1, 0, readings, H) == pytest.approx(-0.05)
    assert H[kernels.SCALE] == 0.0
    assert H[kernels.STEP] == 1.0
