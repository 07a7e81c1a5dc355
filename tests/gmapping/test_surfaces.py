import math
from types import SimpleNamespace

import numpy as np
import pytest

from gmapping import GMapping, GMappingParams
from gmapping.key import OLD, KeyScans
from gmapping.map import TileMap
from gmapping.map_kernels import DEPTH, LAYERS, ONCE, insert, place_of
from gmapping.match import far_off, lattice
from gmapping.match_kernels import Around, Beams, Prior, crossed, search_old
from gmapping.scan import View
from gmapping.surfaces import (
    BLIND,
    CHANCE,
    DRIFT,
    EXPLAINED,
    OLD_STEP,
    PLACES,
    SurfaceMatcher,
    _blind,
)
from gmapping.tile_kernels import slot_of
from slams import geometry, load
from slams.types import IDENTITY, Laser, Pose2
from tests.gmapping import naive
from tests.gmapping.scenes import (
    HOW,
    SPLAT,
    climb,
    linearized,
    make_scan,
    mapped,
    matcher_of,
    one,
    run,
    surface_of,
    view_of,
)

TRACK = SimpleNamespace(expected=1e-6 * np.eye(3), room=0.05)  # a prediction good to a millimeter


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


@pytest.mark.parametrize("turn", [0.0, 0.5, 0.75, 1.2, 2.0, 3.6, 5.0])
def test_a_point_is_written_into_the_same_cells_as_by_the_naive_twin(turn):
    """However its wall lies; in tiles on all sides of the origin."""
    point, normal = np.array([0.013, -0.021]), np.array([math.cos(turn), math.sin(turn)])
    twin = naive.surface_map(point[None], normal[None], 0.05, 2, 100.0)
    tiles = mapped(np.array([[*point, *normal, 1.0]])).tiles
    for (layer, ix, iy), (line, weight) in twin.items():
        cell = tiles.cells[slot_of(tiles, 0, layer, ix, iy), place_of(layer, ix, iy)]
        np.testing.assert_allclose(cell[:4], (*line, weight), rtol=1e-5, atol=1e-7)
    assert (tiles.cells[tiles.references > 0, :, 3] > 0.0).sum() == len(twin)


def test_the_gradient_is_that_of_the_robust_cost():
    surface = surface_of(IDENTITY)
    tiles, gradient = mapped(surface), np.zeros(3)
    tiles.tiles.cells[tiles.tiles.references > 0, :, 4] = -1.0  # seen again, so that all is trusted
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


def test_cells_know_the_way_at_which_they_were_first_seen_and_whether_since_again():
    tiles, surface = mapped(surface_of(IDENTITY)).tiles, surface_of(IDENTITY)
    for driven in (7.0, 9.0):
        insert(tiles, np.zeros((1, 3)), surface, SPLAT._replace(driven=driven))
    insert(tiles, np.array([[0.3, 0.0, 0.0]]), surface, SPLAT._replace(driven=11.0))
    seen = tiles.cells[tiles.references > 0].reshape(-1, DEPTH)
    np.testing.assert_allclose(np.unique(seen[seen[:, 3] > 0.0, 4]), (-SPLAT.driven, 11.0))


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
        matcher.tiles.tiles, match.pose, view.pieces, GMappingParams().width
    )
    assert match.quality == pytest.approx(close / view.beams) and match.quality > 0.9
    np.testing.assert_allclose(match.seen, h / max(squares, view.noise**2), rtol=1e-3)
    share, independent = (
        cost / GMappingParams().width ** 2 / view.beams,
        GMappingParams().independent,
    )
    assert view.beams > independent
    assert match.cost == pytest.approx(independent * share, rel=1e-3)
    assert match.old == 0.0


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
    return slam.particles, slam._matcher.propose(view, np.array([way]), information, TRACK)


def test_draws_have_the_covariance_of_their_proposal_and_new_ground_weighs_none():
    particles, found = proposals(4000, 1.0)
    information = found.factors[0] @ found.factors[0].T
    np.testing.assert_allclose(particles.poses.mean(axis=0), found.peaks[0], atol=3e-4)
    np.testing.assert_allclose(np.cov(particles.poses.T) @ information, np.eye(3), atol=0.15)
    np.testing.assert_array_equal(particles.log_w, 0.0)


def test_a_proposal_has_the_information_of_scan_and_way():
    matcher, view, known = matcher_of(IDENTITY), view_of(IDENTITY), np.diag([400.0, 300.0, 900.0])
    found = matcher.propose(view, np.zeros((1, 3)), known[None], TRACK)
    h = linearized(matcher.tiles.tiles, found.peaks[0], view.pieces, GMappingParams().width)[0]
    worth = min(1.0, GMappingParams().independent / view.beams) / GMappingParams().range_noise ** 2
    information = found.factors[0] @ found.factors[0].T
    np.testing.assert_allclose(information, worth * h + known, rtol=1e-3, atol=1.0)


def test_without_spread_a_proposal_is_the_peak():
    particles, found = proposals(3, 0.0)
    np.testing.assert_allclose(particles.poses, np.repeat(found.peaks, 3, axis=0), atol=1e-12)


@pytest.mark.parametrize(
    ("way", "known", "old", "room", "goes_back"),
    [
        (0.5, 0.01, 0.0, 0.1, True),  # a peak beside the map, which explains less there
        (0.03, 0.01, 0.0, 0.01, False),  # as near as what is known
        (0.5, 1.0, 0.0, 0.1, False),
        (0.5, 0.01, 0.0, 0.6, False),  # a robot that accelerates comes so far
        (0.5, 0.01, 1e-6, 0.1, False),  # on ground of old: a loop may close
    ],
)
def test_a_particle_far_from_where_the_way_led_goes_back_if_that_costs_less(
    way, known, old, room, goes_back
):
    matcher, view = matcher_of(IDENTITY, IDENTITY), view_of(IDENTITY)
    how, prior = matcher._how(view, 1e6), Prior(np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)))
    prior.information[:] /= known**2
    peaks, h, out = (
        np.array([[0.0, way, 0.0], [0.0, 0.0, 0.0]]),
        np.ones((2, 3, 3)),
        np.ones((2, 7)),
    )
    out[:, 3] = how.width**2 * view.beams  # nothing is explained
    out[:, 6] = old
    matcher._hold(view, how, prior, peaks, h, out, room)
    np.testing.assert_allclose(peaks[0], [0.0, 0.0 if goes_back else way, 0.0], atol=1e-3)
    assert (out[0, 3] < 0.1 * out[1, 3]) == (h[0, 0, 0] != 1.0) == goes_back
    assert (peaks[1] == 0.0).all() and (h[1] == 1.0).all()


def test_a_particle_does_not_go_back_to_a_place_as_far_from_what_is_known():
    """Held where the way led it would have turned, which the wheels exclude."""
    matcher, view = matcher_of(IDENTITY), view_of(Pose2(0.0, 0.0, 0.1))
    how, independent = matcher._how(view, 1e6), GMappingParams().independent
    for heading, goes_back in ((0.005, False), (0.1, True)):
        information = np.diag([1e4, 1e4, 1.0 / heading**2])
        prior = Prior(np.zeros((1, 3)), information[None])
        peaks, h, out = np.array([[0.06, 0.0, 0.0]]), np.ones((1, 3, 3)), np.zeros((1, 7))
        out[:, 3] = 3.0 / independent * how.width**2 * view.beams
        matcher._hold(view, how, prior, peaks, h, out, 0.05)
        assert (abs(peaks[0, 0]) < 0.01) == goes_back


def test_far_off_goes_around_the_circle_the_short_way():
    at, mean = np.array([[0.1, -0.2, math.pi - 0.1]]), np.array([[0.0, 0.0, -math.pi + 0.2]])
    off, known = np.array([0.1, -0.2, -0.3]), np.diag([400.0, 300.0, 900.0])
    assert far_off(at, mean, known[None])[0] == pytest.approx(off @ known @ off)


def test_a_particle_far_from_where_the_way_led_stays_where_it_explains_far_more():
    matcher, view, there = matcher_of(IDENTITY), view_of(IDENTITY), Pose2(0.2, 0.0, 0.0)
    for known, stays in ((0.03, True), (1e-6, False)):
        at = matcher.propose(view, np.array([there]), np.eye(3)[None] / known**2, TRACK)
        assert abs(at.peaks[0, 0]) == pytest.approx(0.0 if stays else 0.2, abs=0.01)


# ground of old


def test_only_ground_of_old_weighs_a_particle():
    matcher, view = matcher_of([0.0, 0.0, 0.0], [0.06, 0.0, 0.0]), view_of(IDENTITY, quietest=0.01)
    matcher._keys.driven = 9.0
    assert matcher.insert(view, np.array([[0.0, 0.0, 0.0], [0.06, 0.0, 0.0]]))  # seen again: as old
    sure, at = np.tile(4e7 * np.eye(3), (2, 1, 1)), np.zeros((2, 3))
    matcher._keys.driven = 1.0 + OLD - 0.1
    np.testing.assert_array_equal(matcher.propose(view, at, sure, TRACK).log_w, 0.0)
    matcher._keys.driven = 1.0 + OLD + 0.1
    found = matcher.propose(view, at, sure, TRACK)
    old = matcher._keys.driven - OLD
    spared = linearized(
        matcher.tiles.tiles, found.peaks[0], view.pieces, GMappingParams().width, old
    )[5]
    worth = min(1.0, GMappingParams().independent / view.beams) / GMappingParams().range_noise ** 2
    full = view.beams * GMappingParams().width ** 2
    told = min(spared, EXPLAINED * full) - CHANCE * full
    assert found.log_w[0] == pytest.approx(0.5 * PLACES * worth * told, rel=1e-3)
    assert found.log_w[0] > found.log_w[1] + 1.0  # its map is elsewhere


def test_search_old_finds_a_shifted_old_map():
    surface, far = surface_of(IDENTITY), np.array([[0.55, -0.5, 0.05]])
    tiles, off = mapped(surface).tiles, lattice(DRIFT, OLD_STEP)
    for old, expected in ((2.0, np.zeros((1, 3))), (0.5, far)):
        poses, share = far.copy(), np.zeros(1)
        how, around = HOW._replace(old=old), Around(off, np.zeros(len(off)), 3)
        search_old(tiles, np.zeros(1, np.int64), surface, around, how, poses, share)
        assert (np.abs(poses - expected) <= 0.5 * OLD_STEP + 1e-9).all()
        assert share[0] > 0.6 if old > 1.0 else share[0] == 0.0


def test_a_particle_that_looks_around_in_a_bare_corridor_goes_across_it_only():
    walls = np.array([[-50.0, -1.0, 50.0, -1.0], [50.0, 1.0, -50.0, 1.0]])
    laser = Laser(-math.pi / 2, math.radians(1.0), 181, 0.1, 8.0)
    scan = make_scan(IDENTITY, laser=laser, walls=walls, rng=np.random.default_rng(1), sd=0.02)
    params = GMappingParams(n_particles=1, max_tiles=5000)
    matcher, view = SurfaceMatcher(params, KeyScans(params)), View(params).take(scan, IDENTITY)
    matcher.tiles.cover(np.full(2, -10.0), np.full(2, 10.0))
    assert matcher.insert(view, np.zeros((1, 3)))  # begins at x = 0: nobody looked back
    matcher._keys.driven, matcher._keys.returns = 2.0 + OLD, lambda pose: True
    peak = matcher.propose(view, np.array([[-0.4, 0.5, 0.0]]), 1e4 * np.eye(3)[None], TRACK).peaks[
        0
    ]
    assert abs(peak[0] + 0.4) < 0.15 and abs(peak[1]) < 0.03


def test_of_a_way_what_scans_say_nothing_along_is_blind():
    turn = math.radians(30.0)
    c, s = math.cos(turn), math.sin(turn)
    across, along = np.array([-s, c]), np.array([c, s])
    seen, way = np.zeros((1, 3, 3)), np.array([[0.4, 0.3, 0.05]])
    for share, part in ((0.5 * BLIND, way[0, :2] @ along * along), (2.0 * BLIND, np.zeros(2))):
        seen[0, :2, :2] = 50.0 * (np.outer(across, across) + share * np.outer(along, along))
        np.testing.assert_allclose(_blind(way, seen), [[*part, 0.0]], atol=1e-12)


@pytest.mark.parametrize("returns", [True, False])
def test_a_particle_that_may_be_on_ground_of_old_looks_for_it(returns):
    matcher, view, far = matcher_of(IDENTITY), view_of(IDENTITY), np.array([[0.55, -0.5, 0.05]])
    matcher._keys.driven, matcher._keys.returns = 2.0 + OLD, lambda pose: returns
    peak = matcher.propose(view, far, np.diag([1e4, 1e4, 1e4])[None], TRACK).peaks[0]
    if returns:
        np.testing.assert_allclose(peak, 0.0, atol=5e-3)
    else:
        assert math.hypot(*peak[:2]) > 0.3


@pytest.mark.parametrize(("old", "scans", "through"), [(2.0, 2, 1.0), (0.5, 2, 0.0), (2.0, 1, 0.0)])
def test_beams_through_a_wall_of_old_ground_are_counted(old, scans, through):
    """A wall at x = 2 that two scans have seen; beams that end at x = 3, and some before it."""
    y = np.linspace(-1.0, 1.0, 41)
    wall = np.column_stack([0.0 * y + 2.0, y, 0.0 * y - 1.0, 0.0 * y, 0.0 * y + 1.0])
    maps = TileMap(1, LAYERS, 0.05, 200, depth=DEPTH)
    maps.cover(np.array([-1.0, -3.0]), np.array([5.0, 3.0]))
    for scan in range(scans):
        rule = SPLAT._replace(driven=1.0 + 0.001 * scan)
        assert insert(maps.tiles, np.zeros((1, 3)), wall, rule) == 0
    ahead = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    beyond, before = wall + ahead, wall - 0.02 * ahead
    surface, out = np.vstack([beyond[10:31], before]), np.zeros(2)
    poses, owners = np.array([[0.0, 0.0, 0.0], [-0.9, 0.0, 0.0]]), np.zeros(2, np.int64)
    crossed(maps.tiles, owners, surface, Beams(0.1, 0.0, 1), old, poses, out)
    np.testing.assert_array_equal(out, [21.0 * through, 0.0])  # the other pose is 0.9 m behind


def test_a_particle_does_not_go_where_beams_go_through_walls(monkeypatch):
    matcher, view, far = matcher_of(IDENTITY), view_of(IDENTITY), np.array([[0.55, -0.5, 0.05]])
    matcher._keys.driven, matcher._keys.returns = 2.0 + OLD, lambda pose: True
    at = matcher.propose(view, far, np.diag([1e4, 1e4, 1e4])[None], TRACK).peaks[0]
    monkeypatch.setattr(matcher, "_through", lambda *_: np.array([0.5]))
    stays = matcher.propose(view, far, np.diag([1e4, 1e4, 1e4])[None], TRACK).peaks[0]
    assert np.hypot(*at[:2]) < 0.05 < np.hypot(*stays[:2])


def cells_along(gap, turned=0.0, sees=(0.0, 0.0), far=2.0, behind=0.0):
    """How far [cells] along a wall at x = `far` the middle one of three points `gap` apart reaches.

    The two beside it are so far `behind`, their normals `turned`; the laser `sees` from there.
    """
    maps = TileMap(1, LAYERS, 0.05, 200, depth=DEPTH)
    maps.cover(np.array([-5.0, -5.0]), np.array([5.0, 5.0]))
    c, s = -math.cos(turned), math.sin(turned)
    x = far + behind
    wall = np.array([[x, -gap, c, s, 0.0], [far, 0.0, -1.0, 0.0, 1.0], [x, gap, c, s, 0.0]])
    rule = SPLAT._replace(x=sees[0], y=sees[1])
    assert insert(maps.tiles, np.zeros((1, 3)), wall, rule) == 0
    x, reached = round(far / 0.05), []
    for iy in range(-20, 21):
        slot = slot_of(maps.tiles, 0, 2, x, iy)  # layer 2: it looks to -x
        if slot >= 0 and maps.tiles.cells[slot, place_of(2, x, iy), 3] > 0.0:
            reached.append(iy)
    assert reached == list(range(reached[0], reached[-1] + 1))
    assert reached[0] == -reached[-1]
    return reached[-1]


def test_a_wall_is_continued_half_of_the_way_to_the_next_beam_on_it():
    assert cells_along(0.04) == 1  # 1.5 cells to either side, the last with weight 0
    assert cells_along(0.09) == 1  # half of it and half a cell: 0.07 m
    assert cells_along(0.31) == 3  # 0.18 m
    assert cells_along(0.47) == 5  # 0.26 m
    assert cells_along(5.0) == 6  # 0.3 m at most, and half a cell


def test_what_is_no_wall_or_seen_edge_on_is_not_continued():
    assert cells_along(0.31, turned=0.4) == 3  # cosine 0.92
    assert cells_along(0.31, turned=0.5) == 1  # 0.88: another wall
    assert cells_along(0.31, behind=0.06) == 3  # sine of the way to it 0.19
    assert cells_along(0.31, behind=0.07) == 1  # 0.22: beside the wall
    assert cells_along(0.31, sees=(0.0, 3.0)) == 3  # cosine between beam and normal 0.55
    assert cells_along(0.31, sees=(0.0, 4.0)) == 1  # 0.45


def test_a_turn_that_was_not_foreseen_does_not_throw_a_scan_along_the_corridor(shared_data):
    log = load(shared_data("data/csail/mit-csail.npz")).from_scan(640).select(32, odometry=False)
    _, poses = run(log, n_particles=1)  # at 27 it turns by 4 degrees, and went on by 0.95 m
    np.testing.assert_allclose(np.hypot(*np.diff(poses[20:, :2], axis=0).T), 0.255, atol=0.01)
