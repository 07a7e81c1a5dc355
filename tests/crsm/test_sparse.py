"""Few beams: normals where they are far apart, and a map that a first scan leaves full of gaps."""

import numpy as np
import pytest

from bench.sim.degrade import degrade
from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from crsm.slam import SETTLE, Crsm
from crsm.sparse_kernels import BEND, sparse_normals
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Scan
from tests.crsm.test_steps import settled
from tests.rooms import laser

STEP, NOISE = np.radians(6.0), 0.02
WALL = -5.0  # m, x of a wall behind the laser, met head on by beam 0


def normals_of(ranges, before=7.0):
    """Normals of beams around the bearing pi, the middle one first seen along -x."""
    bearings = np.pi + STEP * (np.arange(len(ranges)) - len(ranges) // 2)
    points = np.stack(
        (ranges * np.cos(bearings), ranges * np.sin(bearings), np.arange(len(ranges)))
    )
    out = np.full(points.shape, before)
    sparse_normals(points, len(ranges), IDENTITY, STEP, NOISE, out)
    return out


def wall(n=3):
    """Ranges to the wall of the n beams around its foot."""
    return -WALL / np.cos(STEP * (np.arange(n) - n // 2))


def test_three_beams_of_a_wall_have_its_normal_toward_the_laser():
    gap = -WALL * np.tan(STEP)
    found = normals_of(wall())
    np.testing.assert_allclose(found, np.tile([[1.0], [0.0], [gap]], 3), atol=1e-12)


@pytest.mark.parametrize(("deviations", "is_wall"), [(0.9 * BEND, True), (1.1 * BEND, False)])
def test_three_beams_are_a_wall_if_noise_alone_bends_them(deviations, is_wall):
    ranges = wall() + np.array([0.0, deviations * NOISE, 0.0])
    assert normals_of(ranges)[0].any() == is_wall


def test_two_beams_of_a_wall_beside_others_have_none():
    ranges = np.concatenate(([9.0, 14.0], wall(2), [9.0, 14.0]))
    assert not normals_of(ranges).any()


def test_the_straightest_of_three_times_three_beams_counts():
    ranges = wall(5) + np.array([0.0, 0.0, 0.0, 0.04, 0.0])
    nx, ny, _ = normals_of(ranges)
    assert (nx[2], ny[2]) == pytest.approx((1.0, 0.0), abs=1e-12)


def test_beams_close_together_keep_the_normals_they_have():
    near = 0.9 * np.ones(5)  # 0.094 m apart
    assert (normals_of(near) == 7.0).all()


def test_a_wall_beside_clutter_is_seen_by_three_beams():
    """Of five beams two are of something else: their common line is none of the wall."""
    lidar = laser(45)
    view = ScanReader(CrsmParams())
    bearings = np.arctan2(lidar.directions[:, 1], lidar.directions[:, 0])
    ranges = np.where(np.abs(bearings) < 0.15, 6.0 / np.cos(bearings), 8.0)
    count = int((np.abs(bearings) < 0.15).sum())
    view.take(Scan(0.0, ranges.astype(np.float32), lidar), IDENTITY)
    on_wall = np.abs(view.points[0, : view.n] - 6.0) < 1e-6
    assert count == 3
    np.testing.assert_allclose(
        view.normals[:2, : view.n][:, on_wall].T, [[-1.0, 0.0]] * count, atol=1e-6
    )


def test_dense_beams_keep_the_normals_of_five():
    lidar = laser(181)
    far = np.where(np.arange(181) % 2, 20.0, 20.5)  # 0.5 m apart
    views = [reader(CrsmParams()) for reader in (ScanReader, EndPoints)]
    for view in views:
        view.take(Scan(0.0, far.astype(np.float32), lidar), IDENTITY)
    assert (views[0].normals == views[1].normals).all()


def test_the_first_scans_enter_the_map_though_the_robot_stands():
    assert [settled(n).report()["inserted"] for n in (SETTLE, SETTLE + 3)] == [SETTLE, SETTLE]


def test_few_beams_do_not_hold_a_robot_back_where_it_started():
    log = simulate(Setting(arena="hall", seed=1, duration=20.0)).select(every=4, odometry=False)
    log = degrade(log, "beams", 45.0, 1)
    slam = Crsm(CrsmParams())
    scans = [scan for _, scan in zip(range(40), log, strict=False)]
    found = [slam.update(scan) for scan in scans]
    truth = log.truth_at(np.array([scans[0].t, scans[-1].t]))
    way = np.hypot(*(truth[1] - truth[0])[:2])
    assert way > 1.0
    assert np.hypot(found[-1].x, found[-1].y) == pytest.approx(way, abs=0.1)
