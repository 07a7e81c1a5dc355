import math

import numpy as np
import pytest

import slams
from gmapping import GMapping, GMappingParams
from gmapping.key import OLD, SELDOM, KeyScans
from gmapping.map import TileMap
from gmapping.map_kernels import DEPTH, LAYERS, ONCE, Splat, insert
from gmapping.match import lattice
from gmapping.match_kernels import Around, Climb, Prior, linearize, register, search_old
from gmapping.original import Original, OriginalParams
from gmapping.original.map import HitMap
from gmapping.original.match_kernels import ClimbModel, hill_climb, log_likelihood, score
from gmapping.original.motion import Step as OriginalStep
from gmapping.original.scan import EndPoints as OriginalPoints
from gmapping.particles import Particles, normalize, systematic
from gmapping.render import Ends
from gmapping.render_kernels import draw
from gmapping.scan import View
from gmapping.scan_kernels import Walls, merged, surfaces
from gmapping.surfaces import DRIFT, OLD_STEP, SurfaceMatcher
from slams import geometry
from slams.motion.chord import travelled
from slams.registry import find
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Laser, Pose2, Scan, wrap_angle
from tests.gmapping import naive
from tests.places import SHARED

DATA = SHARED / "data"
LASER = Laser(-0.75 * math.pi, math.radians(0.75), 361, 0.1, 30.0)
ROOM = np.array(  # segments x0, y0, x1, y1 [m]
    [
        [-2.0, -1.5, 4.0, -1.5],
        [4.0, -1.5, 4.0, 2.5],
        [4.0, 2.5, -2.0, 2.5],
        [-2.0, 2.5, -2.0, -1.5],
        [1.5, 0.8, 2.2, 1.2],
        [2.2, 1.2, 1.9, 1.8],
        [1.9, 1.8, 1.5, 0.8],
    ]
)
SPLAT = Splat(2, 100.0, 1.0)
HOW = Climb(0.1, 0.03, 12, 0.02**2, 0.0)  # nothing is old
WALLS = Walls(0.12, 0.03, 0.1, 0.1)
CLIMB = ClimbModel(0.05, 0.075, 0.05, 0.05, 5, 0.5)


def cast(pose, laser=LASER, walls=ROOM):
    """Exact ranges of a laser among segments."""
    sensor = pose @ laser.mount
    angles = laser.angles + sensor.theta
    d = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None]
    a, b = walls[:, :2] - [sensor.x, sensor.y], walls[:, 2:] - walls[:, :2]
    det = d[..., 0] * b[:, 1] - d[..., 1] * b[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        r = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / det
        u = (a[:, 0] * d[..., 1] - a[:, 1] * d[..., 0]) / det
    r = np.where((r > 0) & (u >= 0) & (u <= 1), r, np.inf)
    return r.min(axis=1)


def make_scan(pose, t=0.0, laser=LASER, rng=None, odometry=None, yaw=None, walls=ROOM, sd=0.01):
    ranges = cast(pose, laser, walls)
    if rng is not None:
        ranges = ranges + rng.normal(0.0, sd, len(ranges))
    ranges = ranges.astype(np.float32)
    ranges.flags.writeable = False
    return Scan(t, ranges, laser, odometry, yaw)


def drive(n, laser=LASER, odometry=True, gyro=False, noise=True, drift=0.05):
    """True poses on an arc and their scans; odometry stretches every step."""
    rng = np.random.default_rng(7)
    truth, wheels = [IDENTITY], [Pose2(5.0, -3.0, 1.0)]
    for i in range(n - 1):
        step = Pose2(0.02, 0.0, 0.03 * math.cos(0.05 * i))
        truth.append(truth[-1] @ step)
        wheels.append(wheels[-1] @ Pose2(step.x * (1 + drift), 0.0, step.theta * (1 - drift)))
    return truth, [
        make_scan(
            p,
            0.1 * i,
            laser,
            rng if noise else None,
            wheels[i] if odometry else None,
            p.theta + 2.0 if gyro else None,
        )
        for i, p in enumerate(truth)
    ]


def run(scans, preset="default", **changes):
    entry = find(f"gmapping@{preset}")
    slam = entry.cls(entry.params().replace(**changes))
    return slam, np.array([slam.update(scan) for scan in scans])


def position_error(poses, truth):
    return np.hypot(*(poses[:, :2] - np.array(truth)[:, :2]).T)


def points_of(points, grain=0.0):
    """Rows x, y, beams of `merged` of points (n, 2)."""
    out = np.zeros((len(points), 3))
    return out[: merged(np.ascontiguousarray(points.T), len(points), grain, out)]


def pieces_of(points, mount=IDENTITY, increment=0.01, walls=WALLS):
    out = np.zeros((len(points), 5))
    return out[: surfaces(points, len(points), mount, increment, walls, out)]


def surface_of(pose, laser=LASER, walls=ROOM):
    ranges = cast(pose, laser, walls)
    seen = ranges < laser.range_max
    ends = laser.mount.transform(ranges[seen, None] * laser.directions[seen])
    return pieces_of(points_of(ends), laser.mount, laser.angle_increment)


def view_of(pose, **changes):
    return View(GMappingParams(**changes)).take(make_scan(pose), IDENTITY)


def mapped(surface, pose=(0.0, 0.0, 0.0), n=1):
    tiles, poses = (
        TileMap(n, LAYERS, 0.05, 5000, depth=DEPTH),
        np.tile(np.array(pose, float), (n, 1)),
    )
    assert insert(tiles.tiles, poses, surface, SPLAT) == 0
    return tiles


def linearized(tiles, pose, surface, width=0.1, old=0.0):
    """H (3, 3), gradient (3,), cost, beams close by, square distance, what old surfaces spared."""
    h, out = np.zeros((3, 3)), np.zeros(7)
    linearize(tiles, 0, np.array(pose, float), surface, width, old, h, out)
    return h, -out[:3], *out[3:]


def climb(tiles, surface, prior, starts, how=HOW, owners=(0,)):
    """Peaks (k, 3), information (k, 3, 3) and `linearize`'s numbers (k, 7) there."""
    poses = np.array(starts, float)
    h, out = np.zeros((len(poses), 3, 3)), np.zeros((len(poses), 7))
    register(tiles, np.array(owners), surface, prior, how, poses, h, out)
    return poses, h, out


def one(pose, information):
    """The prior of one start."""
    return Prior(np.array(pose, float)[None], information * np.eye(3)[None])


def matcher_of(*poses, **changes):
    """A matcher of as many particles; each has in its map what is seen from 0, put at its pose."""
    params = GMappingParams(**changes)
    matcher = SurfaceMatcher(params, TileMap(len(poses), LAYERS, 0.05, 5000, depth=DEPTH))
    assert matcher.insert(view_of(IDENTITY), np.array(poses, float))
    return matcher


# scans


def test_beams_that_end_close_together_become_their_mean():
    ends = np.array([[r, 0.0] for r in (1.0, 1.02, 1.03, 1.05, 1.06, 3.0)])
    expected = [[3.05 / 3, 0.0, 3.0], [1.055, 0.0, 2.0], [3.0, 0.0, 1.0]]
    np.testing.assert_allclose(points_of(ends, 0.04), expected, atol=1e-6)


def test_a_view_has_all_beams_of_the_scan_in_fewer_pieces():
    view = view_of(IDENTITY)
    assert view.n == len(view.pieces) < LASER.n_beams
    assert view.beams == view.pieces[:, 4].sum() == pytest.approx(LASER.n_beams, abs=6)
    np.testing.assert_allclose(np.hypot(*view.pieces[:, 2:4].T), 1.0)
    assert view.far == pytest.approx(cast(IDENTITY).max(), abs=1e-6)
    ends = view.ends
    np.testing.assert_array_equal(ends, view.pieces[:, :2].astype(np.float32))
    view.take(make_scan(Pose2(0.5, 0.0, 0.0)), IDENTITY)
    assert not np.array_equal(ends, view.ends)  # a copy, to be kept


def test_normals_are_those_of_the_walls_and_face_the_laser():
    surface = surface_of(IDENTITY)
    wall = surface[np.abs(surface[:, 0] - 4.0) < 1e-3]
    inner = wall[(np.abs(wall[:, 1] + 1.5) > 0.3) & (np.abs(wall[:, 1] - 2.5) > 0.3)]
    assert len(inner) > 20
    np.testing.assert_allclose(inner[:, 2:4], [[-1.0, 0.0]] * len(inner), atol=1e-4)
    assert (np.sum(surface[:, :2] * surface[:, 2:4], axis=1) < 0.0).all()


def test_a_point_on_nothing_flat_looks_at_the_laser():
    points = np.array([[1.0, 0.0, 1.0], [3.0, 0.0, 2.0], [1.0, 0.1, 1.0]])
    out = pieces_of(points, increment=0.005)
    assert len(out) == 3
    np.testing.assert_allclose(out[1], [3.0, 0.0, -1.0, 0.0, 2.0])


def test_a_mean_of_beams_counts_as_many_in_normals_and_maps():
    several = np.array([[2.0, 0.1 * k, 3.0 if k == 1 else 1.0] for k in range(-2, 3)])
    several[3, 0] = 2.02
    alone = np.repeat(several, several[:, 2].astype(int), axis=0) * [1.0, 1.0, 0.0] + [0, 0, 1.0]
    walls = Walls(0.5, 0.1, 0.1, 0.1)
    a, b = pieces_of(several, walls=walls), pieces_of(alone, walls=walls)
    assert (len(a), len(b)) == (5, 7)
    np.testing.assert_allclose(a[0, :4], b[0, :4])
    b[3:6] = a[3] * [1, 1, 1, 1, 0] + [0, 0, 0, 0, 1]
    b[[0, 1, 2, 6]] = a[[0, 1, 2, 4]]
    mine, theirs = mapped(a), mapped(b)
    assert mine.used == theirs.used > 0
    used = slice(mine.used)  # the rest of the pool was never touched
    np.testing.assert_allclose(mine.tiles.cells[used], theirs.tiles.cells[used], atol=1e-6)
    pose = [0.02, 0.01, 0.01]
    for x, y in zip(linearized(mine.tiles, pose, a), linearized(mine.tiles, pose, b), strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-6)


# maps of surfaces


def test_insert_and_residuals_equal_the_naive_twin():
    surface = surface_of(Pose2(0.3, 0.2, 0.4))[::3]
    pose = np.array([0.31, -0.12, 0.37])
    tiles = mapped(surface, pose)
    points, normals = surface[:, :2], surface[:, 2:4]
    twin = naive.surface_map(
        naive.moved(pose, points), naive.moved((0, 0, pose[2]), normals), 0.05, 2, 100.0
    )
    near = pose + np.array([0.02, -0.03, 0.01])
    _, _, mine, close, *_ = linearized(tiles.tiles, near, surface)
    r = naive.residuals(twin, near, points, normals, 0.05)
    known = r[np.isfinite(r)]
    cost = np.sum(known**2 * 0.01 / (0.01 + known**2)) + 0.01 * (len(r) - len(known))
    np.testing.assert_allclose(mine, cost, rtol=1e-4)
    assert close == np.sum(np.abs(known) < 0.1)


def test_the_gradient_is_that_of_the_robust_cost():
    surface = surface_of(IDENTITY)
    tiles, gradient = mapped(surface), np.zeros(3)
    tiles.tiles.cells[tiles.tiles.references > 0, :, 4] = 2.0  # so that all is trusted
    pose = np.array([0.011, -0.007, 0.004])
    expected = linearized(tiles.tiles, pose, surface)[1]
    for j in range(3):
        side = []
        for sign in (1, -1):
            near = pose.copy()
            near[j] += sign * 1e-6
            side.append(linearized(tiles.tiles, near, surface)[2])
        gradient[j] = (side[0] - side[1]) / 4e-6
    np.testing.assert_allclose(gradient, expected, rtol=0.02, atol=1e-3)


@pytest.mark.parametrize("offset", [(0.05, -0.04, 0.03), (-0.06, 0.03, -0.04)])
def test_register_finds_a_known_motion_both_ways(offset):
    there = Pose2(*offset)
    for a, b in ((IDENTITY, there), (there, IDENTITY)):
        tiles, surface = mapped(surface_of(a), a), surface_of(b)
        poses, _, _ = climb(tiles.tiles, surface, one(a, 1.0), [a])
        np.testing.assert_allclose(poses[0], b, atol=2e-3)


def test_the_prior_holds_what_the_scan_leaves_open():
    corridor = np.array([[-50.0, 1.0, 50.0, 1.0], [50.0, -1.0, -50.0, -1.0]])
    laser = Laser(-math.pi, math.radians(1.0), 360, 0.1, 5.0)
    surface, start = surface_of(IDENTITY, laser, corridor), np.array([[0.2, 0.03, 0.01]])
    poses, h, _ = climb(mapped(surface).tiles, surface, one(start[0], 1e4), start)
    np.testing.assert_allclose(poses, [[0.2, 0.0, 0.0]], atol=2e-3)
    assert abs(h[0, 0, 0]) < 1e-9 * h[0, 1, 1]


def test_a_prior_that_is_far_off_lets_go():
    surface = surface_of(IDENTITY)
    poses, _, _ = climb(
        mapped(surface).tiles, surface, one([1.0, -1.0, 0.5], 1e4), np.zeros((1, 3))
    )
    np.testing.assert_allclose(poses, 0.0, atol=2e-3)


def test_one_step_weighs_scan_and_prior_as_by_hand():
    surface, start = surface_of(IDENTITY), np.array([0.02, 0.01, -0.01])
    tiles = mapped(surface).tiles
    known = np.array([[40.0, 3.0, 5.0], [3.0, 30.0, 2.0], [5.0, 2.0, 20.0]])
    prior = Prior(np.array([[0.1, -0.2, 0.3]]), known[None])
    poses, _, _ = climb(tiles, surface, prior, [start], HOW._replace(steps=1, wide=0.03))
    h, gradient, *_ = linearized(tiles, start, surface, 0.03)
    off = prior.poses[0] - start
    w = HOW.variance * (geometry.FREEDOM + 3.0) / (geometry.FREEDOM + off @ known @ off)
    step = np.linalg.solve(h + w * known, w * known @ off - gradient)
    np.testing.assert_allclose(poses[0], start + step, atol=1e-12)


def test_a_surface_seen_once_is_trusted_by_once():
    surface = surface_of(IDENTITY)
    tiles, pose = mapped(surface).tiles, [0.02, 0.01, 0.01]
    h, gradient, cost, *_ = linearized(tiles, pose, surface)
    assert insert(tiles, np.zeros((1, 3)), surface, SPLAT) == 0
    np.testing.assert_allclose(linearized(tiles, pose, surface)[0], h, rtol=1e-5)  # the same scan
    assert insert(tiles, np.zeros((1, 3)), surface, SPLAT._replace(driven=1.2)) == 0
    h2, gradient2, cost2, *_ = linearized(tiles, pose, surface)
    np.testing.assert_allclose(h, ONCE * h2, rtol=1e-5)
    np.testing.assert_allclose(gradient, ONCE * gradient2, rtol=1e-3)
    assert cost == pytest.approx(cost2, rel=1e-5)


def test_cells_know_how_many_scans_saw_them_and_the_way_then():
    tiles, surface = mapped(surface_of(IDENTITY)).tiles, surface_of(IDENTITY)
    for driven in (7.0, 9.0):
        insert(tiles, np.zeros((1, 3)), surface, SPLAT._replace(driven=driven))
    insert(tiles, np.array([[0.3, 0.0, 0.0]]), surface, SPLAT._replace(driven=11.0))
    seen = tiles.cells[tiles.references > 0].reshape(-1, DEPTH)
    seen = {tuple(row) for row in seen[seen[:, 3] > 0.0, 4:].tolist()}
    assert seen == {(3.0, 9.0, 1.0), (4.0, 11.0, 1.0), (1.0, 11.0, 11.0)}


def test_search_finds_the_start_gauss_newton_cannot():
    matcher, view, far = matcher_of(IDENTITY), view_of(IDENTITY), Pose2(0.6, 0.5, -0.29)
    prior = geometry.Prior(far, np.eye(3) / 0.3**2)
    assert np.abs(matcher.match(view, 0, prior, far).pose).max() > 0.1
    found = matcher.search(view, 0, far, np.array([0.6, 0.6, 0.3]))
    np.testing.assert_allclose(found, 0.0, atol=0.06)


def test_a_match_tells_quality_noise_and_cost():
    matcher, there = matcher_of(IDENTITY), Pose2(0.03, -0.02, 0.02)
    view = view_of(there)
    match = matcher.match(view, 0, geometry.Prior(IDENTITY, np.eye(3)), IDENTITY)
    np.testing.assert_allclose(match.pose, there, atol=2e-3)
    h, _, cost, close, squares, _ = linearized(
        matcher._tiles.tiles, match.pose, view.pieces, GMappingParams().width
    )
    assert match.quality == pytest.approx(close / view.beams) and match.quality > 0.9
    assert match.square == pytest.approx(max(squares, view.noise**2), rel=1e-3)
    np.testing.assert_allclose(match.seen, h / match.square, rtol=1e-3)
    worth = min(1.0, GMappingParams().independent / view.beams) / matcher.variance
    assert match.cost == pytest.approx(0.5 * worth * cost, rel=1e-3)


def test_many_starts_climb_as_each_alone_in_the_map_of_its_owner():
    tiles = TileMap(3, LAYERS, 0.05, 5000, depth=DEPTH).tiles
    surface = surface_of(IDENTITY)
    insert(tiles, np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.2]]), surface, SPLAT)
    starts = np.array([[0.52, 0.03, 0.01], [-0.03, 0.02, 0.01]])
    prior = Prior(starts, np.tile(np.eye(3), (2, 1, 1)))
    poses, _, out = climb(tiles, surface, prior, starts, owners=(1, 0))
    np.testing.assert_allclose(poses, [[0.5, 0, 0], [0, 0, 0]], atol=2e-3)
    for k, owner in enumerate((1, 0)):
        alone = climb(tiles, surface, one(starts[k], 1.0), starts[[k]], owners=(owner,))
        np.testing.assert_array_equal(alone[0][0], poses[k])
        np.testing.assert_array_equal(alone[2][0], out[k])


def proposals(n, spread):
    """Particles with one map after their draws, and the one proposal they are drawn from."""
    slam = GMapping(GMappingParams(n_particles=n, spread=spread, max_tiles=5000))
    view, way = view_of(IDENTITY), Pose2(0.03, 0.02, 0.01)
    tiles = mapped(surface_of(IDENTITY)).tiles
    slam.tiles.tiles = tiles._replace(tables=np.repeat(tiles.tables, n, axis=0))
    slam._keys.done(IDENTITY)
    slam._track.pose = way
    slam._propose(view)
    information = slam._keys.information(way, np.array([way.theta]), np.eye(3))
    return slam.particles, slam._matcher.propose(view, np.array([way]), information)


def test_draws_have_the_covariance_of_their_proposal_and_new_ground_weighs_none():
    particles, found = proposals(4000, 1.0)
    information = found.factors[0] @ found.factors[0].T
    np.testing.assert_allclose(particles.poses.mean(axis=0), found.peaks[0], atol=3e-4)
    np.testing.assert_allclose(np.cov(particles.poses.T) @ information, np.eye(3), atol=0.15)
    np.testing.assert_array_equal(particles.log_w, 0.0)


def test_a_proposal_has_the_information_of_scan_and_way():
    matcher, view, known = matcher_of(IDENTITY), view_of(IDENTITY), np.diag([400.0, 300.0, 900.0])
    found = matcher.propose(view, np.zeros((1, 3)), known[None])
    h = linearized(matcher._tiles.tiles, found.peaks[0], view.pieces, GMappingParams().width)[0]
    worth = min(1.0, GMappingParams().independent / view.beams) / matcher.variance
    information = found.factors[0] @ found.factors[0].T
    np.testing.assert_allclose(information, worth * h + known, rtol=1e-3, atol=1.0)


def test_without_spread_a_proposal_is_the_peak():
    particles, found = proposals(3, 0.0)
    np.testing.assert_allclose(particles.poses, np.repeat(found.peaks, 3, axis=0), atol=1e-12)


# ground of old


def test_only_ground_of_old_weighs_a_particle():
    matcher, view = matcher_of([0.0, 0.0, 0.0], [0.06, 0.0, 0.0]), view_of(IDENTITY)
    matcher.driven = 9.0
    assert matcher.insert(view, np.array([[0.0, 0.0, 0.0], [0.06, 0.0, 0.0]]))  # seen again: as old
    sure, at = np.tile(1e7 * np.eye(3), (2, 1, 1)), np.zeros((2, 3))
    matcher.driven = 1.0 + OLD - 0.1
    np.testing.assert_array_equal(matcher.propose(view, at, sure).log_w, 0.0)
    matcher.driven = 1.0 + OLD + 0.1
    found = matcher.propose(view, at, sure)
    old = matcher.driven - OLD
    spared = linearized(
        matcher._tiles.tiles, found.peaks[0], view.pieces, GMappingParams().width, old
    )[5]
    worth = min(1.0, GMappingParams().independent / view.beams) / matcher.variance
    assert found.log_w[0] == pytest.approx(0.5 * worth * spared, rel=1e-3)
    assert found.log_w[0] > found.log_w[1] + 5.0  # its map is elsewhere


def test_search_old_finds_a_shifted_old_map():
    surface, far = surface_of(IDENTITY), np.array([[0.55, -0.5, 0.05]])
    tiles, off = mapped(surface).tiles, lattice(DRIFT, OLD_STEP)
    for old, expected in ((2.0, np.zeros((1, 3))), (0.5, far)):
        poses, share = far.copy(), np.zeros(1)
        how, around = HOW._replace(old=old), Around(off, np.zeros(len(off)), 3)
        search_old(tiles, np.zeros(1, np.int64), surface, around, how, poses, share)
        assert (np.abs(poses - expected) <= 0.5 * OLD_STEP + 1e-9).all()
        assert share[0] > 0.6 if old > 1.0 else share[0] == 0.0


@pytest.mark.parametrize("returns", [True, False])
def test_a_particle_that_may_be_on_ground_of_old_looks_for_it(returns):
    matcher, view, far = matcher_of(IDENTITY), view_of(IDENTITY), np.array([[0.55, -0.5, 0.05]])
    matcher.driven, matcher.returns = 2.0 + OLD, returns
    peak = matcher.propose(view, far, np.diag([1e4, 1e4, 1e4])[None]).peaks[0]
    if returns:
        np.testing.assert_allclose(peak, 0.0, atol=5e-3)
    else:
        assert math.hypot(*peak[:2]) > 0.3


def test_a_robot_returns_where_it_was_long_ago_and_looks_seldom():
    keys = KeyScans(GMappingParams())
    for i in range(30):
        keys.done(Pose2(0.5 * i, 0.0, 0.0))
        assert not keys.returns(IDENTITY)
    for i in range(30, 41):
        keys.done(Pose2(0.5 * i, 0.0, 0.0))
    assert keys.driven == pytest.approx(21.0, abs=0.1)
    assert not keys.returns(Pose2(20.0, 0.0, 0.0))
    assert not keys.returns(Pose2(10.0, 0.0, 0.0))  # not so long ago
    assert not keys.returns(Pose2(2.0, 4.0, 0.0))
    assert keys.returns(Pose2(2.0, 1.0, 0.0))
    assert not keys.returns(Pose2(2.0, 1.0, 0.0))
    keys.done(Pose2(20.0, SELDOM, 0.0))
    assert keys.returns(Pose2(2.0, 1.0, 0.0))


# the original's matcher


@pytest.fixture(scope="module")
def hits():
    rng = np.random.default_rng(1)
    points, hit_map = rng.uniform(-0.5, 0.5, (60, 2)), HitMap(OriginalParams(max_tiles=500), 1)
    assert hit_map.insert(points, np.zeros((1, 3)))
    return hit_map.tiles, points


def test_score_and_likelihood_equal_the_naive_twin(hits):
    tiles, points = hits
    cells = naive.hit_map(points[:, :2], 0.05)
    pose = np.array([0.03, -0.02, 0.1])
    there = naive.moved(pose, points[:, :2])
    expected = naive.score(cells, there, 0.05, 0.05)
    assert score(tiles, 0, pose, points, 0.05, -1.0) == pytest.approx(expected, rel=1e-5)
    expected = naive.log_likelihood(cells, there, 0.05, 0.075, 0.5)
    assert log_likelihood(tiles, 0, pose, points, CLIMB) == pytest.approx(expected, rel=1e-5)


def test_a_single_hit_scores_by_its_distance(hits):
    tiles, point = HitMap(OriginalParams(), 1), np.array([[1.0, 0.0]])
    tiles.insert(point, np.zeros((1, 3)))
    near, far = np.array([0.04, 0.0, 0.0]), np.array([0.12, 0.0, 0.0])
    assert score(tiles.tiles, 0, near, point, 0.05, -1.0) == pytest.approx(
        math.exp(-0.0016 / 0.05), rel=1e-4
    )
    assert score(tiles.tiles, 0, far, point, 0.05, -1.0) == 0.0
    assert log_likelihood(tiles.tiles, 0, far, point, CLIMB) == pytest.approx(-0.5 / 0.075)


def test_the_climb_stops_at_the_finest_step_and_never_gets_worse(hits):
    tiles, points = hits
    pose = np.array([0.03, 0.02, 0.02])
    before = score(tiles, 0, pose, points, 0.05, -1.0)
    found = hill_climb(tiles, 0, points, CLIMB, pose)
    assert found > before
    assert found == score(tiles, 0, pose, points, 0.05, -1.0)
    assert np.abs(pose).max() < 0.004


def test_a_climb_without_overlap_stays_and_scores_nothing(hits):
    pose = np.array([20.0, 0.0, 0.0])
    assert hill_climb(hits[0], 0, hits[1], CLIMB, pose) == 0.0
    np.testing.assert_array_equal(pose, [20.0, 0.0, 0.0])


def test_motion_noise_has_the_originals_moments():
    slam = Original(OriginalParams(n_particles=20_000, seed=5))
    step, particles = OriginalStep(Pose2(0.5, -0.2, 0.3), 0.1, True), slam.particles
    slam._move(step)
    assert slam.pose == IDENTITY @ step.pose
    expected = [
        0.1 * (0.5 + 0.06) + 0.03,
        0.1 * (0.2 + 0.15) + 0.03,
        0.06 + 0.2 * math.hypot(0.5, 0.2),
    ]
    np.testing.assert_allclose(particles.poses.mean(axis=0), step.pose, atol=0.004)
    np.testing.assert_allclose(particles.poses.std(axis=0), expected, rtol=0.03)


def test_a_robot_at_rest_gets_no_noise_from_the_original():
    slam = Original(OriginalParams(n_particles=10))
    slam._move(OriginalStep(IDENTITY, 0.1, True))
    assert not slam.particles.poses.any()


def test_the_originals_beams_are_half_a_beam_off_and_not_those_of_its_picture():
    step, scan = OriginalStep(IDENTITY, 0.0, True), make_scan(IDENTITY)
    off, true = (OriginalPoints(OriginalParams(), offset)(scan, step) for offset in (-0.5, 0.0))
    turned = np.arctan2(off[:, 1], off[:, 0]) - np.arctan2(true[:, 1], true[:, 0])
    np.testing.assert_allclose(turned, -0.5 * LASER.angle_increment, atol=1e-9)
    np.testing.assert_allclose(true, scan.ranges[:, None] * LASER.directions, atol=1e-6)
    slam = Original(OriginalParams())
    slam.update(scan)
    np.testing.assert_array_equal(slam._rays(scan, step), true)
    np.testing.assert_array_equal(slam._points(scan, step), off)


@pytest.mark.parametrize("seconds", [0.0, 0.5])
@pytest.mark.parametrize("way", [Pose2(0.3, -0.1, 0.0), Pose2(0.0, 0.0, 0.2)])
def test_the_originals_sweep_is_taken_out_as_the_defaults_is(seconds, way):
    laser = Laser(-2.0, 0.02, 200, 0.1, 30.0, Pose2(0.2, 0.1, 0.4), time_increment=0.001)
    scan, params = make_scan(IDENTITY, laser=laser), OriginalParams(deskew=True)
    found = OriginalPoints(params, 0.0)(scan, OriginalStep(way, seconds, True))
    velocity = Pose2(*(v / seconds if seconds else 0.0 for v in way))
    ours = EndPoints(GMappingParams()).take(scan, velocity)
    middle = travelled(velocity, 0.5 * laser.sweep_time)  # there ours are, the original's at first
    assert ours.n == len(found)
    np.testing.assert_allclose(middle.transform(ours.points[:2, : ours.n].T), found, atol=1e-9)


def test_noise_between_key_scans_is_that_of_the_way_whatever_the_rate():
    p, way, headings = GMappingParams(), Pose2(0.3, -0.4, 0.2), np.array([0.2, 1.3])
    xy = p.tracked_noise * (p.way_per_way * 0.5 + p.way_per_turn * 0.2) + p.key_noise
    theta = p.tracked_noise * (p.turn_per_way * 0.5 + p.turn_per_turn * 0.2) + p.key_noise
    noise, keys = np.diag([xy, xy, theta]) ** 2, KeyScans(p)
    predicted = np.diag([0.04, 0.01, 0.09])

    def covariances():
        return np.linalg.inv(keys.information(way, headings, predicted))

    np.testing.assert_allclose(covariances(), [noise, noise], atol=1e-12)
    keys.missed()  # the way is not tracked
    np.testing.assert_allclose(covariances(), [noise + predicted] * 2, atol=1e-12)
    keys.done(way)
    np.testing.assert_allclose(covariances(), [noise, noise], atol=1e-12)


# weights and resampling


def test_weights_and_n_eff_by_hand():
    w, n_eff = normalize(np.log([1.0, 2.0, 1.0]) - 900.0, 1.0)
    np.testing.assert_allclose(w, [0.25, 0.5, 0.25])
    assert n_eff == pytest.approx(1.0 / (0.0625 + 0.25 + 0.0625))
    assert normalize(np.full(3, -5.0), 1.0)[1] == pytest.approx(3.0)
    np.testing.assert_allclose(normalize(np.log([1.0, 16.0]), 4.0)[0], [1 / 3, 2 / 3])


def test_mean_offspring_is_n_times_the_weight():
    rng = np.random.default_rng(11)
    w, count = np.array([0.05, 0.4, 0.0, 0.22, 0.33]), np.zeros(5)
    for _ in range(20_000):
        count += np.bincount(systematic(w, rng.random()), minlength=5)
    np.testing.assert_allclose(count / 20_000, 5 * w, atol=0.015)


def test_systematic_resampling_with_a_known_draw():
    out = systematic(np.array([0.1, 0.2, 0.3, 0.4]), 0.5)
    np.testing.assert_array_equal(out, [1, 2, 3, 3])
    out = systematic(np.array([0.0, 1.0 - 1e-9, 0.0, 0.0]), 0.999999999999)
    assert (out == 1).all()
    assert systematic(np.array([0.0, 0.5, 0.5]), 0.0)[0] == 1


def test_histories_follow_ancestors_and_the_reported_particle_has_a_margin():
    particles = Particles(3)
    particles.poses[:, 0] = [1.0, 2.0, 3.0]
    particles.remember()
    particles.weigh(np.array([-1.0, 0.0, -6.0]), 1.0)
    assert not particles.elect(2.0)
    assert particles.elect(0.5)
    assert particles.best == 1
    particles.follow(np.array([1, 1, 0]))
    assert particles.best == 0
    particles.poses[:, 0] += 10.0
    particles.remember()
    np.testing.assert_array_equal(particles.history(1)[:, 0], [2.0, 12.0])
    np.testing.assert_array_equal(particles.history(2)[:, 0], [1.0, 11.0])


# tiles


def references_add_up(tiles):
    pointers = np.bincount(
        tiles.tables[tiles.tables >= 0].astype(int), minlength=len(tiles.references)
    )
    np.testing.assert_array_equal(pointers, tiles.references)
    free = tiles.free[1 : tiles.free[0] + 1]
    assert sorted(free) == sorted(np.flatnonzero(pointers == 0))


def test_writing_to_one_particle_never_shows_in_another():
    surface = surface_of(IDENTITY)
    tiles = mapped(surface, n=3)
    tiles.inherit(np.array([0, 0, 2]))
    assert tiles.shared == pytest.approx(1 / 3)
    before = [
        tiles.tiles.cells[tiles.tiles.tables[i]][tiles.tiles.tables[i] >= 0] for i in range(3)
    ]
    insert(tiles.tiles, np.array([[0.01, 0.0, 0.0]]), surface, SPLAT)  # particle 0 alone
    after = [tiles.tiles.cells[tiles.tiles.tables[i]][tiles.tiles.tables[i] >= 0] for i in range(3)]
    assert not np.array_equal(before[0], after[0])
    np.testing.assert_array_equal(before[1], after[1])
    np.testing.assert_array_equal(before[2], after[2])
    references_add_up(tiles.tiles)


def test_a_copied_tile_keeps_what_it_held():
    surface = surface_of(IDENTITY)
    tiles = mapped(surface, n=2)
    tiles.inherit(np.zeros(2, np.int64))
    close = linearized(tiles.tiles, np.zeros(3), surface)[3]
    assert insert(tiles.tiles, np.zeros((1, 3)), surface[:1], SPLAT) == 0
    assert tiles.shared < 0.5  # the tile around that point was copied
    assert linearized(tiles.tiles, np.zeros(3), surface)[3] == close


def test_nothing_leaks_in_ten_thousand_resamplings():
    rng = np.random.default_rng(2)
    surface = surface_of(IDENTITY)[::40]
    tiles = mapped(surface, n=5)
    alone = tiles.used // 5
    for i in range(10_000):
        tiles.inherit(rng.integers(0, 5, 5))
        if i % 100 == 0:
            poses = rng.normal(0.0, 0.01, (5, 3))
            assert insert(tiles.tiles, poses, surface, SPLAT) == 0
    references_add_up(tiles.tiles)
    tiles.inherit(np.zeros(5, np.int64))
    assert tiles.used <= 2 * alone


def test_growth_keeps_every_cell_where_it_was():
    surface = surface_of(IDENTITY)
    tiles, away = mapped(surface), np.array([[-30.0, 20.0, 0.0]])
    before, used = linearized(tiles.tiles, np.zeros(3), surface), tiles.used
    assert insert(tiles.tiles, away, surface, SPLAT) > 0  # outside the tables
    assert tiles.used == used
    tiles.cover(np.array([-40.0, -3.0]), np.array([2.0, 25.0]))
    after = linearized(tiles.tiles, np.zeros(3), surface)
    for a, b in zip(before, after, strict=True):
        np.testing.assert_array_equal(a, b)
    assert insert(tiles.tiles, away, surface, SPLAT) == 0


def test_memory_is_bounded_by_sharing_one_map():
    truth, scans = drive(60)
    free, _ = run(scans, n_particles=6)
    assert free.report()["tiles_peak"] > 200
    slam, poses = run(scans, n_particles=6, max_tiles=200)
    report = slam.report()
    assert report["tiles_peak"] <= 200
    assert report["collapsed"] > 0
    assert position_error(poses, truth).max() < 0.05


def test_after_the_pool_was_full_all_particles_have_the_same_map():
    slam = GMapping(GMappingParams(n_particles=6, max_tiles=200))
    for scan in drive(60)[1]:
        slam.update(scan)
        if slam.report()["collapsed"]:
            break
    tables = slam.tiles.tiles.tables
    assert (tables == tables[0]).all()
    references_add_up(slam.tiles.tiles)


def test_resampled_particles_go_on_with_pose_and_map_of_their_ancestor():
    slam, _ = run(drive(20)[1], n_particles=4, spread=1.0)
    pose, table = slam.particles.poses[1].copy(), slam.tiles.tiles.tables[1].copy()
    assert not np.array_equal(table, slam.tiles.tiles.tables[2])
    slam.particles.weigh(np.array([-90.0, 0.0, -90.0, -90.0]), 1.0)
    slam._follow(slam.particles.draw_ancestors(0.5))
    np.testing.assert_array_equal(slam.particles.poses, np.tile(pose, (4, 1)))
    np.testing.assert_array_equal(slam.tiles.tiles.tables, np.tile(table, (4, 1, 1, 1)))
    references_add_up(slam.tiles.tiles)


def test_a_loop_closes_for_every_particle():
    rng = np.random.default_rng(4)
    truth, wheels, scans = IDENTITY, IDENTITY, []
    short = Laser(LASER.angle_min, LASER.angle_increment, 361, 0.1, 2.5)
    for i in range(210):  # a circle and a bit, walls in sight only when near
        scans.append(make_scan(truth, 0.1 * i, short, rng, wheels))
        truth = truth @ Pose2(0.03, 0.0, 2.0 * math.pi / 200)
        wheels = wheels @ Pose2(0.0315, 0.0, 2.0 * math.pi / 200 + rng.normal(0.001, 0.002))
    slam, poses = run(scans, n_particles=10, spread=1.0)
    expected = Pose2(0.0, 0.0, 0.0)
    for _ in range(209):
        expected = expected @ Pose2(0.03, 0.0, 2.0 * math.pi / 200)
    assert math.hypot(poses[-1, 0] - expected.x, poses[-1, 1] - expected.y) < 0.03
    ends = np.array([slam.particles.history(i)[-1] for i in range(10)])
    assert ends.std(axis=0).max() < 0.02
    assert len(slam.trajectory()) == slam.report()["inserted"]


# the picture


def test_beams_clear_what_they_cross_and_mark_their_end():
    hits, visits = np.zeros((3, 7), np.int32), np.zeros((3, 7), np.int32)
    corner = np.array([0, 0], np.int64)
    draw(np.array([[0.30, 0.05], [0.0, 0.10]]), np.array([0.0, 0.05]), 0.05, corner, hits, visits)
    np.testing.assert_array_equal(visits, [[0] * 7, [2, 1, 1, 1, 1, 1, 1], [1] + [0] * 6])
    np.testing.assert_array_equal(hits, [[0] * 7, [0] * 6 + [1], [1] + [0] * 6])


def test_the_map_has_walls_where_the_room_has():
    _, scans = drive(40)
    grid = run(scans, n_particles=4)[0].map()
    x, y = grid.origin

    def p(px, py):
        return grid.p[int((py - y) / grid.resolution), int((px - x) / grid.resolution)]

    assert max(p(4.0, 0.5), p(3.96, 0.5), p(4.04, 0.5)) > 0.5
    assert p(1.0, 0.0) < 0.1
    assert np.isnan(grid.p).any()


# the whole filter


@pytest.mark.parametrize("wheels", [True, False])
@pytest.mark.parametrize("gyro", [True, False])
def test_every_odometry_tracks(wheels, gyro):
    truth, scans = drive(120, gyro=True)
    slam, poses = run(scans, n_particles=5, wheels=wheels, gyro=gyro)
    error = position_error(poses, truth)
    assert error.max() < 0.03 and error.mean() < 0.008
    report = slam.report()
    assert report["odometry"] == (119 if wheels else 0)
    assert report["gyro"] == (119 if gyro else 0)


def test_the_original_corrects_odometry_and_without_it_needs_one_particle():
    truth, scans = drive(120, drift=0.1)
    slam, poses = run(scans, "original", n_particles=8, linear_update=0.3)
    wheels = np.array([scans[0].odometry.between(s.odometry) for s in scans])
    assert position_error(poses, truth)[-1] < 0.6 * position_error(wheels, truth)[-1]
    truth, scans = drive(40, odometry=False)
    slam, poses = run(scans, "original")
    assert slam.report()["particles"] == 1
    assert slam.report()["inserted"] == 40
    assert position_error(poses, truth).max() < 0.1


def swept(at, t, laser):
    """A scan whose beams follow one another while the base moves; at(t) is the base's pose."""
    ranges = np.zeros(laser.n_beams, np.float32)
    for i, angle in enumerate(laser.angles):
        beam = Laser(angle, 0.0, 1, 0.1, 30.0)
        ranges[i] = cast(at(t + i * laser.time_increment), beam)[0]
    ranges.flags.writeable = False
    return Scan(t, ranges, laser)


def test_a_slow_sweep_is_seen_again_with_the_motion_that_was_found():
    laser = Laser(-math.pi, math.radians(2.0), 180, 0.1, 30.0, time_increment=0.2 / 180)

    def at(t):  # from rest along an arc
        return Pose2(0.0, 0.0, 0.3 * t * t / 2) @ Pose2(0.15 * t * t, 0.0, 0.0)

    times = 0.2 * np.arange(16)
    _, poses = run([swept(at, t, laser) for t in times], n_particles=2)
    truth = np.array([at(t) for t in times])
    assert position_error(poses, truth).max() < 0.03
    assert np.abs(poses[:, 2] - truth[:, 2]).max() < 0.03


def test_a_mounted_laser_gives_the_pose_of_the_base():
    laser = Laser(
        LASER.angle_min, LASER.angle_increment, LASER.n_beams, 0.1, 30.0, Pose2(0.2, -0.1, 0.7)
    )
    truth, scans = drive(60, laser)
    assert position_error(run(scans, n_particles=3)[1], truth).max() < 0.03


def test_where_odometry_stands_still_the_last_motion_is_tried():
    slam, _ = run([make_scan(IDENTITY, 0.1 * i) for i in range(3)], n_particles=2)
    moved = Pose2(1.2, 0.3, 0.35)  # farther than a search goes
    scan = make_scan(moved, 0.8)
    start, view = slam._track.predict(scan), slam._view.take(scan, IDENTITY)
    stands = slam._tracked(view, start._replace(continued=IDENTITY)).pose
    assert math.hypot(stands.x - moved.x, stands.y - moved.y) > 0.2
    slam._unsearched = 1.0
    goes_on = start._replace(continued=moved @ Pose2(0.02, 0.02, 0.01))
    np.testing.assert_allclose(slam._tracked(view, goes_on).pose, moved, atol=0.01)
    assert slam.report()["recovered"] >= 1


def test_a_noisy_laser_is_not_taken_for_a_lost_robot():
    truth, scans = drive(80, noise=False)
    rng = np.random.default_rng(6)
    scans = [
        make_scan(p, s.t, LASER, rng, s.odometry, None, ROOM, 0.04)
        for p, s in zip(truth, scans, strict=True)
    ]
    slam, poses = run(scans, n_particles=2)
    assert slam._view.noise == pytest.approx(0.04, rel=0.2)
    assert slam.quality > 0.9
    assert slam.report()["searched"] < 8
    assert position_error(poses, truth).max() < 0.05


def test_odometry_that_freezes_and_catches_up_does_not_carry_the_pose_away():
    truth, scans = drive(80, noise=False)
    for i in range(40, 48):
        s = scans[i]
        scans[i] = Scan(s.t, s.ranges, s.laser, scans[40].odometry)
    jump = scans[48].odometry @ Pose2(0.4, 0.0, 0.5)
    tail = [jump @ scans[48].odometry.between(s.odometry) for s in scans[48:]]
    scans[48:] = [Scan(s.t, s.ranges, s.laser, o) for s, o in zip(scans[48:], tail, strict=True)]
    _, poses = run(scans, n_particles=3)
    assert position_error(poses, truth).max() < 0.05


def there_and_back(looks):
    """A corridor, its end in sight only at first and at last; amid, the particles are set apart.

    Every third particle stays where it is, the others are moved along the corridor. `looks`
    whether particles look for ground of old. Returns the filter, its poses, the truth, and the
    generation in which the particles were moved.
    """
    walls = np.array([[-1, 1, 30, 1], [30, -1, -1, -1], [-1, -1, -1, 1]], float)
    laser, rng = Laser(-math.pi, math.radians(1.0), 360, 0.1, 3.0), np.random.default_rng(8)
    way = 10.0 - np.hypot(0.05 * np.arange(400) - 10.0, 0.5)  # it brakes before it turns back
    truth = [Pose2(x, 0.0, 0.0) for x in (way - way[0]).tolist()]
    slam, poses = GMapping(GMappingParams(n_particles=24, linear_update=0.4)), []
    if not looks:
        slam._keys.returns = lambda pose: False
    for i, pose in enumerate(truth):
        poses.append(slam.update(make_scan(pose, 0.1 * i, laser, rng, pose, walls=walls)))
        if i == 200:
            apart, best = 0.6 * (np.arange(24) % 3 - 1), 0  # which is reported, and astray
            slam.particles.best = best
            here = slam.pose._replace(x=slam.pose.x + apart[best])
            slam.particles.poses[:, 0] += apart
            slam.particles.move(np.array(slam.particles.best_pose.between(here)))
            slam.particles.remember()
            slam._renderer.keep(Ends(slam._view.ends, slam._view.mount).ray)
            slam._track.corrected(here)
            slam._keys.done(here)
            generation = len(slam.trajectory()) - 1
    return slam, np.array(poses), truth, generation


def test_the_right_hypothesis_survives_a_way_back_to_known_ground():
    slam, poses, truth, generation = there_and_back(looks=False)
    error = position_error(poses, truth)
    assert error[201:300].min() > 0.5  # a wrong one leads while the end is out of sight
    assert error[-1] < 0.05
    there = truth[200].x
    right = [abs(slam.particles.history(i)[generation, 0] - there) < 0.1 for i in range(24)]
    assert sum(right) >= 16  # they were 8
    assert slam.particles.w[right].sum() > 0.999
    references_add_up(slam.tiles.tiles)


def test_particles_that_look_for_ground_of_old_close_the_loop():
    slam, poses, truth, _ = there_and_back(looks=True)
    error = position_error(poses, truth)
    assert error[201:300].min() > 0.5
    assert error[-1] < 0.05
    assert slam.report()["closed"] >= 1


def test_a_closed_loop_moves_the_track_and_is_no_motion():
    _, scans = drive(30)
    (slam, _), (other, _) = (run(scans[:-1], n_particles=2) for _ in range(2))
    particles, pose = slam.particles, other.pose
    particles.poses[:] = pose
    particles.poses[1, 1] += 0.3
    particles.best, particles.lifetime[:] = 0, [0.0, slam.params.switch_margin - 1.0]
    slam._elect()
    assert (slam.pose, slam.report()["closed"]) == (pose, 0)
    particles.lifetime[1] += 2.0
    slam._elect()
    assert slam.report()["closed"] == 1
    np.testing.assert_allclose(slam.pose, [pose.x, pose.y + 0.3, pose.theta])
    step, expected = (s._track.predict(scans[-1]).step for s in (slam, other))
    assert step == expected


# contract


def test_same_seed_same_poses_and_instances_do_not_meet():
    _, scans = drive(50)
    a = GMapping(GMappingParams(n_particles=4, spread=1.0))
    b = GMapping(GMappingParams(n_particles=4, spread=1.0, seed=9))
    mixed = np.array([(a.update(s), b.update(s))[0] for s in scans])
    alone = run(scans, n_particles=4, spread=1.0)[1]
    np.testing.assert_array_equal(mixed, alone)
    assert not np.array_equal(alone, run(scans, n_particles=4, spread=1.0, seed=9)[1])


def test_the_odometry_frame_is_arbitrary():
    _, scans = drive(50)
    shift = Pose2(100.0, -40.0, 2.0)
    other = [Scan(s.t, s.ranges, s.laser, shift @ s.odometry) for s in scans]
    for preset in ("default", "original"):
        a, b = (run(x, preset, n_particles=3)[1] for x in (scans, other))
        np.testing.assert_allclose(a, b, atol=1e-6)


@pytest.mark.parametrize("preset", ["default", "original"])
def test_bad_data_leaves_a_finite_pose(preset):
    _, scans = drive(30)
    one = Laser(0.0, 0.1, 1, 0.1, 30.0)
    wide = Laser(-math.pi, math.radians(0.5), 720, 0.1, 30.0)
    nan, inf = np.full(361, np.nan, np.float32), np.full(361, np.inf, np.float32)
    odd = [
        Scan(0.0, nan, LASER),
        *scans[:10],
        Scan(1.0, inf, LASER, scans[10].odometry),
        Scan(0.2, nan, LASER),
        Scan(0.2, np.ones(1, np.float32), one, Pose2(math.nan, 0.0, 0.0)),
        Scan(0.2, np.zeros(361, np.float32), LASER, Pose2(1e9, 0.0, 0.0)),
        make_scan(IDENTITY, -5.0, wide),
        *scans[10:],
    ]
    slam, poses = run(odd, preset, n_particles=2)
    np.testing.assert_array_equal(poses[0], 0.0)
    assert np.isfinite(poses).all()
    assert np.abs(poses).max() < 3.2
    assert slam.report()["rejected"] >= 4
    assert slam.map().p.size > 0
    assert preset == "original" or slam.covariance.shape == (3, 3)


def test_a_first_scan_without_points_leaves_the_odometry_in_force():
    truth, scans = drive(40, drift=0.0)
    blind = [
        Scan(s.t, np.full(361, np.nan, np.float32), s.laser, s.odometry) if i < 20 else s
        for i, s in enumerate(scans)
    ]
    assert position_error(run(blind, n_particles=2)[1], truth).max() < 0.02


def test_a_map_before_any_scan_is_empty():
    assert np.isnan(GMapping(GMappingParams()).map().p).all()


# real and simulated logs


@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
def test_accuracy_on_a_simulated_log():
    log = slams.load(DATA / "robocup" / "robocup.npz").select(500)
    poses = slams.replay(GMapping(GMappingParams(n_particles=10)), log).poses
    truth = [Pose2(*p) for p in log.truth_at(log.t)]
    step = [truth[i - 40].between(truth[i]) for i in range(40, 500)]
    mine = [Pose2(*poses[i - 40]).between(Pose2(*poses[i])) for i in range(40, 500)]
    error = [a.between(b) for a, b in zip(step, mine, strict=True)]
    assert np.mean([math.hypot(e.x, e.y) for e in error]) < 0.0022
    assert np.mean([abs(wrap_angle(e.theta)) for e in error]) < 0.0007
