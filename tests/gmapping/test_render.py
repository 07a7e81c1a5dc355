"""The map as a grid: the same whatever was drawn before."""

import numpy as np
import pytest

from gmapping.render import Renderer
from gmapping.render_kernels import BeamCounts, is_free
from slams.grid_bounds import Box
from slams.types import IDENTITY, Pose2

EDGE = 0.1


def scans(n, seed=0):
    """Keyframes of 30 end points."""
    rng = np.random.default_rng(seed)
    return [np.vstack([rng.uniform(-4.0, 4.0, (30, 2)), (0.1, 0.2)]) for _ in range(n)]


def history(n, seed=1):
    return np.random.default_rng(seed).uniform(-9.0, 9.0, (n, 3))


def drawn(scans, poses):
    renderer = Renderer(EDGE, 0.25, 1 << 20)
    for scan, pose in zip(scans, poses, strict=True):
        renderer.add_keyframe(scan, Pose2(*pose.tolist()))
    return renderer


def same(a, b):
    np.testing.assert_array_equal(a.p, b.p)
    assert (a.resolution, a.origin) == (b.resolution, b.origin)


def test_scans_whose_pose_has_changed_are_drawn_anew_and_no_longer_where_they_were():
    kept, poses = scans(30), history(30)
    renderer, other = drawn(kept, poses), poses.copy()
    other[20:] += 0.3
    for at in (other, poses, other):
        same(renderer.snapshot(at)(), drawn(kept, at).snapshot(at)())


def test_a_snapshot_stays_as_it_is_and_a_part_is_cut_to_what_was_observed():
    renderer, poses = Renderer(EDGE, 0.25, 1 << 20), np.zeros((1, 3))
    assert np.isnan(renderer.snapshot(poses[:0])().p).all()
    assert renderer.crop(Box.around(0.0, 0.0, 5.0)) is None
    renderer.add_keyframe(np.array([[1.0, 0.0], [0.0, 0.0]]), IDENTITY)
    draw = renderer.snapshot(poses)
    renderer.add_keyframe(np.array([[0.0, 1.0], [0.0, 0.0]]), IDENTITY)
    grid, part = draw(), renderer.crop(Box(0.5, -1.0, 3.0, 1.0))
    assert grid.p.shape == (1, 11) and grid.origin == pytest.approx((-0.05, -0.05))
    assert grid.p[0].tolist() == [0.0] * 10 + [1.0]
    assert part.p.tolist() == [[0.0] * 5 + [1.0]] and part.origin == pytest.approx((0.45, -0.05))


def test_a_cell_with_the_least_share_of_hits_of_a_wall_is_as_likely_free():
    poses, kept = np.zeros((4, 3)), [np.array([[x, 0.0], [0.0, 0.0]]) for x in (1.0, 2.0, 2.0, 2.0)]
    row = drawn(kept, poses).snapshot(poses)().p[0]
    assert row[[10, 20]] == pytest.approx([0.5, 1.0])


def test_a_local_map_has_some_keyframes_where_they_are_drawn():
    kept, poses = scans(3), history(3)
    renderer, alone = drawn(kept, poses), drawn(kept[1:], poses[1:])
    field, counts = renderer.local_map([1, 2])
    assert counts.hits.sum() == 60 and counts.visits.sum() == alone.counts.visits.sum()
    at = [Pose2(*pose.tolist()) for pose in poses]
    ends = np.concatenate([at[k].transform(kept[k])[:-1] for k in (1, 2)])
    for walls in (field, alone.likelihood_field()):
        found, cells = walls.likelihood > 0.0, (ends - (walls.x0, walls.y0)) / walls.resolution
        expected = np.zeros_like(found)
        expected[tuple(np.round(cells).astype(int).T[::-1])] = True
        np.testing.assert_array_equal(found, expected)


def test_three_beams_that_end_elsewhere_make_a_cell_free():
    """Fewer may have been above what stands there."""
    hits, visits = np.array([[[0, 0, 0, 0, 2, 4]], [[0, 1, 2, 3, 20, 20]]], np.int32)
    counts = BeamCounts(hits, visits, np.zeros((1, 2), np.int32), 0, 0, EDGE)
    assert [is_free(counts, EDGE * k, 0.0) for k in range(6)] == [False] * 3 + [True, True, False]
