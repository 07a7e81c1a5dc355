import numpy as np
import pytest

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
