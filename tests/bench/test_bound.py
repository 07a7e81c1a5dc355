"""The Cramer-Rao bound against closed forms, finite differences and maximum likelihood."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

from bench.judge.bound import Bound, _weights, bound, bound_of
from bench.judge.bound_kernels import Squares, fisher_information
from bench.sim.range_errors import Errors
from bench.sim.setting import Setting
from bench.sim.simulation import errors_of, simulate, world_of
from bench.sim.world import World, read_world
from slams import load
from slams.metrics import relative_errors
from slams.scanlog import Track
from slams.types import IDENTITY, Laser, Pose2, wrap_angle

SIGMA = 0.01
NOISE = Errors(SIGMA, step=0.0)


def fan(n_beams, mount=IDENTITY, angle=1.5 * math.pi):
    return Laser(-0.5 * angle, angle / (n_beams - 1), n_beams, 0.05, 30.0, mount)


def room(box=True):
    """6 m x 4 m inside walls, origin in the inner corner, with a box off the middle."""
    occupied = np.ones((82, 122), bool)
    occupied[1:-1, 1:-1] = False
    if box:
        occupied[50:60, 70:90] = True
    return World(occupied, np.zeros_like(occupied), 0.05, (-0.05, -0.05))


@cache
def log_of(**changes):
    return simulate(dataclasses.replace(Setting(size=8.0, duration=4.0), **changes))


def arena():
    """A small rescue arena and some poses on a way through it."""
    log = log_of()
    return world_of(log), log.truth_at(log.t)[::16]


def lines(pose, angles):
    """Ranges (b,) in the empty room from its four lines alone."""
    direction = pose[2] + angles
    c, s = np.cos(direction), np.sin(direction)
    to_x = np.where(c > 0.0, 6.0 - pose[0], pose[0]) / np.maximum(np.abs(c), 1e-12)
    to_y = np.where(s > 0.0, 4.0 - pose[1], pose[1]) / np.maximum(np.abs(s), 1e-12)
    return np.minimum(to_x, to_y)


def by_differences(ranges_at, pose, h=1e-6):
    """Information (3, 3) from finite differences of ranges; beams that jump are left out."""
    steps = h * np.eye(3)
    gradient = np.stack(
        [(ranges_at(pose + d) - ranges_at(pose - d)) / (2.0 * h) for d in steps], axis=1
    )
    smooth = np.isfinite(gradient).all(axis=1) & (np.abs(gradient).max(axis=1) < 2e3)
    gradient = gradient[smooth]
    return gradient.T @ gradient / SIGMA**2, int(smooth.sum())


def information_of(world, rays, covariance=None):
    """What the kernel makes of the rays (b, 3) of one scan around the first ray's start."""
    squares = Squares(world.occupied, world.resolution, *world.origin)
    covariances = np.zeros((1, 3, 3)) if covariance is None else np.asarray(covariance)[None]
    out, beams = np.zeros((1, 3, 3)), np.zeros(1, np.int64)
    distances = world.cast(rays)[None]
    weights = np.where(np.isfinite(distances), 1.0 / SIGMA**2, 0.0)
    bases = rays[None, 0].copy()
    fisher_information(squares, rays[None], distances, weights, bases, covariances, out, beams)
    return out[0], int(beams[0])


def test_an_empty_room_against_its_lines():
    laser = fan(271)
    poses = np.array([[2.0, 1.5, 0.3], [5.0, 3.1, -2.0], [0.5, 0.4, 1.0]])
    found = bound(room(box=False), NOISE, laser, poses)
    for pose, covariance in zip(poses, found.covariance, strict=True):
        information, _ = by_differences(lambda p: lines(p, laser.angles), pose)
        np.testing.assert_allclose(covariance, np.linalg.inv(information), rtol=0.03, atol=1e-10)


def test_four_beams_by_hand():
    """Straight ahead, back, left and right: sigma / sqrt(2) along each axis, heading open."""
    laser = Laser(-math.pi, 0.5 * math.pi, 4, 0.05, 30.0)
    found = bound(room(box=False), NOISE, laser, np.array([[3.0, 2.0, 0.0]]))
    assert found.open == 1 and found.beams[0] == 4
    information, beams = information_of(
        room(box=False), np.array([[3.0, 2.0, angle] for angle in laser.angles])
    )
    expected = np.diag([2.0, 2.0, 0.0]) / SIGMA**2
    np.testing.assert_allclose(information, expected, atol=1e-6)
    assert beams == 4


def test_one_wall_leaves_the_way_along_it_open():
    """A wall ahead at a distance d, beams at +-a: x and theta known in closed form, y not."""
    wall = np.zeros((400, 4), bool)
    wall[:, 3] = True
    world = World(wall, np.zeros_like(wall), 0.5, (0.0, -100.0))
    d, a = 1.5, 0.4
    information, _ = information_of(world, np.array([[0.0, 0.0, -a], [0.0, 0.0, a]]))
    c = math.cos(a)
    expected = np.diag([2.0 / c**2, 0.0, 2.0 * (d * math.tan(a) / c) ** 2]) / SIGMA**2
    np.testing.assert_allclose(information, expected, rtol=1e-9, atol=1e-9)
    assert bound(world, NOISE, fan(181, angle=2.0), np.zeros((1, 3))).open == 1


def test_gradients_against_finite_differences_in_the_arena():
    world, poses = arena()
    mount = Pose2(0.2, -0.1, 0.5)
    laser = fan(181, mount)

    def ranges(pose):
        x, y, theta = Pose2(*pose) @ mount
        return world.cast(np.array([[x, y, theta + angle] for angle in laser.angles]))

    for pose in poses[:4]:
        information, counted = by_differences(ranges, pose, 1e-8)
        assert counted > 170
        found = bound(world, dataclasses.replace(NOISE, noise=1e-6), laser, pose[None])
        np.testing.assert_allclose(
            found.covariance[0] * (SIGMA / 1e-6) ** 2, np.linalg.inv(information), rtol=0.01
        )


def test_a_beam_counts_while_its_hit_stays_on_the_face():
    """A face from y = -1.5 to 1.5, hit in the middle or 1 m beside it; the pose slides along y."""
    wall = np.zeros((30, 10), bool)
    wall[12:18, 5] = True
    world = World(wall, np.zeros_like(wall), 0.5, (0.0, -7.5))
    for y, room_left in ((0.0, 1.5), (1.0, 0.5), (-1.0, 0.5)):
        ray = np.array([[0.3, y, 0.0]])
        for slide in (0.01, 0.98 * room_left, 1.02 * room_left, 3.0):
            _, beams = information_of(world, ray, np.diag([0.0, slide**2, 0.0]))
            assert beams == (slide < room_left), (y, slide)
        _, beams = information_of(world, ray, np.diag([4.0, 1e-6, 0.0]))
        assert beams == 1  # towards the wall the hit stays


def test_a_face_ends_where_a_cell_stands_before_it():
    wall = np.zeros((30, 10), bool)
    wall[:, 5] = True
    wall[16, 4] = True  # from y = 0.5 to 1
    world = World(wall, np.zeros_like(wall), 0.5, (0.0, -7.5))
    for slide, counts in ((0.4, True), (0.6, False)):
        assert information_of(world, np.zeros((1, 3)), np.diag([0.0, slide**2, 0.0]))[1] == counts


def test_a_face_ends_at_the_edge_of_the_world():
    wall = np.zeros((30, 10), bool)
    wall[:, 5] = True
    world = World(wall, np.zeros_like(wall), 0.5, (0.0, -7.5))
    for y in (-7.0, 7.0):
        for slide, counts in ((0.4, True), (0.6, False)):
            ray = np.array([[0.3, y, 0.0]])
            assert information_of(world, ray, np.diag([0.0, slide**2, 0.0]))[1] == counts


def test_an_unsure_pose_takes_beams_beside_edges_away():
    world, poses = arena()
    sharp, dull = (bound(world, Errors(s, step=0.0), fan(181), poses) for s in (1e-6, 0.1))
    assert (sharp.beams == 181).all() and (dull.beams < 175).all()


def test_a_turned_or_mirrored_world_turns_or_mirrors_the_bound():
    world, poses = arena()
    laser = fan(181)
    found = bound(world, NOISE, laser, poses)
    left, _, _, top = world.extent
    turned = World(
        np.rot90(world.occupied, -1).copy(),
        np.rot90(world.unknown, -1).copy(),
        world.resolution,
        (-top, left),
    )
    moved = np.stack([-poses[:, 1], poses[:, 0], poses[:, 2] + 0.5 * math.pi], axis=1)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    there = bound(turned, NOISE, laser, moved)
    np.testing.assert_allclose(there.covariance, turn @ found.covariance @ turn.T, rtol=1e-6)
    mirrored = World(
        world.occupied[::-1].copy(), world.unknown[::-1].copy(), world.resolution, (left, -top)
    )
    flip = np.diag([1.0, -1.0, -1.0])
    there = bound(mirrored, NOISE, laser, poses @ flip)
    np.testing.assert_allclose(there.covariance, flip @ found.covariance @ flip, rtol=1e-6)


def test_a_mounted_laser_moves_the_bound_to_the_base():
    world, poses = arena()
    mount = Pose2(0.3, 0.2, 1.0)
    base = np.array([Pose2(*pose) @ mount.inverse() for pose in poses])
    at_laser = bound(world, NOISE, fan(181), poses)
    at_base = bound(world, NOISE, fan(181, mount), base)
    for k in range(len(poses)):
        dx, dy = base[k, :2] - poses[k, :2]
        to_base = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
        np.testing.assert_allclose(
            at_base.covariance[k], to_base @ at_laser.covariance[k] @ to_base.T, rtol=0.03
        )


def likeliest(world, laser, pose, covariance, draws):
    """Errors (draws, 3) of maximum likelihood over a lattice of 17^3 poses, seeded noise."""
    true = world.cast(np.array([[*pose[:2], pose[2] + angle] for angle in laser.angles]))
    noise = np.random.default_rng(1).standard_normal((draws, laser.n_beams))
    measured = true + SIGMA * noise
    axis = np.linspace(-3.2, 3.2, 17)
    lattice = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    offsets = lattice @ np.linalg.cholesky(covariance).T
    rays = np.repeat(pose + offsets, laser.n_beams, axis=0)
    rays[:, 2] += np.tile(laser.angles, len(offsets))
    ranges = np.minimum(world.cast(rays), 30.0).reshape(len(offsets), -1)
    squares = (ranges**2).sum(axis=1) - 2.0 * (measured - true.mean()) @ ranges.T
    squares -= 2.0 * true.mean() * ranges.sum(axis=1)
    return offsets[squares.argmin(axis=1)]


def ratios(world, laser, poses, draws):
    """Root mean squares of maximum likelihood over those of the bound, translation, rotation."""
    found = bound(world, NOISE, laser, poses)
    errors = [
        likeliest(world, laser, pose, covariance, draws)
        for pose, covariance in zip(poses, found.covariance, strict=True)
    ]
    reached = np.sqrt(np.mean(np.square(errors), axis=1))
    translation = np.hypot(reached[:, 0], reached[:, 1]) / found.translation
    return translation, reached[:, 2] / found.rotation


def test_maximum_likelihood_in_the_known_room_reaches_the_bound():
    """Pose by pose within 10 %; 600 draws leave about 3 %."""
    poses = np.array([[1.1, 1.3, 0.3], [4.7, 1.7, 2.0], [2.9, 3.1, -1.0]])
    for ratio in ratios(room(), fan(91), poses, 600):
        assert (np.abs(ratio - 1.0) < 0.10).all(), ratio


def test_maximum_likelihood_in_the_arena_is_little_better_than_the_bound():
    """Edges tell more than the bound knows: most where a beam just misses one, a tenth overall."""
    world, poses = arena()
    for ratio in ratios(world, fan(121), poses, 150):
        assert 0.80 < ratio.mean() < 1.02, ratio
        assert ((ratio > 0.6) & (ratio < 1.15)).all(), ratio


def test_maximum_likelihood_in_the_map_of_robocup_reaches_the_bound(shared_data):
    folder = shared_data("data/robocup")
    log = load(folder / "robocup.npz")
    poses = log.truth_at(log.t)[1000::2000]
    for ratio in ratios(read_world(folder / "robocup.png", 0.03), fan(181), poses, 150):
        assert abs(ratio.mean() - 1.0) < 0.10, ratio


def test_noise_that_grows_dropout_and_rounding():
    world, poses = arena()
    found = bound(world, NOISE, fan(91), poses)
    twice = bound(world, Errors(2.0 * SIGMA, step=0.0), fan(91), poses)
    assert np.median(twice.translation / found.translation) == pytest.approx(2.0, rel=0.02)
    lost = bound(world, Errors(SIGMA, step=0.0, dropout=0.5), fan(91), poses)
    assert np.median(lost.rotation / found.rotation) == pytest.approx(math.sqrt(2.0), rel=0.02)
    step = math.sqrt(12.0) * SIGMA
    rounded = bound(world, Errors(0.0, step=step), fan(91), poses)
    np.testing.assert_allclose(rounded.covariance, found.covariance, rtol=1e-9)
    assert found.strict and not rounded.strict
    with pytest.raises(ValueError, match="no bound exists"):
        bound(world, Errors(0.0, step=0.0), fan(91), poses)


def test_the_deviation_of_a_growing_noise_tells_too():
    """Noise of half the range at 2 m: sigma 1 m, (1 + 2 / 4) / sigma^2."""
    (weight,) = _weights(Errors(0.0, 0.5, step=0.0), fan(91), np.array([[2.0]]), None)
    assert weight[0] == pytest.approx(1.5)
    (weight,) = _weights(Errors(0.6, 0.2, step=0.0), fan(91), np.array([[2.0]]), None)
    assert weight[0] == pytest.approx(1.0 + 2.0 * 0.2**2)


def test_beams_outside_the_limits_or_without_a_reading_do_not_count():
    world, poses = room(), np.array([[1.1, 1.3, 0.3]])
    laser = fan(91)
    found = bound(world, NOISE, laser, poses)
    distances = world.cast(np.array([[1.1, 1.3, 0.3 + angle] for angle in laser.angles]))
    near = dataclasses.replace(laser, range_max=2.0)
    assert bound(world, NOISE, near, poses).beams[0] <= (distances < 2.0).sum() < 91
    ranges = distances.astype(np.float32)[None]
    assert bound(world, NOISE, laser, poses, ranges).beams[0] == found.beams[0]
    halved = dataclasses.replace(NOISE, dropout=0.5)  # the ranges tell which beams are lost
    there = bound(world, halved, laser, poses, ranges)
    np.testing.assert_allclose(there.covariance, found.covariance)
    far = dataclasses.replace(laser, range_min=2.0)
    assert bound(world, NOISE, far, poses).beams[0] <= (distances >= 2.0).sum() < 91
    ranges[0, :20], ranges[0, 20:30], ranges[0, 30:40] = np.nan, np.inf, ranges[0, 30:40] - 0.1
    masked = bound(world, NOISE, laser, poses, ranges)
    assert 40 <= masked.beams[0] <= 51
    assert masked.translation[0] > found.translation[0]
    nothing = bound(world, NOISE, laser, poses, np.full((1, 91), np.inf, np.float32))
    assert nothing.open == 1 and nothing.beams[0] == 0


def test_a_sweep_is_as_good_as_the_poses_it_was_seen_from():
    """A sweep of beams that all start at one pose is a plain scan; moving, one in between."""
    world, poses = arena()
    laser = fan(181)
    plain = bound(world, NOISE, laser, poses)
    still = np.repeat(poses[:, None], 181, axis=1)
    np.testing.assert_allclose(
        bound(world, NOISE, laser, still).covariance, plain.covariance, rtol=1e-12
    )

    def ranges(pose):
        moves = [Pose2(0.001 * i, 0.0005 * i, 0.002 * i) for i in range(181)]
        rays = [Pose2(*pose) @ move for move in moves]
        return world.cast(
            np.array([[x, y, t + a] for (x, y, t), a in zip(rays, laser.angles, strict=True)])
        )

    moving = np.array(
        [
            [Pose2(*p) @ Pose2(0.001 * i, 0.0005 * i, 0.002 * i) for i in range(181)]
            for p in poses[:2]
        ]
    )
    found = bound(world, dataclasses.replace(NOISE, noise=1e-6), laser, moving)
    np.testing.assert_array_equal(found.poses, moving[:, 0])
    for k in range(2):
        information, _ = by_differences(ranges, poses[k], 1e-8)
        np.testing.assert_allclose(
            found.covariance[k] * (SIGMA / 1e-6) ** 2, np.linalg.inv(information), rtol=0.01
        )


def sample(found, seed=0):
    """Poses (n, 3) of a localizer that reaches the bound at every scan by itself, by chance."""
    noise = np.random.default_rng(seed).standard_normal(found.poses.shape)
    roots = np.linalg.cholesky(found.covariance)
    poses = found.poses + (roots @ noise[:, :, None])[:, :, 0]
    poses[:, 2] = wrap_angle(poses[:, 2])
    return poses


def test_expected_errors_are_those_of_poses_drawn_at_the_bound():
    log = log_of(duration=20.0)
    found = bound_of(log)
    truth = log.truth_at(log.t)
    np.testing.assert_allclose(found.poses[:, :2], truth[:, :2])
    for lag in (1, 40, 200):
        expected = found.relative(lag)
        assert expected.translation.shape == (len(log) - lag,)
        drawn = [relative_errors(sample(found, seed), truth, lag) for seed in range(20)]
        translation, rotation = np.mean(drawn, axis=(0, 2))
        assert expected.translation.mean() == pytest.approx(translation, rel=0.02)
        assert expected.rotation.mean() == pytest.approx(rotation, rel=0.02)


def test_mean_length_of_round_and_flat_gaussians():
    world, poses = arena()
    found = bound(world, NOISE, fan(91), poses[:2])
    for covariance, mean in (
        (np.diag([2.0, 2.0, 1.0]), math.sqrt(math.pi)),
        (np.diag([4.0, 0.0, 1.0]), 2.0 * math.sqrt(4.0 / math.pi)),
    ):
        both = dataclasses.replace(
            found, poses=np.zeros((2, 3)), covariance=np.stack([covariance, covariance])
        )
        translation, rotation = both.relative(1)
        expected = mean * math.sqrt(2.0) if covariance[1, 1] else mean
        assert translation[0] == pytest.approx(expected)
        assert rotation[0] == pytest.approx(math.sqrt(4.0 / math.pi))


def test_an_unsure_heading_turns_a_long_motion():
    """10 m along x: the error of the first heading moves the end by 10 m times it, sideways."""
    heading = np.stack([np.diag([0.0, 0.0, 1e-6]), np.zeros((3, 3))])
    poses = np.array([[1.0, 2.0, 0.4], [11.0, 2.0, 0.0]])
    found = Bound(poses, heading, np.ones(2, np.int64), True, np.linalg.pinv(heading)).relative(1)
    assert found.translation[0] == pytest.approx(10.0 * 1e-3 * math.sqrt(2.0 / math.pi))
    assert found.rotation[0] == pytest.approx(1e-3 * math.sqrt(2.0 / math.pi))


def test_bound_of_a_simulated_log():
    """Fractions of a millimeter and of a milliradian from the default sensor."""
    log = log_of()
    found = bound_of(log)
    translation, rotation = found.relative(1)
    assert 0.3e-3 < translation.mean() < 0.9e-3 and 0.05e-3 < rotation.mean() < 0.3e-3
    assert found.strict and found.open == 0 and found.beams.mean() > 1000
    assert errors_of(log, world_of(log)) == Errors(0.01)
    held = bound_of(log, most=10)
    assert len(held.poses) == len(log) and len(np.unique(held.translation)) == 10
    np.testing.assert_array_equal(held.covariance[:16], found.covariance[[0]].repeat(16, axis=0))
    assert held.relative(1).translation.mean() == pytest.approx(translation.mean(), rel=0.1)
    part = bound_of(log.select(every=4))
    np.testing.assert_allclose(part.covariance, found.covariance[::4])


def test_bound_of_a_sweeping_laser_and_of_odd_scans():
    still, swept = (bound_of(log_of(sensor="rplidar-a1", sweep=sweep)) for sweep in (False, True))
    assert np.median(swept.translation) == pytest.approx(np.median(still.translation), rel=0.2)
    plain = bound_of(log_of())
    degraded = bound_of(log_of(dropout=0.3, people=3, mixed=0.5))
    assert degraded.beams.mean() < 0.75 * plain.beams.mean()
    assert degraded.relative(1).translation.mean() > plain.relative(1).translation.mean()


def test_scans_that_the_truth_does_not_cover_are_open():
    log = log_of()
    known = log.truth.t <= log.t[100] + 1e-6
    cut = Track(log.truth.t[known], log.truth.values[known])
    found = bound_of(dataclasses.replace(log, truth=cut))
    assert found.open == len(log) - 101
    assert np.isnan(found.relative(1).translation[-1])


def test_logs_without_a_known_world_or_error_have_no_bound(tmp_path):
    log = log_of()
    assert bound_of(dataclasses.replace(log, meta={"name": "real"})) is None
    assert bound_of(dataclasses.replace(log, truth=None)) is None
    other = {"simulated": log.meta["simulated"] | {"seed": 1}}
    assert bound_of(dataclasses.replace(log, meta=other)) is None
    gone = {"simulated": log.meta["simulated"] | {"sensor": "none"}}
    assert bound_of(dataclasses.replace(log, meta=gone)) is None
    assert not bound_of(log_of(stdr=True)).strict
    log.save(tmp_path / "log.npz")
    loaded = bound_of(load(tmp_path / "log.npz"))
    np.testing.assert_array_equal(loaded.covariance, bound_of(log).covariance)
