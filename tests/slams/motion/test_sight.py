"""What a scan sees along a corridor: nothing, whatever its normal equations claim."""

import math

import numpy as np
import pytest

from slams.motion.params import MotionParams
from slams.motion.sight import CLEAR, UNKNOWN, Sight, noise_of, sight
from slams.motion.sight_kernels import N_FACES, bends, faces
from slams.motion.slip import SHIFTS, slip
from slams.motion.track import LOST_XY, Track
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import box, laser, scan_at

HALLWAY = np.array([(-60.0, 1.0, 60.0, 1.0), (-60.0, -1.0, 60.0, -1.0)])
ROOM = np.array(box(-3.0, -2.0, 6.0, 4.0))
ACROSS = np.diag([1e2, 1e6, 1e7])  # 1/m^2, 1/rad^2: a corridor along x, with some noise in x
STEP = 0.05  # m in 0.1 s


def seen_from(pose, walls=HALLWAY, beams=361, noise=0.01, seed=1):
    return scan_at(pose, laser(beams), walls, noise=noise, rng=np.random.default_rng(seed), t=0.0)


@pytest.mark.parametrize("beams", [61, 361, 1081])
@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
def test_along_a_bare_corridor_nothing_is_seen(beams, noise):
    for seed in range(5):
        seeing = sight(
            seen_from(Pose2(0.0, 0.1, 0.4), beams=beams, noise=noise, seed=seed), IDENTITY
        )
        assert seeing.share == 0.0
        assert abs(math.cos(-0.4) * seeing.x + math.sin(-0.4) * seeing.y) > 0.999


def test_its_direction_is_in_the_frame_of_the_map():
    pose = Pose2(3.0, 0.0, 0.7)
    seeing = sight(seen_from(pose), pose)
    assert abs(seeing.x) > 0.999 and abs(seeing.y) < 0.03


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.05])
def test_a_room_is_seen_all_ways(noise):
    seeing = sight(seen_from(Pose2(0.0, 0.0, 0.3), ROOM, noise=noise), IDENTITY)
    assert seeing.share > 0.95 and seeing.even > 0.3


def test_an_end_of_the_corridor_is_seen():
    ends = np.vstack([HALLWAY, [(6.0, -1.0, 6.0, 1.0)]])
    assert sight(seen_from(IDENTITY, ends), IDENTITY).share > 0.8


def test_a_scan_of_too_few_walls_tells_nothing():
    rng = np.random.default_rng(4)
    clutter = Scan(0.0, rng.uniform(1.0, 9.0, 361).astype(np.float32), laser(361))
    assert sight(clutter, IDENTITY) is None
    nothing = Scan(0.0, np.full(361, np.inf, np.float32), laser(361))
    assert sight(nothing, IDENTITY) is None


@pytest.mark.parametrize("walls", [HALLWAY, ROOM])
@pytest.mark.parametrize("noise", [0.005, 0.02, 0.05])
def test_the_noise_of_a_scan_is_found(walls, noise):
    found = [noise_of(seen_from(IDENTITY, walls, 721, noise, seed)) for seed in range(8)]
    assert np.mean(found) == pytest.approx(noise, rel=0.25)


def test_a_scan_of_few_beams_does_not_tell_its_noise():
    assert noise_of(seen_from(IDENTITY, beams=9)) == UNKNOWN


def test_one_look_alone_is_not_believed():
    blind = Sight(0.0, 1.0, 0.1, 0.02, 0.01)
    again = CLEAR.after(blind)
    assert (again.share, again.even) == (0.1, 0.02) and again.x == CLEAR.x


def test_what_counts_is_what_walls_bear_out_or_chance_does_not():
    seen = np.diag([4e4, 1e6, 1e7])
    blind = Sight(1.0, 0.0, 0.0, 0.0, 0.01)
    assert blind.judging(seen, rough=False).share == pytest.approx(0.75)  # 0.04 less 0.01
    assert blind.judging(seen, rough=True).share == 0.0
    assert blind.judging(ACROSS, rough=False).share == 0.0
    dim = blind._replace(share=0.5, even=0.005)
    assert dim.judging(seen, rough=True).share == pytest.approx(0.25)  # twice what is there
    assert dim._replace(even=1.0).judging(seen, rough=True).share == 0.5
    told = dim._replace(share=0.25).of(seen)
    assert told == pytest.approx(np.diag([1e4, 1e6, 1e7]))


def test_bends_are_those_of_a_wall_in_inverse_ranges():
    scan = seen_from(Pose2(0.0, 0.2, 0.0), noise=0.0)
    out = np.full(400, -1.0)
    m = bends(scan.ranges, 2, 2.0 * scan.laser.angle_increment, scan.laser.range_max, out)
    assert m > 100 and np.median(out[:m]) < 1e-4 and out[m] == -1.0


def test_faces_of_a_wall_and_of_things():
    scan, out = seen_from(Pose2(0.0, 0.0, 0.5), noise=0.0), np.zeros(N_FACES)
    faces(scan.ranges, scan.laser.directions, 1, scan.laser.range_max, 0.001, out)
    n = np.array([math.sin(0.5), math.cos(0.5)])
    assert out[:3] == pytest.approx(
        out[3] * np.array([n[0] ** 2, n[0] * n[1], n[1] ** 2]), rel=0.02
    )
    assert 0.9 * out[4] < out[3] <= out[4] == (scan.ranges < scan.laser.range_max).sum()


def drive(seconds, walls=HALLWAY, wheels=False, claims=ACROSS, begin=2.0):
    """A track down a corridor whose other end is out of sight after `begin` [s]; matches err not.

    Returns the track and the times [s] at which it called itself lost.
    """
    track, lost = Track(MotionParams()), []
    ends = np.vstack([HALLWAY, [(4.0, -1.0, 4.0, 1.0)]])
    for k in range(round(10 * seconds)):
        pose = Pose2(STEP * k, 0.0, 0.0)
        scan = seen_from(pose, ends if 0.1 * k < begin else walls, seed=k)
        scan = Scan(0.1 * k, scan.ranges, scan.laser, pose if wheels else None)
        track.predict(scan)
        track.matched(pose, np.diag([1e5, 1e6, 1e7]) if 0.1 * k < begin else claims, scan)
        lost += [0.1 * k] if track.state == "lost" else []
    return track, lost


def test_a_corridor_without_an_end_is_lost_after_seconds_and_mapped_on():
    track, lost = drive(14.0)
    assert lost and 4.0 < lost[0] < 10.0 and track.adrift
    assert len(lost) == track.lost == 140 - round(10 * lost[0])
    assert math.sqrt(track.covariance[0, 0]) > LOST_XY > 100.0 * math.sqrt(track.covariance[1, 1])


def test_wheels_know_the_way_along_a_corridor():
    track, lost = drive(14.0, wheels=True)
    assert not lost and not track.adrift and 0.003 < math.sqrt(track.covariance[0, 0]) < 0.2


def test_a_room_is_never_adrift():
    track, lost = drive(14.0, ROOM, claims=np.diag([1e5, 1e6, 1e7]))
    assert not lost and math.sqrt(track.covariance[0, 0]) < 0.005


def test_in_a_corridor_the_pose_is_the_prediction_along_it_and_the_match_across():
    track, _ = drive(5.0)
    scan = seen_from(Pose2(50 * STEP, 0.0, 0.0), seed=99)
    scan = Scan(5.0, scan.ranges, scan.laser)
    expected = track.predict(scan).pose
    track.matched(Pose2(expected.x - 0.05, 0.003, 0.0), ACROSS, scan)
    assert track.pose.x == pytest.approx(expected.x, abs=0.002)
    assert track.pose.y == pytest.approx(0.003, abs=1e-3)


def test_noise_does_not_slow_the_robot_down():
    track, _ = drive(6.0)
    for k in range(60, 90):
        scan = seen_from(Pose2(STEP * k, 0.0, 0.0), seed=k)
        scan = Scan(0.1 * k, scan.ranges, scan.laser)
        expected = track.predict(scan)
        track.matched(expected.pose @ Pose2(-0.5 * STEP, 0.0, 0.0), ACROSS, scan)
    assert expected.step.x == pytest.approx(STEP, rel=0.1)


def leads_of(slipped, things):
    """So many things of a scan agree only where the robot is, `slipped` [m] further along x."""

    def leads(pose, offsets):
        there = np.abs(offsets[:, 0] - slipped) < 0.03
        return np.stack([things * there, things * there], axis=1)

    return leads


@pytest.mark.parametrize("wheels", [False, True])
def test_a_slip_counts_as_far_as_the_map_proves_it(wheels):
    moved, deviation = [], []
    for things in (0.0, 9.0, 25.0):
        track, _ = drive(6.0, wheels=wheels)
        track.covariance = track._sight.widened(track.covariance, 0.04)  # m^2
        scan = seen_from(Pose2(60 * STEP, 0.0, 0.0), seed=60)
        scan = Scan(6.0, scan.ranges, scan.laser, Pose2(60 * STEP, 0.0, 0.0) if wheels else None)
        pose = track.predict(scan).pose
        track.matched(pose, ACROSS, scan, leads=leads_of(0.1, things))
        moved.append(track.pose.x - pose.x)
        deviation.append(math.sqrt(track.covariance[0, 0]))
    assert moved[0] == pytest.approx(0.0, abs=0.003) and moved[2] == pytest.approx(0.1, abs=0.005)
    assert moved[0] < moved[1] < moved[2]
    assert deviation[0] > 0.15 > deviation[1] > deviation[2]


def test_a_lead_within_chance_proves_nothing():
    noise = np.random.default_rng(1).standard_normal((400, len(SHIFTS)))
    for row in noise:
        found = slip(np.stack([0.7 * row, np.ones(len(SHIFTS))], axis=1), 0.01)
        assert abs(found.moved) < 0.1 and found.information < 1.0 / 0.05**2
    flat = slip(np.zeros((len(SHIFTS), 2)), 0.01)
    assert flat == pytest.approx((0.0, 0.0), abs=1e-12)
