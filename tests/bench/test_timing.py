"""What the time per scan leaves out, on an algorithm whose every call takes a known time."""

import numpy as np
import pytest

from bench.run import timing
from slams.baselines import BaselineParams, HitMap
from slams.registry import find
from slams.types import IDENTITY, Pose2
from tests.rooms import drive, laser

CLOCK = {"now": 0.0}
SEEN: list[list] = []


class Costly:
    """An algorithm that takes 3 ms per scan, 0.5 ms to count, and 20 ms to draw its map."""

    Params = BaselineParams

    def __init__(self, params):
        self.params = params
        self.drawn = 0
        self.seen: list = []
        SEEN.append(self.seen)

    def update(self, scan):
        self.seen.append(scan)
        CLOCK["now"] += 0.003
        return IDENTITY

    def map(self):
        self.drawn += 1
        CLOCK["now"] += 5.0 if self.drawn == 1 else 0.020
        return HitMap(self.params).grid()

    def report(self):
        CLOCK["now"] += 0.0005
        return {}


@pytest.fixture
def clock(monkeypatch):
    CLOCK["now"] = 0.0
    SEEN.clear()
    monkeypatch.setattr(timing.time, "process_time", lambda: CLOCK["now"])


def test_overheads_are_what_is_done_besides_an_update(clock):
    lidar = laser(31, mount=Pose2(0.1, 0.0, 0.2), time_increment=1e-4)
    log = drive(n=30, lidar=lidar)
    found = timing.overheads("tests.bench.test_timing:Costly", log, BaselineParams(), 12)
    assert found == pytest.approx({"iterate_ms": 0.0, "live_push_ms": 0.5, "map_ms": 20.0})
    twin, live = SEEN
    assert len(twin) == len(live) == 12
    for one, other in zip(twin, live, strict=True):
        assert np.array_equal(one.ranges, other.ranges, equal_nan=True)
        assert (one.t, one.laser, one.odometry) == (other.t, other.laser, other.odometry)
        assert one.yaw is other.yaw is None


def test_iterating_is_told_per_scan(clock, monkeypatch):
    log = drive(n=10, lidar=laser(31))
    whole = type(log).__iter__

    def slow(self):
        for scan in whole(self):
            CLOCK["now"] += 0.001
            yield scan

    monkeypatch.setattr(type(log), "__iter__", slow)
    found = timing.overheads("tests.bench.test_timing:Costly", log, BaselineParams())
    assert found["iterate_ms"] == pytest.approx(1.0)


def test_overheads_of_a_real_algorithm_are_small_and_positive():
    entry = find("odometry")
    found = timing.overheads("odometry", drive(n=60), entry.params())
    assert 0.0 < found["iterate_ms"] < 1.0
    assert 0.0 < found["live_push_ms"] < 2.0
    assert 0.0 < found["map_ms"] < 200.0
