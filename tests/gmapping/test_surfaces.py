import math

import numpy as np
import pytest

from gmapping import GMappingParams
from gmapping.map import TileMap
from gmapping.map_kernels import (
    N_SURFACE_LAYERS,
    N_SURFACE_VALUES,
    SINGLE_SCAN_SURFACE_WEIGHT,
    index_in_layer,
    insert,
)
from gmapping.scan import WALL_ROUGHNESS_STD, View
from gmapping.surfaces import SurfaceMatcher
from gmapping.tile_kernels import slot_of
from slams import geometry, load
from slams.types import IDENTITY, Laser, Pose2
from tests.gmapping import naive
from tests.gmapping.scenes import (
    GAUSS_NEWTON,
    LASER,
    NO_CANDIDATES,
    UPDATE,
    climb,
    linearized,
    mapped,
    matcher_of,
    pieces_of,
    posterior,
    run,
    seen,
    surface_of,
    view_of,
)
from tests.rooms import CORRIDOR, laser, scan_at


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
    tiles.tiles.cells[tiles.tiles.references > 0, :, 4] = -1.0  # observed again: full weight
    pose = np.array([0.011, -0.007, 0.004])
    expected = linearized(tiles.tiles, pose, surface)[1]
    for j in range(3):
        sides = (pose + step * np.eye(3)[j] for step in (1e-6, -1e-6))
        after, before = (linearized(tiles.tiles, side, surface)[2] for side in sides)
        gradient[j] = (after - before) / 4e-6
    np.testing.assert_allclose(gradient, expected, rtol=0.02, atol=1e-3)


def test_one_step_weighs_scan_and_prior_as_by_hand():
    surface, start = surface_of(IDENTITY), np.array([0.02, 0.01, -0.01])
    tiles = mapped(surface).tiles
    known = np.array([[40.0, 3.0, 5.0], [3.0, 30.0, 2.0], [5.0, 2.0, 20.0]])
    mean = np.array([0.1, -0.2, 0.3])
    of = posterior(tiles, surface, [mean], known)
    poses, _, _ = climb(of, [start], GAUSS_NEWTON._replace(max_steps=1, first_scale=0.03))
    h, gradient, *_ = linearized(tiles, start, surface, 0.03)
    off, dof = mean - start, geometry.STUDENT_DOF
    w = GAUSS_NEWTON.variance * (dof + 3.0) / (dof + off @ known @ off)
    step = np.linalg.solve(h + w * known, w * known @ off - gradient)
    np.testing.assert_allclose(poses[0], start + step, atol=1e-12)


def test_many_starts_climb_as_each_alone_in_the_map_of_its_owner():
    tiles = TileMap(3, N_SURFACE_LAYERS, 0.05, 5000, n_values=N_SURFACE_VALUES).tiles
    surface = surface_of(IDENTITY)
    insert(tiles, np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.2]]), surface, UPDATE)
    starts = np.array([[0.52, 0.03, 0.01], [-0.03, 0.02, 0.01]])
    poses, _, out = climb(posterior(tiles, surface, starts, 1.0, (1, 0)), starts)
    np.testing.assert_allclose(poses, [[0.5, 0, 0], [0, 0, 0]], atol=2e-3)
    for k, owner in enumerate((1, 0)):
        alone = climb(posterior(tiles, surface, starts[[k]], 1.0, (owner,)), starts[[k]])
        np.testing.assert_array_equal(alone[0][0], poses[k])
        np.testing.assert_array_equal(alone[2][0], out[k])


@pytest.mark.parametrize("far", np.linspace(12.66, 12.74, 9))
def test_a_wall_at_the_edge_of_the_tables_is_written_whole(far):
    maps = TileMap(1, N_SURFACE_LAYERS, 0.05, 200, n_values=N_SURFACE_VALUES, max_cells=1 << 16)
    poses, wall = np.array([[far - 1.0, 0.0, 0.0]]), np.array([[1.0, 0.0, -1.0, 0.0, 1.0]])
    maps.cover(poses, 1.0)
    assert insert(maps.tiles, poses, wall, UPDATE) == 0


def cells_along(gap, turned=0.0, laser_at=(0.0, 0.0), far=2.0, behind=0.0):
    """How far [cells] along a wall at x = `far` the middle one of three points `gap` apart reaches.

    The two beside it are so far `behind`, their normals `turned`; the laser is at `laser_at`.
    """
    maps = TileMap(1, N_SURFACE_LAYERS, 0.05, 200, n_values=N_SURFACE_VALUES)
    maps.cover(np.zeros((1, 3)), 5.0)
    c, s = -math.cos(turned), math.sin(turned)
    x = far + behind
    wall = np.array([[x, -gap, c, s, 0.0], [far, 0.0, -1.0, 0.0, 1.0], [x, gap, c, s, 0.0]])
    rule = UPDATE._replace(laser_x=laser_at[0], laser_y=laser_at[1])
    assert insert(maps.tiles, np.zeros((1, 3)), wall, rule) == 0
    x, reached = round(far / 0.05), []
    for iy in range(-20, 21):
        slot = slot_of(maps.tiles, 0, 2, x, iy)  # layer 2: it looks to -x
        if slot > 0 and maps.tiles.cells[slot, index_in_layer(2, x, iy), 3] > 0.0:
            reached.append(iy)
    assert reached == list(range(-reached[-1], reached[-1] + 1))
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
    assert cells_along(0.31, laser_at=(0.0, 3.0)) == 3  # cosine between beam and normal 0.55
    assert cells_along(0.31, laser_at=(0.0, 4.0)) == 1  # 0.45


def test_a_rotation_that_was_not_predicted_does_not_throw_a_scan_along_the_corridor(shared_data):
    log = load(shared_data("data/csail/mit-csail.npz")).rows(slice(640, 672)).select(odometry=False)
    _, poses = run(log, n_particles=1)  # at 27 it turns by 4 degrees, and went on by 0.95 m
    np.testing.assert_allclose(np.hypot(*np.diff(poses[20:, :2], axis=0).T), 0.255, atol=0.02)


def test_a_match_has_inlier_ratio_noise_and_information():
    matcher, there = matcher_of(IDENTITY), Pose2(0.03, -0.02, 0.02)
    view = view_of(there)
    match = matcher.match(view, 0, geometry.Prior(IDENTITY, np.eye(3)), IDENTITY)
    np.testing.assert_allclose(match.pose, there, atol=2e-3)
    h, _, _, close, squares, _ = linearized(
        matcher.tiles.tiles, match.pose, view.pieces, GMappingParams().width
    )
    assert match.inlier_ratio == pytest.approx(close / view.beams) and match.inlier_ratio > 0.9
    np.testing.assert_allclose(match.information, h / max(squares, view.noise**2), rtol=1e-3)


def test_a_proposal_keeps_the_prediction_along_a_bare_corridor():
    laser = Laser(-math.pi / 2, math.radians(1.0), 181, 0.1, 8.0)
    scan = seen(IDENTITY, laser=laser, walls=CORRIDOR, rng=np.random.default_rng(1), noise=0.02)
    params = GMappingParams(n_particles=1, max_tiles=5000, max_range=8.0)
    matcher, view = SurfaceMatcher(params), View(params).read(scan, IDENTITY)
    matcher.tiles.cover(np.zeros((1, 3)), 10.0)
    assert matcher.insert(view, np.zeros((1, 3)), 1.0)
    known = np.diag([4.0, 4.0, 400.0])
    found = matcher.propose(view, np.array([[-0.3, 0.04, 0.0]]), known, *NO_CANDIDATES)
    assert found.peaks[0, 0] == pytest.approx(-0.3, abs=0.02) and abs(found.peaks[0, 1]) < 0.02
    covariance = np.linalg.inv(found.factors[0] @ found.factors[0].T)
    assert math.sqrt(covariance[0, 0]) > 0.4 and math.sqrt(covariance[1, 1]) < 0.02


def test_a_view_has_all_beams_of_the_scan_in_fewer_pieces(monkeypatch):
    monkeypatch.setattr("gmapping.scan.WALL_ROUGHNESS_STD", 0.0)
    view = view_of(IDENTITY)
    assert len(view.pieces) < LASER.n_beams
    assert view.beams == view.pieces[:, 4].sum() == pytest.approx(LASER.n_beams, abs=6)
    np.testing.assert_allclose(np.hypot(*view.pieces[:, 2:4].T), 1.0)
    assert view.radius == pytest.approx(seen(IDENTITY).ranges.max(), abs=1e-6)
    ray = view.ray
    np.testing.assert_array_equal(ray[:-1], view.pieces[:, :2].astype(np.float32))
    assert ray[-1].tolist() == [0.0, 0.0]  # the laser
    view.read(seen(Pose2(0.5, 0.0, 0.0)), IDENTITY)
    assert not np.array_equal(ray, view.ray)  # a copy, to be kept


def test_the_far_end_of_a_bare_corridor_does_not_constrain_the_position_along_it():
    """Beams there are meters apart and move with the robot."""
    scan = scan_at(IDENTITY, laser(361), CORRIDOR, 0.01, np.random.default_rng(1))
    pieces = View(GMappingParams()).read(scan, IDENTITY).pieces
    assert len(pieces) > 150 and np.abs(pieces[:, 2]).max() < 0.5


def test_beams_that_end_close_together_become_their_mean():
    ends = np.array([[r, 0.0] for r in (1.0, 1.02, 1.03, 1.05, 1.06, 3.0)])
    faces = np.array([[-0.8, 0.6], [-0.8, -0.6], [0.0, 0.0], [-1.0, 0.0], [-0.6, 0.8], [0.0, 0.0]])
    found = pieces_of(ends, faces, grain=0.04)
    expected = [[3.05 / 3, 0.0, 3.0], [1.055, 0.0, 2.0]]  # the last has nothing beside it
    np.testing.assert_allclose(found[:, [0, 1, 4]], expected, atol=1e-9)
    mean = np.array([-1.6, 0.8]) / math.hypot(1.6, 0.8)
    np.testing.assert_allclose(found[:, 2:4], [[-1.0, 0.0], mean], atol=1e-9)
    weighted = pieces_of(ends, faces, grain=0.04, weight=0.5)
    np.testing.assert_array_equal(weighted, found * [1.0, 1.0, 1.0, 1.0, 0.5])


def test_a_post_faces_the_laser_and_a_wall_seen_edge_on_is_left_out():
    none = np.zeros((3, 2))
    post = np.array([[3.0, -0.3], [1.0, 0.0], [3.0, 0.3]])
    np.testing.assert_allclose(pieces_of(post, none), [[1.0, 0.0, -1.0, 0.0, 1.0]])
    edge = np.array([[1.0, -0.2], [2.0, 0.0], [3.0, 0.2]])
    np.testing.assert_allclose(pieces_of(edge, none)[:, :2], edge[[0]])
    wall = np.array([[2.0, 0.0], [2.1, 0.0]])
    for cosine, kept in ((0.2, 2), (0.05, 0)):
        normals = np.tile([-cosine, math.sqrt(1.0 - cosine**2)], (2, 1))
        assert len(pieces_of(wall, normals)) == kept


def test_a_piece_weighs_what_its_beams_do_not_share():
    view = view_of(IDENTITY)
    view._noise._std.value = 0.02
    beams = np.array([1.0, 4.0, 1e9])
    view._weigh(beams)
    shared, own = WALL_ROUGHNESS_STD**2, 0.02**2
    expected = (shared + own) / (shared + own / np.array([1.0, 4.0, 1e9]))
    np.testing.assert_allclose(beams, expected)  # 1, 3.4 and no more than 17
    assert beams[0] == 1.0 and beams[2] == pytest.approx(17.0)


def test_a_surface_observed_by_one_scan_has_a_small_weight():
    surface = surface_of(IDENTITY)
    tiles, pose = mapped(surface).tiles, [0.02, 0.01, 0.01]
    h, gradient, cost, *_ = linearized(tiles, pose, surface)
    assert insert(tiles, np.zeros((1, 3)), surface, UPDATE) == 0
    np.testing.assert_allclose(linearized(tiles, pose, surface)[0], h, rtol=1e-5)  # the same scan
    assert insert(tiles, np.zeros((1, 3)), surface, UPDATE._replace(path_length=1.2)) == 0
    h2, gradient2, cost2, *_ = linearized(tiles, pose, surface)
    np.testing.assert_allclose(h, SINGLE_SCAN_SURFACE_WEIGHT * h2, rtol=1e-5)
    np.testing.assert_allclose(gradient, SINGLE_SCAN_SURFACE_WEIGHT * gradient2, rtol=1e-3)
    assert cost == pytest.approx(cost2, rel=1e-5)


def test_cells_keep_the_path_length_of_their_first_scan_negative_once_there_is_another():
    tiles, surface = mapped(surface_of(IDENTITY)).tiles, surface_of(IDENTITY)
    for path_length in (7.0, 9.0):
        insert(tiles, np.zeros((1, 3)), surface, UPDATE._replace(path_length=path_length))
    insert(tiles, np.array([[0.3, 0.0, 0.0]]), surface, UPDATE._replace(path_length=11.0))
    seen = tiles.cells[tiles.references > 0].reshape(-1, N_SURFACE_VALUES)
    np.testing.assert_allclose(np.unique(seen[seen[:, 3] > 0.0, 4]), (-UPDATE.path_length, 11.0))


def test_a_proposal_has_the_information_of_scan_and_motion():
    matcher, view, known = matcher_of(IDENTITY), view_of(IDENTITY), np.diag([400.0, 300.0, 900.0])
    found = matcher.propose(view, np.zeros((1, 3)), known, *NO_CANDIDATES)
    h = linearized(matcher.tiles.tiles, found.peaks[0], view.pieces, GMappingParams().width)[0]
    worth = min(1.0, GMappingParams().independent / view.beams) / GMappingParams().range_noise ** 2
    information = found.factors[0] @ found.factors[0].T
    np.testing.assert_allclose(information, worth * h + known, rtol=1e-3, atol=1.0)
