"""What is known of a step before its scan: honest, and not to be fooled by wheels or stamps."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from bench.sim.drive import Robot, drive
from bench.sim.maze import rescue_arena
from bench.sim.setting import CELL
from bench.sim.wheels import gyro, odometry
from slams.jit import records
from slams.motion import velocity_kernels as kernels
from slams.motion.chord import Chord, chord_of, covariance, variances
from slams.motion.model import Motion
from slams.motion.params import MotionParams
from slams.motion.source_kernels import wheel_variance
from slams.motion.trust import laws
from slams.scanlog import Track
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import laser

BEAM = (np.zeros(1, np.float32), laser(1))
SURE = np.eye(3) * 1e-6
SECONDS = 30.0


def stamped(t, odometry=None, yaw=None):
    return Scan(t, *BEAM, odometry, yaw)


def poses_of(array):
    return [Pose2(*row) for row in array.tolist()]


def arc(seconds, rate, v=0.5, w=0.3):
    """Stamps and poses of a robot that drives in a circle."""
    t = np.arange(round(seconds * rate)) / rate
    x, y = v / w * np.sin(w * t), v / w * (1.0 - np.cos(w * t))
    return t.tolist(), poses_of(np.stack([x, y, np.remainder(w * t, 2.0 * math.pi)], axis=1))


def followed(scans, poses, motion=None, blind=()):
    """Predictions of scans whose matches find the poses, but for the blind ones."""
    motion = motion or Motion()
    pose, predictions = poses[0], []
    for k, (scan, true) in enumerate(zip(scans, poses, strict=True)):
        predictions.append(motion.predict(pose, scan))
        pose = predictions[-1].pose if k in blind else true
        if k in blind:
            motion.missed(scan)
        else:
            motion.moved(pose, SURE, scan)
    return predictions, motion


def misses(predictions, poses):
    """Distance [m] of each predicted step's end from the true step's."""
    ends = [a.between(b) for a, b in zip(poses[:-1], poses[1:], strict=True)]
    steps = [p.step for p in predictions[1:]]
    return np.array(
        [0.0, *(math.hypot(a.x - b.x, a.y - b.y) for a, b in zip(ends, steps, strict=True))]
    )


def spoiled(odom, rng, aside=0.0, ahead=0.0, turn=0.0):
    """Odometry that also slips by so much [m, m, rad] along one meter, as a random walk."""
    poses = poses_of(odom.values)
    found = [poses[0]]
    for a, b in zip(poses[:-1], poses[1:], strict=True):
        step = a.between(b)
        way = math.sqrt(math.hypot(step.x, step.y))
        slip = Pose2(*(rng.normal(0.0, 1.0, 3) * (ahead, aside, turn) * way).tolist())
        found.append(found[-1] @ step @ slip)
    return Track(odom.t, np.array(found))


@pytest.fixture(scope="module")
def drives():
    world = rescue_arena(np.random.default_rng(3), CELL)
    drives = []
    for seed in range(20):
        way, wheels, turns = np.random.default_rng(seed).spawn(3)
        true = drive(world, Robot(), way, SECONDS, 200.0)
        fine = np.arange(0, SECONDS, 0.005)
        odom = Track(fine, odometry(true, fine, wheels))
        odom = spoiled(odom, np.random.default_rng(500 + seed), aside=MotionParams().side_slip)
        drives.append((true, odom, Track(fine, gyro(true, fine, turns))))
    return drives


def normalized(one, rate, wheels, yaw, rng, noise):
    """Squared errors of each predicted step over its covariance (n,), for one drive."""
    true, odom, rates = one
    t = np.arange(0.0, SECONDS - 0.02, 1.0 / rate)
    truth = poses_of(true.poses_at(t))
    found = poses_of(true.poses_at(t) + rng.normal(0.0, noise, (len(t), 3)))
    measured, headings = poses_of(odom.poses_at(t)), rates.integral_at(t).tolist()
    motion, squares = Motion(), []
    for k, stamp in enumerate(t.tolist()):
        scan = stamped(stamp, measured[k] if wheels else None, headings[k] if yaw else None)
        predicted = motion.predict(found[k - 1], scan)
        if k > 0:
            step = truth[k - 1].between(truth[k])
            error = np.array(step) - np.array(predicted.step)
            squares.append(error @ np.linalg.solve(predicted.covariance, error))
        motion.moved(found[k], np.eye(3) * max(noise, 1e-6) ** 2, scan)
    return squares


@pytest.mark.parametrize("rate", [40, 5])
@pytest.mark.parametrize("noise", [0.001, 0.0])
@pytest.mark.parametrize(
    ("wheels", "yaw", "low", "high"),
    [
        (True, False, 0.75, 1.25),  # of wheels whose scale is found wrong less is believed
        (True, True, 0.8, 1.25),
        (False, True, 0.8, 1.25),
        (False, False, 0.75, 1.25),
    ],
)
def test_the_covariance_of_a_step_is_honest(drives, rate, noise, wheels, yaw, low, high):
    squares = []
    for seed, one in enumerate(drives):
        rng = np.random.default_rng(100 + seed)
        squares += normalized(one, rate, wheels, yaw, rng, noise)
    assert low < np.mean(squares) / 3.0 < high


@pytest.mark.parametrize("rate", [40, 5])
def test_wheels_worse_than_said_are_found_out(drives, rate):
    squares = []
    for seed, (true, odom, rates) in enumerate(drives[:10]):
        rng = np.random.default_rng(300 + seed)
        worse = spoiled(odom, rng, aside=0.004, ahead=0.015, turn=0.04)
        found = normalized((true, worse, rates), rate, True, False, rng, 0.001)
        squares += found[15 * rate :]
    assert 0.6 < np.mean(squares) / 3.0 < 2.5


def test_each_source_makes_the_step_surer(drives):
    deviation = {}
    true, odom, rates = drives[0]
    t = np.arange(0.0, SECONDS - 0.02, 0.2)
    truth, measured = poses_of(true.poses_at(t)), poses_of(odom.poses_at(t))
    for wheels, yaw in ((False, False), (False, True), (True, False), (True, True)):
        scans = [
            stamped(stamp, o if wheels else None, g if yaw else None)
            for stamp, o, g in zip(t.tolist(), measured, rates.integral_at(t).tolist(), strict=True)
        ]
        predictions, motion = followed(scans, truth)
        deviation[wheels, yaw] = np.mean([p.variance for p in predictions[5:]], axis=0)
        assert motion.counts == {
            "odometry": wheels * (len(t) - 1),
            "gyro": yaw * (len(t) - 1),
            "odometry_faults": 0,
        }
    nothing, gyro_only, wheels_only = (
        deviation[k] for k in ((False, False), (False, True), (True, False))
    )
    assert (wheels_only < nothing)[[0, 2]].all()
    assert gyro_only[2] < 0.1 * wheels_only[2]
    assert deviation[True, True][2] < 0.1 * wheels_only[2]
    assert deviation[True, True][0] == pytest.approx(wheels_only[0], rel=1e-4)


LEAPS = {  # what stands before all odometry from then on, the robot being at p
    "2 m": lambda p: Pose2(2.0, 0.0, 0.0),
    "1 km": lambda p: Pose2(0.0, -1000.0, 0.0),
    "heading": lambda p: p @ Pose2(0.0, 0.0, 1.6) @ p.inverse(),
    "turned about": lambda p: Pose2(-40.0, 7.0, -3.0),
}


@pytest.mark.parametrize("rate", [40, 5])
@pytest.mark.parametrize("leap", LEAPS)
@pytest.mark.parametrize("at", [(5,), (71,), (60, 61), (60, 67)])
def test_a_leap_of_the_odometry_costs_nothing(rate, leap, at):
    t, poses = arc(100 / rate, rate)
    odom = list(poses)
    for k in at:
        moved = LEAPS[leap](odom[k])
        odom[k:] = [moved @ p for p in odom[k:]]
    predictions, motion = followed([stamped(*both) for both in zip(t, odom, strict=True)], poses)
    assert motion.counts["odometry_faults"] == len(at)
    assert motion.counts["odometry"] == len(t) - 1 - len(at)
    assert misses(predictions, poses)[5:].max() < 0.1 * 0.5 / rate
    for predicted in predictions[5:]:
        assert predicted.velocity == pytest.approx((0.5, 0.0, 0.3), abs=0.05)
    after = [k + 1 for k in at if k + 1 not in at]
    assert all(predictions[k].used == ("wheels", "velocity") for k in after)
    assert all(predictions[k].used == ("velocity",) for k in at)


@pytest.mark.parametrize("rate", [40, 5])
def test_odometry_that_restarts_at_zero_is_followed_from_there(rate):
    t, poses = arc(8.0, rate)
    k = len(t) // 2
    odom = poses[:k] + [poses[k].between(p) for p in poses[k:]]
    blind = range(k - 3, len(t))
    predictions, motion = followed(
        [stamped(*both) for both in zip(t, odom, strict=True)], poses, blind=blind
    )
    assert motion.counts["odometry_faults"] == 1
    assert poses[-1].between(predictions[-1].pose) == pytest.approx((0.0, 0.0, 0.0), abs=0.05)


@pytest.mark.parametrize("rate", [40, 5])
@pytest.mark.parametrize("lie", ["stalled", "backwards", "mirrored"])
def test_wheels_that_lie_are_believed_less_until_they_agree_again(rate, lie):
    t, poses = arc(20.0, rate)
    first, last = 5 * rate, 8 * rate
    odom = list(poses[: first + 1])
    for k in range(first, len(t) - 1):
        step = poses[k].between(poses[k + 1])
        if k < last:
            step = {
                "stalled": IDENTITY,
                "backwards": step.inverse(),
                "mirrored": Pose2(step.x, -step.y, -step.theta),
            }[lie]
        odom.append(odom[-1] @ step)
    predictions, motion = followed([stamped(*both) for both in zip(t, odom, strict=True)], poses)
    off = misses(predictions, poses)
    turned = [
        abs(p.step.theta - a.between(b).theta)
        for p, a, b in zip(predictions[1:], poses[:-1], poses[1:], strict=True)
    ]
    way, turn = 0.5 / rate, 0.3 / rate
    assert off[first + 2 : last + 1].max() < 0.3 * way
    assert max(turned[first + 1 : last]) < 0.3 * turn
    assert off[last + 8 * rate :].max() < 0.01 * way
    assert motion.counts["odometry_faults"] >= (last - first) / 2
    honest, lied = predictions[first - 1].variance, predictions[last].variance
    axis = 2 if lie == "mirrored" else 0
    assert lied[axis] > 1.1 * honest[axis]
    assert predictions[-1].variance[axis] < 2.0 * honest[axis]
    error = misses(predictions, poses)[first + 1 : last]
    deviation = [math.sqrt(p.variance.ahead) for p in predictions[first + 1 : last]]
    assert np.mean((error / deviation) ** 2) < 4.0


@pytest.mark.parametrize("rate", [40, 5])
def test_blind_and_in_doubt_the_wheels_are_followed_again(rate):
    t, poses = arc(20.0, rate)
    stall = range(5 * rate, 7 * rate)
    odom = [poses[0]]
    for k in range(len(t) - 1):
        odom.append(odom[-1] @ (IDENTITY if k in stall else poses[k].between(poses[k + 1])))
    turns = Pose2(0.0, 0.0, -0.6 / rate)  # while blind the robot turns the other way
    for k in range(8 * rate, len(t)):
        odom[k] = odom[k - 1] @ Pose2(0.2 / rate, 0.0, 0.0) @ turns
    blind = range(8 * rate, len(t))
    predictions, _ = followed(
        [stamped(*both) for both in zip(t, odom, strict=True)], poses, blind=blind
    )
    step = odom[-2].between(odom[-1])
    assert predictions[-1].step == pytest.approx(step, abs=0.1 * 0.2 / rate)


def test_doubt_does_not_depend_on_the_rate():
    variance = {}
    for rate in (40, 10, 5):
        t, poses = arc(6.0, rate)
        odom = [p if k < 5 * rate else poses[5 * rate] for k, p in enumerate(poses)]
        _, motion = followed([stamped(*both) for both in zip(t, odom, strict=True)], poses)
        variance[rate] = motion._wheels.numbers["doubt"][0]
    assert variance[5] == pytest.approx(variance[40], rel=0.3)
    assert variance[10] == pytest.approx(0.25 * (1.0 - math.exp(-0.5)), rel=0.3)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_counts_as_absent(bad):
    t, poses = arc(4.0, 10)
    holes = (7, 8, 20)
    for place in range(4):
        scans, without = [], []
        for k, (stamp, p) in enumerate(zip(t, poses, strict=True)):
            values = [*p, p.theta]
            none = list(values)
            if k in holes:
                values[place] = bad
            odom = None if k in holes and place < 3 else p
            yaw = None if k in holes and place == 3 else p.theta
            scans.append(stamped(stamp, Pose2(*values[:3]), values[3]))
            without.append(stamped(stamp, odom, yaw))
            assert all(map(math.isfinite, none))
        given, motion = followed(scans, poses)
        absent, _ = followed(without, poses)
        assert [p.pose for p in given] == [p.pose for p in absent]
        assert all(np.isfinite(p.covariance).all() for p in given)
        assert motion.counts["odometry_faults"] == 0


def test_a_constant_motion_of_the_odom_frame_changes_nothing():
    t, poses = arc(5.0, 10)
    moved = [Pose2(300.0, -20.0, 2.0) @ p for p in poses]
    one, _ = followed([stamped(*both) for both in zip(t, poses, strict=True)], poses)
    two, _ = followed([stamped(*both) for both in zip(t, moved, strict=True)], poses)
    for a, b in zip(one, two, strict=True):
        assert a.step == pytest.approx(b.step, abs=1e-9)
        assert a.covariance == pytest.approx(b.covariance, rel=1e-6, abs=1e-15)


def test_ragged_stamps_give_way_to_the_usual_interval():
    t, poses = 0.0, [Pose2(0.1 * k, 0.0, 0.0) for k in range(120)]
    scans = []
    for k in range(len(poses)):
        t += 0.05 if k % 2 else 0.35
        scans.append(stamped(t))
    predictions, _ = followed(scans, poses)
    assert misses(predictions, poses)[60:].max() < 0.02
    assert predictions[-1].velocity.x == pytest.approx(0.5, abs=0.1)


def test_a_robot_is_no_farther_from_its_prediction_than_it_can_accelerate():
    p, (t, poses) = MotionParams(), arc(3.0, 10)
    _, motion = followed([stamped(s) for s in t], poses)
    for seconds in (0.0, 1.0):
        most = p.top_acceleration * max(seconds, 0.1) ** 2 + p.leap
        assert motion.room(seconds) == pytest.approx(most)
    ragged = [stamped(0.2 * k + 0.15 * (k % 2)) for k in range(120)]
    poses = [Pose2(0.1 * k, 0.0, 0.0) for k in range(120)]
    _, motion = followed(ragged, poses)
    assert motion.room(0.0) == math.inf  # nobody knows the time


def test_stamps_that_go_backward_or_stand_still_hurt_nothing():
    rng = np.random.default_rng(5)
    t, poses = arc(60.0, 5)
    for wheels in (False, True):
        late = [stamp + rng.exponential(0.2) for stamp in t]
        assert (np.diff(late) < 0.0).sum() > 20
        odom = [p if wheels else None for p in poses]
        predictions, motion = followed(
            [stamped(*both) for both in zip(late, odom, strict=True)], poses
        )
        off = misses(predictions, poses)[50:]
        assert off.max() < (0.02 if wheels else 0.05)
        assert np.median(off) < (0.001 if wheels else 0.01)
        assert all(np.linalg.eigvalsh(p.covariance).min() > 0.0 for p in predictions)
        assert all(p.dt > 0.0 for p in predictions[5:])
        assert motion.counts["odometry_faults"] == 0
    for stamp in (0.0, math.nan):
        frozen = [stamped(stamp, p) for p in poses]
        predictions, motion = followed(frozen, poses)
        assert motion.counts["odometry_faults"] == 0
        assert misses(predictions, poses)[1:].max() < 0.01
        assert all(p.velocity == IDENTITY for p in predictions)


def test_scaled_intervals_scale_the_step_and_lost_scans_do_no_harm():
    t, poses = arc(20.0, 10)
    kept = [k for k in range(len(t)) if k % 17 not in (3, 4, 5)]
    predictions, _ = followed([stamped(t[k]) for k in kept], [poses[k] for k in kept])
    assert misses(predictions, [poses[k] for k in kept])[20:].max() < 0.01


def test_key_scans_metres_and_seconds_apart_follow_the_wheels():
    rng = np.random.default_rng(2)
    poses, t, odom = [IDENTITY], [0.0], [IDENTITY]
    for _ in range(60):
        step = Pose2(5.06, 0.4, float(rng.uniform(-2.0, 2.0)))
        poses.append(poses[-1] @ step)
        slip = rng.normal(0.0, 0.01, 2)
        odom.append(odom[-1] @ Pose2(step.x * (1 + slip[0]), step.y, step.theta + slip[1]))
        t.append(t[-1] + float(rng.uniform(2.0, 30.0)))
    predictions, motion = followed([stamped(*both) for both in zip(t, odom, strict=True)], poses)
    assert motion.counts == {"odometry": 60, "gyro": 0, "odometry_faults": 0}
    assert misses(predictions, poses).max() < 0.3
    assert all(p.variance.ahead < 0.1**2 and p.variance.turn < 0.2**2 for p in predictions[1:])


def test_what_was_not_found_means_less_and_less():
    for rate in (5, 40):
        t, poses = arc(14.0, rate, w=1e-6)
        blind = range(4 * rate, len(t))
        predictions, _ = followed([stamped(stamp) for stamp in t], poses, blind=blind)
        speed = [p.velocity.x for p in predictions]
        assert speed[4 * rate] == pytest.approx(0.5, abs=0.01)
        assert speed[6 * rate] == pytest.approx(0.5 * math.exp(-1.0), abs=0.03)
        deviation = [math.sqrt(p.variance.ahead) * rate for p in predictions]
        assert deviation[4 * rate] < 0.05 < deviation[5 * rate] < deviation[7 * rate] < 1.0


def test_a_hand_that_swings_sideways_is_learned():
    t = np.arange(0.0, 20.0, 0.025)
    poses = poses_of(np.stack([0.5 * t, 0.1 * np.sin(3.0 * t), 0.0 * t], axis=1))
    predictions, _ = followed([stamped(stamp) for stamp in t.tolist()], poses)
    assert misses(predictions, poses)[200:].max() < 0.002
    ends = np.diff([p.y for p in poses])
    errors = np.array([p.step.y for p in predictions[1:]]) - ends
    deviations = np.sqrt([p.variance.aside for p in predictions[1:]])
    assert np.mean((errors / deviations)[100:] ** 2) < 2.0


def test_being_found_again_elsewhere_is_no_motion():
    t, poses = arc(10.0, 10)
    poses[50:] = [Pose2(8.0, 3.0, 1.0) @ p for p in poses[50:]]
    predictions, motion = followed([stamped(stamp) for stamp in t], poses)
    assert misses(predictions, poses)[51:].max() < 0.01
    assert predictions[51].velocity == pytest.approx((0.5, 0.0, 0.3), abs=0.05)
    before = motion.predict(poses[-1], stamped(t[-1] + 0.1))
    assert motion.velocity_to(Pose2(-30.0, 0.0, 0.0)) == before.velocity
    found = motion.velocity_to(poses[-1] @ Pose2(0.07, 0.0, 0.02))
    assert found == pytest.approx((0.7, -0.007, 0.2), abs=1e-3)


def test_where_the_match_is_blind_the_wheels_tell_the_velocity():
    t, poses = arc(10.0, 10, w=1e-6)
    motion, odom = Motion(), poses
    corridor = np.diag([math.inf, 1e-6, 1e-6])
    for stamp, pose in zip(t, odom, strict=True):
        scan = stamped(stamp, pose)
        found = motion.predict(pose, scan).pose
        motion.moved(found, corridor, scan)
    predicted = motion.predict(poses[-1], stamped(t[-1] + 0.1))
    assert predicted.used == ("velocity",)
    assert predicted.velocity.x == pytest.approx(0.5, abs=0.02)
    assert np.isfinite(predicted.covariance).all()


def test_the_first_scan_stands_still_and_switches_hold():
    scans = [stamped(0.1 * k, Pose2(0.05 * k, 0.0, 0.0), 0.01 * k) for k in range(30)]
    poses = [scan.odometry for scan in scans]
    for wheels, yaw in ((True, False), (False, True), (False, False)):
        motion = Motion(MotionParams(wheels=wheels, gyro=yaw))
        predictions, _ = followed(scans, poses, motion)
        assert predictions[0].pose == poses[0] and predictions[0].step == IDENTITY
        assert predictions[0].used == () and predictions[0].velocity == IDENTITY
        assert predictions[1].used == ("wheels",) * wheels + ("gyro",) * yaw + ("velocity",)
        assert motion.counts["odometry"] == 29 * wheels
        assert motion.counts["gyro"] == 29 * yaw


def test_wheels_at_rest_leave_room_for_a_stall():
    motion = Motion()
    for k in range(200):
        predicted = motion.predict(IDENTITY, stamped(0.025 * k, IDENTITY))
        motion.moved(IDENTITY, SURE, stamped(0.025 * k, IDENTITY))
    assert min(predicted.variance) > 1e-10


@pytest.mark.parametrize("leap", [Pose2(0.2, 0.0, 0.0), Pose2(0.0, 0.0, 0.5)])
def test_a_leap_a_robot_could_make_widens_the_prediction_and_stays_out_of_the_velocity(leap):
    t, poses = arc(10.0, 5)
    odom = poses[:30] + [poses[29] @ leap @ poses[29].inverse() @ p for p in poses[30:]]
    scans = [stamped(*both) for both in zip(t, odom, strict=True)]
    predictions, motion = followed(scans, poses)
    assert motion.counts["odometry"] == 49
    predicted, true = predictions[30], chord_of(poses[29].between(poses[30]))
    error = np.array(chord_of(predicted.step)) - np.array(true)
    assert (np.abs(error) < 1.5 * np.sqrt(predicted.variance)).all()
    assert predicted.velocity == pytest.approx((0.5, 0.0, 0.3), abs=0.05)
    assert misses(predictions, poses)[31:].max() < 0.01


def test_after_a_break_the_velocity_is_forgotten():
    t, poses = arc(6.0, 10)
    _, motion = followed([stamped(stamp) for stamp in t], poses)
    predicted = motion.predict(poses[-1], stamped(t[-1] + 3.0))
    assert predicted.step == IDENTITY
    assert predicted.variance.ahead > 3.0**2


def test_both_ends_of_a_found_step_have_an_error():
    rng = np.random.default_rng(8)
    t, poses = arc(50.0, 40)
    found = [p @ Pose2(*rng.normal(0.0, 0.01, 3)) for p in poses]
    motion, pose = Motion(), poses[0]
    for stamp, true, near in zip(t, poses, found, strict=True):
        motion.predict(pose, stamped(stamp, true))
        pose = near
        motion.moved(pose, np.eye(3) * 1e-4, stamped(stamp, true))
    assert motion.counts["odometry_faults"] <= 3


@pytest.mark.parametrize("rate", [40, 5])
def test_a_gyro_that_leaps_or_sticks_is_not_followed(rate):
    t, poses = arc(10.0, rate)
    first, last = 5 * rate, 8 * rate
    leapt = [0.3 * s + (2.0 if k >= first else 0.0) for k, s in enumerate(t)]
    stuck = [0.3 * (s if k < first else t[first]) for k, s in enumerate(t[:last])]
    turn = 0.3 / rate
    for yaw in (leapt, stuck):
        scans = [stamped(s, None, y) for s, y in zip(t, yaw, strict=False)]
        predictions, motion = followed(scans, poses[: len(scans)])
        late = predictions[first + (0 if yaw is leapt else rate) :]
        assert max(abs(p.step.theta - turn) for p in late) < 0.3 * turn
        assert motion.counts["gyro"] == len(scans) - 1 - (yaw is leapt)


def test_variances_of_wheels_grow_with_way_and_turn():
    p = MotionParams()

    def variance(way, turn, unsure=1.0, veer=1.0):
        return Chord(*wheel_variance(laws(p), (way, 0.0, turn), 1.0, unsure, veer))

    way = variance(1.0, 0.0)
    assert way.ahead == pytest.approx(0.01**2 + 0.003**2, rel=1e-3)
    assert way.turn == pytest.approx(0.01**2 + 0.004**2, rel=1e-3)
    assert way.aside == pytest.approx(0.004**2 / 12.0 + p.side_slip**2, rel=1e-3)
    turn = variance(0.0, 1.0)
    assert turn.turn == pytest.approx(0.042**2 + 0.01**2, rel=1e-3)
    assert turn.ahead == pytest.approx(0.002**2, rel=1e-3)
    assert variance(2.0, 0.0).ahead == pytest.approx(0.02**2 + 2 * 0.003**2, rel=1e-3)
    known = variance(2.0, 0.0, 0.002**2, 0.001**2)  # what was learned of them
    assert known.ahead == pytest.approx((2.0 * 0.002) ** 2 + 2 * 0.003**2, rel=1e-3)
    assert known.turn == pytest.approx((2.0 * 0.001) ** 2 + 2 * 0.004**2, rel=1e-3)


def jacobian(function, at):
    columns = []
    for k in range(len(at)):
        up, down = np.array(at, float), np.array(at, float)
        up[k] += 1e-6
        down[k] -= 1e-6
        columns.append((np.array(function(up)) - np.array(function(down))) / 2e-6)
    return np.array(columns).T


def test_covariance_in_the_frame_before_follows_from_the_chord():
    chord, variance = Chord(0.7, -0.2, 1.1), Chord(0.04, 0.01, 0.09)
    assert chord_of(chord.step()) == pytest.approx(chord)
    assert Chord(1.0, 0.0, 0.0).step() == (1.0, 0.0, 0.0)
    J = jacobian(lambda c: Chord(*c).step(), chord)
    assert covariance(chord.step(), variance) == pytest.approx(J @ np.diag(variance) @ J.T)


def test_a_matchers_prior_adds_the_pose_before():
    t, poses = arc(3.0, 10)
    poses = [Pose2(1.0, 2.0, 2.5) @ p for p in poses]
    predictions, _ = followed([stamped(*both) for both in zip(t, poses, strict=True)], poses)
    predicted, pose = predictions[-1], poses[-2]
    A = np.random.default_rng(0).normal(0.0, 0.1, (3, 3))
    before = A @ A.T
    J = jacobian(lambda p: Pose2(*p) @ predicted.step, pose)
    K = jacobian(lambda s: pose @ Pose2(*s), predicted.step)
    expected = J @ before @ J.T + K @ predicted.covariance @ K.T
    assert predicted.pose_covariance(before) == pytest.approx(expected, abs=1e-9)


def test_variances_of_a_match_are_turned_along_the_way():
    found = np.diag([4.0, 1.0, 0.25])
    assert variances(found, 0.5 * math.pi, 1.0) == pytest.approx((1.0, 4.0, 0.25))
    A = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]])
    u = np.array([math.cos(0.3), math.sin(0.3), 0.0])
    assert variances(A, 0.3, 1.0).ahead == pytest.approx(u @ A @ u)
    assert variances(None, 0.3, 0.1) == pytest.approx((0.01,) * 3)
    blind = variances(np.diag([math.inf, 1.0, math.nan]), 0.0, 1.0)
    assert blind == (math.inf,) * 3


@pytest.mark.parametrize("dt", [0.0249, 0.2, 3.0])
def test_an_interval_is_singers_model(dt):
    time = 0.5
    F = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0 / time]])
    G = np.diag([0.0, 0.0, 2.0 / time])
    block = expm(dt * np.block([[-F, G], [np.zeros((3, 3)), F.T]]))  # Van Loan 1978
    phi = block[3:, 3:].T
    noise = phi @ block[:3, 3:]
    over = records(1, kernels.INTERVAL)
    kernels.interval(over, dt, time)
    assert over[["xa", "va", "aa"]][0].tolist() == pytest.approx(phi[:, 2].tolist(), rel=1e-6)
    q = over[["qxx", "qxv", "qxa", "qvv", "qva", "qaa"]][0].tolist()
    assert q == pytest.approx(noise[np.triu_indices(3)].tolist(), rel=0.05)
    axes, state = records(1, kernels.AXIS), ["xx", "xv", "xa", "vv", "va", "aa"]
    axes["noise"] = 0.09
    for name, value in zip(["x", "v", "a"], (0.1, 0.2, 0.3), strict=True):
        axes[name] = value
    for name, value in zip(state, (0.5, 0.1, 0.05, 0.4, 0.06, 0.3), strict=True):
        axes[name] = value
    P = np.array([[0.5, 0.1, 0.05], [0.1, 0.4, 0.06], [0.05, 0.06, 0.3]])
    expected = phi @ P @ phi.T + 0.09 * noise
    mean, variance = kernels.step(axes[0], over[0])
    assert mean == pytest.approx((phi @ [0.0, 0.2, 0.3])[0])
    still = np.diag([0.0, 1.0, 1.0])
    assert variance == pytest.approx(
        (phi @ still @ P @ still @ phi.T + 0.09 * noise)[0, 0], rel=0.01
    )
    kernels.pass_over(axes[0], over[0])
    got = axes[state][0].tolist()
    assert got == pytest.approx(expected[np.triu_indices(3)].tolist(), rel=0.01)
    assert axes[["x", "v", "a"]][0].tolist() == pytest.approx((phi @ [0.1, 0.2, 0.3]).tolist())


@pytest.mark.parametrize("dt", [5e-324, 1e-310, 1e-160, 1e-12])
def test_an_interval_that_is_as_good_as_none_counts_as_none(dt):
    motion, blind = Motion(), np.diag([math.inf, math.inf, 1e-6])
    still = Pose2(0.0, 0.0, 0.0)
    for t in (0.0, dt, 0.1):
        said = motion.predict(still, stamped(t, still))
        assert np.isfinite(said.pose).all() and np.isfinite(said.variance).all()
        motion.moved(still, blind, stamped(t, still))
