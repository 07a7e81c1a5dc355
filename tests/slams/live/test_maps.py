"""Maps drawn and published at their own pace."""

import threading

import numpy as np
import pytest

import slams
from slams import LiveSlam
from slams.live.publisher import MAX_HELD_SHARE, MapThread
from tests.rooms import drive


def test_a_map_is_published_at_once_then_at_its_pace_and_at_the_end():
    published, seen = [], threading.Event()
    live = LiveSlam("odometry", warm_up=False)

    def publish(stamp, grid):
        published.append(stamp)
        seen.set()

    maps = MapThread(live, publish, every=3600.0)
    maps.add(5)
    seen.wait()
    maps.add(6)
    maps.add(7)
    maps.close()
    assert published == [5, 7]
    assert maps.drawn == 2


def test_a_map_that_takes_long_comes_less_often(monkeypatch):
    live, waits = LiveSlam("odometry", warm_up=False), []
    maps = MapThread(live, lambda *_: setattr(live, "held", 3.0), every=0.0)

    def wait(seconds=None):
        waits.append(seconds)
        maps._ending = len(waits) > 1

    monkeypatch.setattr(maps._due, "wait", wait)
    maps.add(1)
    maps._run()
    assert waits == [None, 3.0 / MAX_HELD_SHARE]


def test_a_map_that_cannot_be_published_is_kept_for_the_node_to_report():
    def refuse(stamp, grid):
        raise OSError("no network")

    maps = MapThread(LiveSlam("odometry", warm_up=False), refuse, every=3600.0)
    maps.add(1)
    maps.close()
    assert str(maps.failed) == "no network"


def test_no_maps_when_none_are_wanted():
    maps = MapThread(LiveSlam("odometry", warm_up=False), lambda *_: 1 / 0, every=0.0)
    maps.add(1)
    maps.close()
    assert maps.drawn == 0


@pytest.mark.parametrize("name", ["hector", "tsd", "crsm", "gmapping"])
def test_a_snapshot_is_not_touched_by_later_scans(name):
    slam, scans = slams.create(name), list(drive(n=20))
    for scan in scans[:10]:
        slam.update(scan)
    before, draw = slam.map(), slam.snapshot()
    for scan in scans[10:]:
        slam.update(scan)
    drawn = draw()
    np.testing.assert_array_equal(drawn.p, before.p)
    assert (drawn.origin, drawn.resolution) == (before.origin, before.resolution)
    assert not np.array_equal(slam.map().p, before.p, equal_nan=True)
