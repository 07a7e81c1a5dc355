"""Maps drawn and published at their own pace."""

import threading

from slams.live import LiveSlam
from slams.live.maps import MAX_HELD_SHARE, MapThread

ODOMETRY = "slams.baselines:Odometry"


def test_a_map_is_published_at_once_then_at_its_pace_and_at_the_end():
    published, seen = [], threading.Event()
    live = LiveSlam(ODOMETRY, warm_up=False)

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
    live, waits = LiveSlam(ODOMETRY, warm_up=False), []
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

    maps = MapThread(LiveSlam(ODOMETRY, warm_up=False), refuse, every=3600.0)
    maps.add(1)
    maps.close()
    assert str(maps.failed) == "no network"


def test_no_maps_when_none_are_wanted():
    maps = MapThread(LiveSlam(ODOMETRY, warm_up=False), lambda *_: 1 / 0, every=0.0)
    maps.add(1)
    maps.close()
    assert maps.drawn == 0
