"""The map as a grid: the same whatever was drawn before, and what is final is not kept."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from gmapping.render import Ray, Renderer
from gmapping.render_kernels import Counts, is_free
from slams.registry import find
from slams.types import Pose2
from tests.rooms import drive

EDGE = 0.1


def scans(n, seed=0):
    rng = np.random.default_rng(seed)
    return [Ray(rng.uniform(-4.0, 4.0, (30, 2)), np.array([[0.1, 0.2]])) for _ in range(n)]


def history(n, seed=1):
    return np.random.default_rng(seed).uniform(-9.0, 9.0, (n, 3))


def drawn(rays, poses):
    renderer = Renderer(EDGE, 0.25)
    for ray in rays:
        renderer.keep(ray)
    return renderer.snapshot(poses)()


def same(a, b):
    np.testing.assert_array_equal(a.p, b.p)
    assert (a.resolution, a.origin) == (b.resolution, b.origin)


@pytest.mark.parametrize("kept", [0, 7])
def test_what_is_final_is_as_if_it_was_kept(kept):
    rays, poses = scans(12), history(12)
    renderer, first = Renderer(EDGE, 0.25), 12 - kept
    for ray, pose in zip(rays[:first], poses, strict=False):
        renderer.draw(ray, pose)
    for ray in rays[first:]:
        renderer.keep(ray)
    for _ in range(2):
        same(renderer.snapshot(poses)(), drawn(rays, poses))


def test_the_original_with_the_laser_alone_keeps_no_scan():
    entry = find("gmapping@original")
    slam, alive = entry.cls(entry.params()), []
    for scan in drive(n=30).select(odometry=False):
        one = replace(scan, ranges=scan.ranges.copy())
        slam.update(one)
        alive.append(weakref.ref(one.ranges))
    del one
    gc.collect()
    assert sum(ref() is not None for ref in alive) <= 2
    grid, trajectory = slam.map(), slam.trajectory()
    assert np.isfinite(grid.p).sum() > 1000
    assert len(trajectory) == slam.report()["inserted"]
    assert grid.origin[0] < Pose2(*trajectory[-1]).x < grid.origin[0] + grid.p.shape[1] * 0.05


def test_scans_whose_pose_has_changed_are_drawn_anew_and_no_longer_where_they_were():
    renderer, rays, poses = Renderer(EDGE, 0.25), scans(30), history(30)
    for ray, pose in zip(rays, poses, strict=True):
        renderer.keep(ray, Pose2(*pose.tolist()))
    other = poses.copy()
    other[20:] += 0.3
    a, b = renderer.snapshot(other)(), drawn(rays, other)
    assert np.nansum(a.p) == pytest.approx(np.nansum(b.p))


def test_three_beams_that_end_elsewhere_make_a_cell_free():
    """Fewer may have been above what stands there."""
    visits = np.array([[0, 1, 2, 3, 20, 20]], np.int32)
    hits = np.array([[0, 0, 0, 0, 2, 4]], np.int32)
    counts = Counts(hits, visits, np.zeros((1, 2), np.int32), 0, 0, EDGE)
    free = [is_free(counts, EDGE * k, 0.0) for k in range(6)]
    assert free == [False, False, False, True, True, False]
