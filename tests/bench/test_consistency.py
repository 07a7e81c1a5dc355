"""Measures without a truth: drawn by hand, and on drives whose poses are made worse."""

import numpy as np
import pytest

from bench.judge import consistency as judged
from bench.judge.registration import Reference, register
from tests.rooms import drive, laser


def square(n=200, side=4.0):
    """Points around a square room, in order."""
    along = np.linspace(-side / 2, side / 2, n)
    walls = [(along, np.full(n, side / 2)), (np.full(n, side / 2), -along)]
    walls += [(-along, np.full(n, -side / 2)), (np.full(n, -side / 2), along)]
    return np.concatenate([np.column_stack(wall) for wall in walls])


def test_registration_finds_how_far_a_scan_was_moved():
    target = Reference([square()])
    assert register(square(), target, np.zeros(2)) == pytest.approx(0.0, abs=1e-9)
    c, s = np.cos(0.03), np.sin(0.03)
    moved = square() @ np.array([[c, s], [-s, c]]) + (0.12, -0.16)
    assert register(moved, target, np.array([0.12, -0.16])) == pytest.approx(0.2, abs=1e-3)


def test_registration_says_where_it_cannot():
    wall = np.column_stack([np.linspace(-5.0, 5.0, 200), np.ones(200)])
    assert register(wall, Reference([wall]), np.zeros(2)) is None, "open along the wall"
    assert register(square() + 20.0, Reference([square()]), np.zeros(2)) == np.inf
    assert register(square(), Reference([]), np.zeros(2)) is None


def test_points_lie_where_the_beams_end():
    log = drive(n=5, lidar=laser(31))
    poses = log.truth_at(log.t)
    found = judged.points_at(log, poses, np.array([2]))
    ranges = log.ranges[2]
    hit = np.isfinite(ranges)
    angle = poses[2, 2] + log.laser.angles[hit] + log.laser.mount.theta
    start = poses[2, :2]
    assert log.laser.mount[:2] == (0.0, 0.0)
    assert found == pytest.approx(
        start + ranges[hit, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    )


def test_wall_area_counts_cells_with_two_returns():
    points = np.array([(0.01, 0.01), (0.02, 0.02), (0.06, 0.01), (-0.01, 0.01), (-0.02, 0.01)])
    assert judged.wall_area(points) == pytest.approx(2 * 0.05**2)
    assert judged.wall_area(points[:0]) == 0.0


def test_worse_poses_draw_more_wall_and_miss_their_revisits():
    log = drive(n=600)
    t, poses = 0.1 * np.arange(600), log.truth_at(log.t)
    there = np.concatenate([poses[::2], poses[::-1][::2]])  # and back the same way
    back = type(log)(t, np.concatenate([log.ranges[::2], log.ranges[::-1][::2]]), log.laser)
    drift = there.copy()
    drift[:, 1] += np.linspace(0.0, 0.3, len(drift))
    good, bad = (judged.consistency(back, way) for way in (there, drift))
    assert bad.walls_m2 > 1.2 * good.walls_m2
    assert good.revisits > 3
    assert good.revisits_m < 0.02 < 0.08 < bad.revisits_m


def test_a_run_without_revisits_has_no_error_there():
    log = drive(n=10)
    found = judged.consistency(log, log.truth_at(log.t))
    assert found.revisits == 0 and found.revisits_m is None


def test_the_odd_one_out_disagrees_most():
    t, way = np.arange(20.0), np.random.default_rng(0).random((20, 3))
    odd = way * (3.0, 3.0, 1.0)
    apart = judged.disagreements([(t, way), (t, way), (t, odd), (t + 0.5, way)])
    assert apart[0] == pytest.approx(0.5 * apart[2])
    assert apart[3] is None, "no stamp in common"
