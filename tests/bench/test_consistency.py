"""Measures without a truth: drawn by hand, and on drives whose poses are made worse."""

import numpy as np
import pytest

from bench.judge import consistency as judged
from tests.rooms import drive, laser


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


def test_worse_poses_draw_more_wall():
    log = drive(n=600)
    poses = log.truth_at(log.t)
    drift = poses + np.outer(np.linspace(0.0, 1.0, 600), (0.0, 0.6, 0.0))
    unknown = np.where(np.arange(600)[:, None] < 500, poses, np.nan)
    good, bad, part = (judged.walls(log, way) for way in (poses, drift, unknown))
    assert bad > 1.2 * good
    assert 0.0 < part < good


def test_the_odd_one_out_disagrees_most():
    t, way = np.arange(20.0), np.random.default_rng(0).random((20, 3))
    odd = way * (3.0, 3.0, 1.0)
    apart = judged.disagreements([(t, way), (t, way), (t, odd), (t + 0.5, way)])
    assert apart[0] == pytest.approx(0.5 * apart[2])
    assert apart[3] is None, "no stamp in common"
