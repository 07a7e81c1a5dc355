"""LiveSlam: what a robot's scans do that a log's do not."""

import math
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from slams import LiveSlam, Pose2
from slams.live.estimate import MAX_CONSECUTIVE_LATE
from slams.registry import BUILT_IN, find
from slams.ros.messages import seconds
from slams.types import Attitude
from tests.processes import python
from tests.rooms import ROOM, drive, fields_of, laser, made, push_fields, scan_at


def push(live, scan, **more):
    return push_fields(live, **(fields_of(scan) | more))


def watched(get):
    """A `LiveSlam` and, by `get`, what its algorithm got of each scan."""
    live, seen = LiveSlam("odometry", warm_up=False), []
    live._slam.update = lambda scan: seen.append(get(scan)) or Pose2(0.0, 0.0, 0.0)
    return live, seen


@pytest.fixture(scope="module")
def log():
    return drive(n=40)


@pytest.mark.parametrize("name", BUILT_IN)
def test_pushes_give_the_poses_of_a_replay(name, log):
    slam = made(name)
    live = LiveSlam(name, warm_up=False)
    for scan in log.select(12):
        estimate = push(live, scan)
        assert estimate.pose == slam.update(replace(scan, yaw=None))
        assert (estimate.t, estimate.used, estimate.lost) == (scan.t, True, False)
        assert estimate.covariance.shape == (3, 3)
    assert np.array_equal(live.map().p, slam.map().p, equal_nan=True)


def test_map_to_odom_joins_the_two_frames(log):
    live = LiveSlam("hector", warm_up=False)
    for scan in log:
        estimate = push(live, scan)
        assert estimate.map_to_odom @ scan.odometry == pytest.approx(estimate.pose, abs=1e-12)
    assert estimate.quality > 0.8
    sigma = np.sqrt(np.diag(estimate.covariance))
    assert (sigma > 0.0).all()
    assert (sigma < 0.01).all()
    without = push(live, scan, stamp=9.0, odometry=None)
    assert without.map_to_odom is None


def test_late_and_repeated_scans_are_left_out(log):
    scans = list(log)
    live, plain = LiveSlam(warm_up=False), LiveSlam(warm_up=False)
    assert live.last is None
    for scan in scans[:10]:
        last = push(live, scan)
        for old in (scan, scans[0]):
            again = push(live, old)
            assert (again.pose, again.t, again.used) == (last.pose, last.t, False)
        assert push(plain, scan).pose == last.pose
    report = live.report()
    assert (report["scans"], report["repeated"], report["late"]) == (10, 11, 9)
    assert live.map().p.shape == plain.map().p.shape


def test_single_late_scans_do_not_set_the_clock_back(log):
    live, scans = LiveSlam("odometry", warm_up=False), list(log)
    for k in range(3):
        assert push(live, scans[20 + k]).used
        assert not any(push(live, scan).used for scan in scans[: MAX_CONSECUTIVE_LATE - 2])
    assert live.report()["clock_set_back"] == 0


def test_pushes_wait_for_a_map_only_while_its_snapshot_is_taken(log):
    free = {}

    def look(name):
        other = threading.Thread(target=lambda: free.update({name: live._lock.acquire(False)}))
        other.start()
        other.join()

    class Watched(find("odometry").cls):
        def update(self, scan):
            look("update")
            return super().update(scan)

        def snapshot(self):
            look("snapshot")
            return lambda: look("draw") or self.map()

    live = LiveSlam("odometry", warm_up=False)
    live._slam = Watched(live.params)
    push(live, next(iter(log)))
    live.map()
    assert free == {"update": False, "snapshot": False, "draw": True}


def test_a_laser_may_change_and_an_unchanged_one_is_one_object():
    live, seen = watched(lambda scan: scan.laser)
    for k, n in enumerate((181, 181, 361, 181)):
        scan = scan_at((0.0, 0.0, 0.0), laser(n, time_increment=1e-4), t=float(k))
        push(live, scan, ranges=scan.ranges.tolist())
    assert seen[0] is seen[1]
    assert [lidar.n_beams for lidar in seen] == [181, 181, 361, 181]
    assert seen[0].time_increment == 1e-4


def test_ranges_are_cleaned_and_left_alone():
    live, seen = watched(lambda scan: scan)
    given = np.array([0.05, 1.0, 40.0, np.inf, -np.inf, np.nan], np.float32)
    before = given.copy()
    push(live, scan_at((0.0, 0.0, 0.0), laser(6)), ranges=given)
    expected = [np.nan, 1, np.inf, np.inf, np.nan, np.nan]
    assert np.array_equal(seen[0].ranges, expected, equal_nan=True)
    assert np.array_equal(given, before, equal_nan=True)
    assert not seen[0].ranges.flags.writeable


@pytest.mark.parametrize("wrong", [-1e-5, 1e300, math.nan, math.inf])
def test_a_time_between_beams_that_cannot_be_is_none(wrong):
    live, seen = watched(lambda scan: scan.laser)
    scan = scan_at((0.0, 0.0, 0.0))
    push(live, scan, time_increment=wrong)
    push(live, scan, stamp=1.0, time_increment=1e-5)
    assert [laser.time_increment for laser in seen] == [0.0, 1e-5]


def test_losing_the_place_is_told(log):
    live = LiveSlam("hector", warm_up=False)
    for scan in log:
        assert not push(live, scan).lost
    elsewhere = ROOM * 0.37 + np.array([0.4, 0.7, 0.4, 0.7])
    for k in range(5):
        strange = scan_at((0.0, 0.0, 1.0), segments=elsewhere, t=10.0 + k)
        estimate = push(live, strange)
        assert estimate.lost
        assert estimate.used
    assert estimate.seconds_lost == pytest.approx(14.0 - scan.t)
    for k in range(40):  # until global localization is sure of the place
        back = push(live, scan, stamp=20.0 + 0.1 * k, odometry=None)
    assert (back.lost, back.seconds_lost) == (False, 0.0)


def test_heading_and_attitude_reach_the_algorithm():
    live, seen = watched(lambda scan: (scan.yaw, scan.attitude))
    scan = scan_at((0.0, 0.0, 0.0))
    for t, yaw, attitude in (
        (0.0, 0.5, (0.1, -0.2)),
        (1.0, math.nan, (math.nan, 0.0)),
        (2.0, 1e9, None),
        (3.0, -math.inf, None),
        (4.0, None, None),
    ):
        push(live, scan, stamp=t, yaw=yaw, attitude=attitude)
    assert seen == [(0.5, Attitude(0.1, -0.2)), *[(None, None)] * 4]


def test_readings_at_mid_sweep_reach_the_algorithm():
    live, seen = watched(lambda scan: (scan.mid_odometry, scan.mid_yaw))
    readings = [((1.0, 2.0, 0.3), 0.5), ((1e12, 0.0, 0.0), 1e9), (None, None)]
    for t, (pose, yaw) in enumerate(readings):
        push(live, scan_at((0, 0, 0)), stamp=float(t), mid_odometry=pose, mid_yaw=yaw)
    assert seen == [(Pose2(1.0, 2.0, 0.3), 0.5), (None, None), (None, None)]


def test_messages_of_ros_1_and_2():
    live = LiveSlam("odometry", warm_up=False)
    scan = scan_at((0.0, 0.0, 0.0))
    for stamp in (SimpleNamespace(sec=1, nanosec=5 * 10**8), SimpleNamespace(secs=2, nsecs=10**8)):
        estimate = push(live, scan, stamp=stamp)
        assert estimate.t == pytest.approx(seconds(stamp))
    assert estimate.t == pytest.approx(2.1)


def test_mount_sensor_and_parameters_reach_the_algorithm():
    live = LiveSlam("hector", sensor="lds01", mount=Pose2(0.1, 0.0, 0.2), warm_up=False, levels=2)
    assert live.params == find("hector").params().for_sensor("lds01").replace(levels=2)
    scan = scan_at((0.0, 0.0, 0.0))
    push(live, scan)
    assert live._scan.laser.mount == Pose2(0.1, 0.0, 0.2)
    with pytest.raises(LookupError, match="unknown sensor 'lds-01'; did you mean 'lds01'"):
        LiveSlam("hector", sensor="lds-01")
    with pytest.raises(LookupError, match="unknown parameter 'level'"):
        LiveSlam("hector", level=1)


COLD = """
import math
from slams import LiveSlam
from slams.jit import CompileClock
from tests.rooms import drive, fields_of, laser, push_fields, scan_at
live = LiveSlam("tsd+loops", loop_path=4.0)
to_and_fro = [(2.0 * math.sin(0.2 * k), 0.0, 0.0) for k in range(60)]
scans = [scan_at(pose, t=0.2 * k, odometry=pose) for k, pose in enumerate(to_and_fro)]
with CompileClock() as clock:
    for scan in (*scans, *drive(n=6, rate=5.0, lidar=laser(91, time_increment=5e-4))):
        later = 13.0 * (scan.laser.n_beams == 91)
        push_fields(live, **(fields_of(scan) | {"stamp": scan.t + later, "yaw": scan.yaw}))
    live.map()
report = live.report()
assert report["scans"] == 66 and report["algorithm"]["loops"] > 0
print(clock.seconds)
"""


def test_nothing_is_compiled_after_the_constructor(tmp_path):
    done = python("-W", "ignore", "-c", COLD, NUMBA_CACHE_DIR=str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) == 0.0
