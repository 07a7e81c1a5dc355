import numpy as np
import pytest

from gmapping import GMappingParams
from gmapping.scan import View
from gmapping.scan_kernels import Walls
from slams.types import IDENTITY, Pose2
from tests.gmapping.scenes import (
    LASER,
    cast,
    linearized,
    make_scan,
    mapped,
    pieces_of,
    points_of,
    surface_of,
    view_of,
)
from tests.rooms import CORRIDOR, laser, scan_at


def test_beams_that_end_close_together_become_their_mean():
    ends = np.array([[r, 0.0] for r in (1.0, 1.02, 1.03, 1.05, 1.06, 3.0)])
    expected = [[3.05 / 3, 0.0, 3.0], [1.055, 0.0, 2.0], [3.0, 0.0, 1.0]]
    np.testing.assert_allclose(points_of(ends, 0.04), expected, atol=1e-6)


def test_a_view_has_all_beams_of_the_scan_in_fewer_pieces():
    view = view_of(IDENTITY)
    assert len(view.pieces) < LASER.n_beams
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


def test_a_post_looks_at_the_laser_and_what_is_no_post_is_left_out():
    post = np.array([[3.0, -0.3, 1.0], [1.0, 0.0, 2.0], [3.0, 0.3, 1.0]])
    np.testing.assert_allclose(pieces_of(post, increment=0.005), [[1.0, 0.0, -1.0, 0.0, 2.0]])
    gap = np.array([[1.0, -0.2, 1.0], [3.0, 0.0, 2.0], [1.0, 0.2, 1.0]])
    found = pieces_of(gap, increment=0.005)
    np.testing.assert_allclose(found[:, :2], gap[[0, 2], :2])


@pytest.mark.parametrize("turn", [0.0, 0.3, 0.8, 1.5, 2.2, 3.0])
def test_normals_of_a_wall_are_right_whichever_way_it_goes(turn):
    way, across = np.array((np.cos(turn), np.sin(turn))), np.array((-np.sin(turn), np.cos(turn)))
    points = np.column_stack([2.0 * across + np.outer(np.linspace(-0.2, 0.2, 9), way), np.ones(9)])
    found = pieces_of(points, increment=0.005)[3:6]
    np.testing.assert_allclose(found[:, 2:4], [-across] * 3, atol=1e-6)


def test_points_in_one_place_look_at_the_laser():
    found = pieces_of(np.array([[2.0, 0.0, 1.0]] * 7), increment=0.005)
    np.testing.assert_allclose(found[:, 2:4], [[-1.0, 0.0]] * 7)


def test_the_far_end_of_a_bare_corridor_tells_nothing_along_it():
    """Beams there are meters apart and move with the robot."""
    scan = scan_at(IDENTITY, laser(361), CORRIDOR, 0.01, np.random.default_rng(1))
    pieces = View(GMappingParams()).take(scan, IDENTITY).pieces
    assert len(pieces) > 150 and np.abs(pieces[:, 2]).max() < 0.5


def test_a_mean_of_beams_counts_as_many_in_normals_and_maps():
    several = np.array([[2.0, 0.09 * k, 3.0 if k == 1 else 1.0] for k in range(-2, 3)])
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
