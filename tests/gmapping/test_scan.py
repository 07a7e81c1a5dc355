import math

import numpy as np
import pytest

from gmapping import GMappingParams
from gmapping.scan import SURFACE_ERROR, View
from slams.types import IDENTITY, Pose2
from tests.gmapping.scenes import (
    LASER,
    pieces_of,
    seen,
    surface_of,
    view_of,
)
from tests.rooms import CORRIDOR, laser, scan_at


def test_a_view_has_all_beams_of_the_scan_in_fewer_pieces(monkeypatch):
    monkeypatch.setattr("gmapping.scan.SURFACE_ERROR", 0.0)
    view = view_of(IDENTITY)
    assert len(view.pieces) < LASER.n_beams
    assert view.beams == view.pieces[:, 4].sum() == pytest.approx(LASER.n_beams, abs=6)
    np.testing.assert_allclose(np.hypot(*view.pieces[:, 2:4].T), 1.0)
    assert view.far == pytest.approx(seen(IDENTITY).ranges.max(), abs=1e-6)
    ends = view.ray.points
    np.testing.assert_array_equal(ends, view.pieces[:, :2].astype(np.float32))
    view.take(seen(Pose2(0.5, 0.0, 0.0)), IDENTITY)
    assert not np.array_equal(ends, view.ray.points)  # a copy, to be kept


def test_normals_are_those_of_the_walls_and_face_the_laser():
    surface = surface_of(IDENTITY)
    wall = surface[np.abs(surface[:, 0] - 4.0) < 1e-3]
    inner = wall[(np.abs(wall[:, 1] + 1.5) > 0.3) & (np.abs(wall[:, 1] - 2.5) > 0.3)]
    assert len(inner) > 20
    np.testing.assert_allclose(inner[:, 2:4], [[-1.0, 0.0]] * len(inner), atol=1e-4)
    assert (np.sum(surface[:, :2] * surface[:, 2:4], axis=1) < 0.0).all()


def test_the_far_end_of_a_bare_corridor_tells_nothing_along_it():
    """Beams there are meters apart and move with the robot."""
    scan = scan_at(IDENTITY, laser(361), CORRIDOR, 0.01, np.random.default_rng(1))
    pieces = View(GMappingParams()).take(scan, IDENTITY).pieces
    assert len(pieces) > 150 and np.abs(pieces[:, 2]).max() < 0.5


def test_beams_that_end_close_together_become_their_mean():
    ends = np.array([[r, 0.0] for r in (1.0, 1.02, 1.03, 1.05, 1.06, 3.0)])
    faces = np.array([[-0.8, 0.6], [-0.8, -0.6], [0.0, 0.0], [-1.0, 0.0], [-0.6, 0.8], [0.0, 0.0]])
    found = pieces_of(ends, faces, grain=0.04)
    expected = [[3.05 / 3, 0.0, 3.0], [1.055, 0.0, 2.0]]  # the last has nothing beside it
    np.testing.assert_allclose(found[:, [0, 1, 4]], expected, atol=1e-9)
    mean = np.array([-1.6, 0.8]) / math.hypot(1.6, 0.8)
    np.testing.assert_allclose(found[:, 2:4], [[-1.0, 0.0], mean], atol=1e-9)


def test_a_post_looks_at_the_laser_and_what_is_seen_edge_on_is_left_out():
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
    view._noise.value = 0.02
    beams = np.array([1.0, 4.0, 1e9])
    view._weigh(beams)
    shared, own = SURFACE_ERROR**2, 0.02**2
    expected = (shared + own) / (shared + own / np.array([1.0, 4.0, 1e9]))
    np.testing.assert_allclose(beams, expected)  # 1, 3.4 and no more than 17
    assert beams[0] == 1.0 and beams[2] == pytest.approx(17.0)
