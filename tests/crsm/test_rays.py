"""Reading a scan: critical rays against a naive twin, noise, stray beams, skew."""

import numpy as np
import pytest

from crsm.rays_kernels import leverage
from crsm.scan import LEAST_RAYS, ScanReader
from slams.types import IDENTITY, Scan
from tests.crsm import naive
from tests.crsm.room import LASER, Parameters, noisy_view, reader_of
from tests.rooms import laser, scan_at


def test_critical_rays_equal_the_naive_selection():
    view, count = noisy_view(), Parameters().critical_rays
    n = view.n
    xy, normal = view.points[:2, :n].T, view.normals[:2, :n].T
    assert not normal.any(axis=1).all()  # lone points have no share
    shares, found = naive.leverages(xy, normal), np.zeros(n)
    leverage(view.points, view.normals, n, np.zeros((3, 3)), found)
    assert found == pytest.approx(shares, rel=1e-4, abs=1e-6)
    first = view.moments[5, : n + 1]
    jumps = set(np.flatnonzero(np.diff(first))) | set(np.flatnonzero(np.diff(first))[:-1] + 1)
    edges = np.isin(np.arange(n), list(jumps))
    each = min(0.25 * count / edges.sum(), 1.0)
    far = np.hypot(*xy.T)
    rest = 0.5 * (count - each * edges.sum())
    expected = naive.spread_out(each * edges + rest * (shares / 3.0 + far / far.sum()))
    both = set(map(tuple, view.ends.tolist())) ^ set(map(tuple, xy[expected].tolist()))
    assert len(both) <= 4  # a sum that rounds to the other side


def test_at_most_half_of_the_points_are_rays_unless_they_are_few():
    for beams, rays in ((361, 150), (101, LEAST_RAYS), (41, 41)):
        reader = ScanReader(Parameters(critical_rays=150))
        reader.take(scan_at(IDENTITY, laser(beams)), IDENTITY)
        assert len(reader.ends) == pytest.approx(rays, abs=0.1 * rays)


def test_information_of_the_rays_is_that_of_their_share_of_all_points():
    view, theta = reader_of(scan_at(IDENTITY, LASER)), 0.7
    c, s = np.cos(theta), np.sin(theta)
    turn = np.array([[c, -s], [s, c]])
    xy, normal = (turn @ a[:2, : view.n] for a in (view.points, view.normals))
    rows = np.stack((*normal, normal[1] * xy[0] - normal[0] * xy[1]))
    expected = rows @ rows.T * len(view.ends) / view.n / view.noise**2
    assert view.information(theta) == pytest.approx(expected, rel=1e-4)


def test_a_single_short_beam_does_not_tear_a_wall():
    scan = scan_at(IDENTITY, LASER)
    ranges = scan.ranges.copy()
    ranges[100:300:7] *= 0.5
    whole, reader = reader_of(scan), reader_of(Scan(0.0, ranges, LASER))
    assert reader.n == whole.n - len(ranges[100:300:7])
    stretches = len(np.unique(reader.moments[5, : reader.n]))
    assert stretches <= len(np.unique(whole.moments[5, : whole.n])) + 1
