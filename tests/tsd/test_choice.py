"""tsd: what the map says of a pose, and what becomes of poses that it does not confirm."""

import math

import numpy as np
import pytest

from slams.frontend.correlative import search
from slams.grid_bounds import Box
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Pose2
from tests.rooms import box, drive, laser, scan_at
from tests.tsd.cases import default, error, scanned
from tsd.map_kernels import WALL, facing, read_field
from tsd.params import TsdParams


@pytest.mark.parametrize("preset", ["filter", "plain"])
def test_kidnapped_within_view(preset):
    rng = np.random.default_rng(5)
    lidar = laser(361)
    recovered = 0
    for _ in range(50):
        start = np.array([*rng.uniform((-1.5, -1.0), (1.5, 1.0)), rng.uniform(-3, 3)])
        slam = default(estimator=preset, refine=preset == "filter")
        for i in range(3):
            slam.update(scan_at(start, lidar, noise=0.01, rng=rng, t=0.05 * i))
        radius, side = 0.5 * math.sqrt(rng.random()), rng.uniform(-np.pi, np.pi)
        turn = rng.uniform(-1, 1) * math.radians(30)
        jump = Pose2(radius * math.cos(side), radius * math.sin(side), turn)
        moved = Pose2(*start) @ jump
        for i in range(12):
            found = slam.update(scan_at(moved, lidar, noise=0.01, rng=rng, t=0.2 + 0.05 * i))
        distance, turn = error(jump, found)
        recovered += distance < 0.03 and turn < 0.015
    assert recovered >= 47


def test_a_scan_that_fits_nowhere_is_refused_and_not_pushed():
    slam = default()
    for i in range(5):
        slam.update(scan_at((0.0, 0.0, 0.0), t=0.1 * i))
    before = slam.report()["inserted"]
    elsewhere = np.array(box(-0.6, -0.7, 0.4, 0.9))
    pose = slam.update(scan_at((0.0, 0.0, 0.2), segments=elsewhere, t=0.6))
    assert error(IDENTITY, pose)[0] < 0.05
    assert slam.state == "predicted" and slam.report()["inserted"] == before
    slam.update(scan_at((0.0, 0.0, 0.0), t=0.7))
    assert slam.state == "matched"


def test_shares_count_what_is_explained_and_what_is_contradicted():
    slam, elements = scanned()
    field, pose, softness = slam._map, slam._estimator.pose, slam._scan.softness
    inliers, conflicts = field.evaluate(slam._scan, pose)
    assert inliers > 0.9 and conflicts < 0.05
    values = []
    for x, y, nx, ny, *_ in elements:
        p = pose.transform(np.array([[x, y]]))[0]
        n = Pose2(0.0, 0.0, pose.theta).transform(np.array([[nx, ny]]))[0]
        values.append(read_field(field.kernel, facing(*n), *p)[0])
    known = np.array(values)[np.isfinite(values)]
    assert inliers * len(elements) == pytest.approx((1 / (1 + (known / softness) ** 2)).sum())
    inliers, conflicts = field.evaluate(slam._scan, pose @ Pose2(0.5, 0.4, 0.3))
    assert conflicts > 0.2 and inliers < 0.7
    with pytest.raises(TypeError, match="expected a SurfaceScan"):
        field.evaluate(EndPoints(TsdParams()), pose)


def test_a_window_search_finds_the_pose_by_the_walls():
    slam, _ = scanned()
    lookup, pose, points = slam._map.lookup(), slam._estimator.pose, slam._scan
    assert lookup.resolution == pytest.approx(WALL * slam.params.cell)
    ends = pose.transform(points.points[:2, : points.n].T)
    ix, iy = np.floor((ends - (lookup.x0, lookup.y0)).T / lookup.resolution + 0.5).astype(int)
    assert np.mean(lookup.likelihood[iy, ix] > 0.5) > 0.9
    assert lookup.likelihood[iy.min() - 9 : iy.max() + 9].min() >= 0.0
    start, spread = pose @ Pose2(0.5, -0.3, 0.1), np.diag([0.04, 0.04, 0.01])
    found = search(lookup, points.points[:, : points.n], points.far, start, spread, 1)
    distance, turn = error(pose, found[0])
    assert distance < 1.5 * lookup.resolution and turn < 0.05


def test_a_part_of_the_map_is_that_of_the_whole():
    slam, _ = scanned()
    whole, part = slam.map(), slam._map.cut(Box(-1.0, -1.5, 2.0, 1.0))
    ix = round((part.origin[0] - whole.origin[0]) / part.resolution)
    iy = round((part.origin[1] - whole.origin[1]) / part.resolution)
    ny, nx = part.p.shape
    assert ny < whole.p.shape[0] or nx < whole.p.shape[1]
    np.testing.assert_array_equal(part.p, whole.p[iy : iy + ny, ix : ix + nx])
    assert slam._map.cut(Box(500.0, 500.0, 501.0, 501.0)) is None


def test_a_noisy_laser_is_followed_without_searching():
    log = drive(n=60, lidar=laser(721), noise=0.05, odometry=False, gyro=False)
    truth, slam = log.truth_at(log.t), default()
    for p, scan in zip(truth, log, strict=True):
        assert error(Pose2(*truth[0]).between(Pose2(*p)), slam.update(scan))[0] < 0.06
    assert slam.report()["predicted"] == slam.report()["lost"] == 0
