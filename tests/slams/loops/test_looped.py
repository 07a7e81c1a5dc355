"""An algorithm with loops: wheels that bend a drive around a building, closed at the return."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import slams
from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from slams import metrics
from slams.loops.slam import MOVED, looped
from slams.player import replay
from slams.registry import find, label_of
from slams.scanlog import Track
from slams.types import IDENTITY, Corrected, Pose2


class Drifting:
    """A `Localizes` without matching: its poses are the wheels', its map is the last keyframe."""

    Params = slams.Params

    def __init__(self, params):
        self.params, self.frozen = params, False
        self._first = self._origin = None
        self.inserted = []

    def update(self, scan):
        if self._first is None:
            self._first, self._origin = scan.odometry, IDENTITY
        return self._origin @ self._first.between(scan.odometry)

    def insert_at(self, scan, pose):
        self._first, self._origin = scan.odometry, pose
        self.inserted.append(pose)

    def map(self):
        return slams.OccupancyGrid(np.full((1, 1), np.nan, np.float32), 0.05, (0.0, 0.0))

    def report(self):
        return {}


@cache
def around():
    """Two laps of a ring of corridors with wheels that turn too far by two percent."""
    log = simulate(Setting("hall", seed=3, size=16.0, length=90.0, v=1.0, noise=0.01))
    log = log.rows(np.arange(0, len(log.t), 8))
    true = log.truth_at(log.t)
    bent, pose = [IDENTITY], IDENTITY
    for one, other in zip(true[:-1], true[1:], strict=True):
        step = Pose2(*one).between(Pose2(*other))
        pose = pose @ Pose2(1.01 * step.x, step.y, 1.01 * step.theta + 0.002 * abs(step.x))
        bent.append(pose)
    return replace(log, odom=Track(log.t, np.array(bent)), yaw_rate=None)


def ate(poses, log):
    return metrics.ate(poses, log.truth_at(log.t))


def test_loops_correct_the_poses_and_the_map_of_any_algorithm():
    log = around()
    slam = looped(Drifting)(looped(Drifting).Params())
    run = replay(slam, log)
    assert isinstance(slam, Corrected)
    assert slam.report()["loops"] > 5
    assert slam.report()["redrawn"] >= 1
    assert ate(run.corrected, log) < 0.3 * ate(run.poses, log)
    ends = [slam.graph.pose(k) for k in range(len(slam.slam.inserted))]
    off = [math.hypot(a.x - b.x, a.y - b.y) for a, b in zip(ends, slam.slam.inserted, strict=True)]
    assert np.median(off) < 4.0 * MOVED  # the map is that of the poses, but for later loops


def test_every_loop_is_where_the_truth_has_it():
    log = around()
    slam = looped(Drifting)(looped(Drifting).Params())
    replay(slam, log)
    for edge in slam.graph.loops:
        stamps = [slam.keyframes[k].scan.t for k in (edge.earlier, edge.later)]
        one, other = (Pose2(*row) for row in log.truth_at(np.array(stamps)))
        off = one.between(other).between(edge.pose)
        assert math.hypot(off.x, off.y) < 0.15
        assert abs(off.theta) < 0.03


def test_a_drive_without_a_return_closes_nothing():
    log = around()
    log = log.rows(np.arange(0, len(log.t) // 6))
    slam = looped(Drifting)(looped(Drifting).Params())
    replay(slam, log)
    assert slam.report()["loops"] == 0


@pytest.mark.parametrize("name", ["hector", "tsd", "crsm", "gmapping"])
def test_the_four_go_on_in_the_new_map(name):
    """A robot whose map is exchanged keeps its motion: the next pose is a step from the last."""
    log = around()
    label = f"{name}+loops"
    entry = find(label)
    assert label_of(entry.cls) == label
    one = slams.create(name, relocate=False)
    for scan in log.rows(np.arange(40)):
        last = one.update(scan)
    other, scans = slams.create(name), list(log)
    moved = Pose2(2.0, -1.0, 0.7)
    for k in range(40):
        other.insert_at(
            scans[k],
            moved
            @ Pose2(*log.truth_at(log.t[[0]])[0]).between(Pose2(*log.truth_at(log.t[[k]])[0])),
        )
    one.adopt(other, moved @ last)
    true = [Pose2(*row) for row in log.truth_at(log.t[[39, 40]])]
    found = (moved @ last).between(one.update(scans[40]))
    assert found == pytest.approx(true[0].between(true[1]), abs=0.03)


def test_a_state_goes_on_bit_for_bit(tmp_path):
    from slams.state import load_state, save

    log = around()
    scans, half = list(log), len(log.t) // 2
    slam = slams.create("hector+loops")
    for scan in log.rows(np.arange(half)):
        slam.update(scan)
    save(slam, tmp_path / "floor.state")
    again = load_state(tmp_path / "floor.state")
    for k in range(half, half + 60):
        assert again.update(scans[k]) == slam.update(scans[k])
    assert np.array_equal(again.corrected(), slam.corrected())


def test_an_algorithm_without_the_hooks_is_refused():
    with pytest.raises(TypeError, match=r"odometry cannot close loops: it has no insert_at"):
        find("odometry+loops")
