"""Names of algorithms, and the baselines among them."""

import sys
import types
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from slams import metrics, registry
from slams.baselines import COARSE_VOXEL, FINE_VOXEL, HitMap, Kiss, KissParams, Odometry, hits
from slams.player import replay
from slams.registry import create, find, names
from slams.scanlog import ScanLog
from slams.types import IDENTITY, Pose2
from tests.rooms import drive, laser, scan_at


@pytest.mark.parametrize("name", ["hector", "tsd", "crsm", "gmapping"])
def test_an_original_is_a_class_with_parameters_of_its_own(name):
    default, original = find(name), find(f"{name}@original")
    assert original.label == f"{name}@original"
    assert original.preset == "original"
    assert original.cls is not default.cls
    assert original.params() == original.cls.Params()
    assert not issubclass(original.cls.Params, default.cls.Params)
    assert isinstance(create(f"{name}@original", seed=3), original.cls)


def test_presets_of_an_outsider_are_values_or_a_class(outsider):
    class Params(find("odometry").cls.Params):
        PRESETS = {"lucky": {"seed": 7}, "other": "outsider:Other", "gone": "outsider:Gone"}

    class Other(outsider.Mine):
        """It has the presets of the first, too."""

    outsider.Mine.Params, outsider.Other = Params, Other
    assert find("outsider:Mine@lucky").params().seed == 7
    assert find("outsider:Mine@lucky").cls is outsider.Mine
    assert find("outsider:Mine@other").cls is Other
    assert find("outsider:Mine@other").params() == Params()
    with pytest.raises(LookupError, match="'outsider:Mine@gone': there is no 'Gone' in 'outsider'"):
        find("outsider:Mine@gone")


@pytest.fixture
def outsider():
    module = types.ModuleType("outsider")

    class Mine:
        Params = find("odometry").cls.Params
        update = map = report = None

        def __init__(self, params):
            self.params = params

    class Foreign(Mine):
        Params = type("Settings", (), {"__module__": "outsider"})

    class Filled(Mine):
        Params = Mine.Params()

    module.Mine, module.Foreign, module.Filled, module.other = Mine, Foreign, Filled, 3
    sys.modules["outsider"] = module
    yield module
    del sys.modules["outsider"]


@pytest.mark.parametrize(
    ("name", "error", "sentence"),
    [
        ("outsider:None_", LookupError, "there is no 'None_' in 'outsider'"),
        ("no_such_module:X", LookupError, "there is no module 'no_such_module'"),
        ("outsider:other", TypeError, "outsider:other is not a SLAM algorithm"),
        ("outsider:Foreign", TypeError, "Foreign: its Params is <class 'outsider.Settings'>, exp"),
        ("outsider:Filled", TypeError, r"Filled: its Params is BaselineParams\(seed=0, .*, expec"),
    ],
)
def test_what_is_not_an_algorithm_is_refused(outsider, name, error, sentence):
    with pytest.raises(error, match=sentence):
        find(name)


def test_an_entry_point_is_found_and_does_not_shadow_a_built_in(outsider, monkeypatch):
    group = registry.ENTRY_POINT_GROUP
    points = [EntryPoint(name, "outsider:Mine", group) for name in ("mine", "hector")]
    monkeypatch.setattr(registry, "entry_points", lambda group: points)
    assert find("mine").cls is outsider.Mine
    assert find("hector").cls is not outsider.Mine
    assert names().count("hector") == 1


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
