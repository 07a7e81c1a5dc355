"""tsd: what the map says of a pose, and what becomes of poses that it does not confirm."""

import numpy as np
import pytest

from slams.frontend.correlative import search
from slams.scan.end_points import EndPoints
from slams.types import Pose2
from tests.tsd.cases import error, scanned
from tsd.map_kernels import WALL, facing, read_field
from tsd.params import TsdParams


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
