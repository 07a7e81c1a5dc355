import numpy as np
import pytest

from slams import metrics
from slams.baselines import (
    COARSE_VOXEL,
    FINE_VOXEL,
    HitMap,
    Kiss,
    KissParams,
    Odometry,
    hits,
)
from slams.player import replay
from slams.registry import create
from slams.scanlog import ScanLog
from slams.types import IDENTITY, Pose2
from tests.rooms import drive, laser, scan_at


def test_hits_are_the_ends_in_the_base_frame():
    mount = Pose2(0.2, -0.1, 0.3)
    scan = scan_at((0.0, 0.0, 0.0), laser(91, mount=mount))
    points = hits(scan)
    assert len(points) == np.isfinite(scan.ranges).sum()
    ahead = mount.transform(scan.laser.directions[:1] * scan.ranges[0])
    assert points[0] == pytest.approx(ahead[0])
    assert np.hypot(*(points[0] - mount[:2])) == pytest.approx(scan.ranges[0])


def test_odometry_follows_the_wheels_from_the_first_scan_on(room_log):
    run = replay(Odometry(Odometry.Params()), room_log)
    wheels = room_log.odometry_at_scans()
    assert run.poses == pytest.approx(metrics.from_first(wheels), abs=1e-9)
    assert run.report == {"odometry": len(room_log), "laser": 0}


def test_odometry_that_begins_late_goes_on_from_where_the_robot_is():
    slam = create("odometry")
    assert slam.update(scan_at((0, 0, 0))) == IDENTITY
    assert slam.update(scan_at((0, 0, 0), odometry=Pose2(5.0, 5.0, 1.0))) == IDENTITY
    moved = slam.update(scan_at((0, 0, 0), odometry=Pose2(5.0, 5.0, 1.0) @ Pose2(0.1, 0.0, 0.0)))
    assert moved == pytest.approx((0.1, 0.0, 0.0))


def test_kiss_tracks_the_room(room_log):
    run = replay(Kiss(KissParams()), room_log)
    assert metrics.ate(run.poses, room_log.truth_at(run.t)) < 0.05


@pytest.mark.parametrize(
    ("n_beams", "chosen", "other"),
    [(541, FINE_VOXEL, COARSE_VOXEL), (271, COARSE_VOXEL, FINE_VOXEL)],
)
def test_the_gap_between_the_beams_chooses_the_voxel_of_kiss(n_beams, chosen, other):
    """0.5 and 1 degree; a scan without a return comes first."""
    log = drive(n=12, lidar=laser(n_beams))
    blind = ScanLog(log.t - 1.0, np.full_like(log.ranges, np.inf), log.laser)
    poses = {}
    for voxel in (0.0, chosen, other):
        slam = Kiss(KissParams(voxel=voxel))
        assert slam.update(next(iter(blind))) == IDENTITY
        poses[voxel] = replay(slam, log).poses
    assert np.array_equal(poses[0.0], poses[chosen])
    assert not np.array_equal(poses[0.0], poses[other])


def test_no_environment_variable_changes_kiss(monkeypatch):
    log = drive(n=15)
    expected = replay(Kiss(KissParams()), log).poses
    for name, value in (
        ("kiss_icp_mapping", '{"voxel_size": 3.0}'),
        ("KISS_ICP_ADAPTIVE_THRESHOLD", '{"initial_threshold": 0.001, "min_motion_th": 5.0}'),
        ("kiss_icp_data", '{"max_range": 1.0}'),
    ):
        monkeypatch.setenv(name, value)
    assert np.array_equal(replay(Kiss(KissParams()), log).poses, expected)


def test_a_hit_map_marks_the_hit_cells_only():
    hit_map = HitMap(KissParams(resolution=0.5))
    scan = scan_at((0.0, 0.0, 0.0), laser(181))
    hit_map.insert(scan, IDENTITY)
    grid = hit_map.grid()
    assert set(np.unique(grid.p[~np.isnan(grid.p)])) == {1.0}
    for x, y in hits(scan):
        ix = int(np.floor((x - grid.origin[0]) / 0.5))
        iy = int(np.floor((y - grid.origin[1]) / 0.5))
        assert grid.p[iy, ix] == 1.0
