"""Maps drawn while scans go on coming."""

import threading

import numpy as np
import pytest

from slams.live import LiveSlam
from slams.live.drawing import Drawer, copies_within
from slams.live.maps import MapThread
from slams.registry import find
from slams.types import OccupancyGrid
from tests.rooms import drive

ODOMETRY = "slams.baselines:Odometry"
PUSHED, DRAWING = threading.Event(), threading.Event()  # outside of what is copied
GRID = OccupancyGrid(np.full((1, 1), np.nan, np.float32), 0.05, (0.0, 0.0))


class Waits(find("odometry").cls):
    """Its maps are not ready before a scan more has been pushed."""

    def map(self):
        DRAWING.set()
        assert PUSHED.wait(10.0)
        return super().map()


class Sketches(Waits):
    def sketch(self):
        return self.map


@pytest.mark.parametrize(("kind", "by_copy"), [(Waits, True), (Sketches, False)])
def test_a_scan_goes_on_while_a_map_is_drawn(kind, by_copy):
    PUSHED.clear()
    DRAWING.clear()
    live = LiveSlam(ODOMETRY, warm_up=False)
    live._slam = kind(live.params)
    live._drawer._in_place = float(by_copy)  # as if drawing had held scans for a second
    grids = []
    thread = threading.Thread(target=lambda: grids.append(live.map()))
    thread.start()
    assert DRAWING.wait(10.0)
    for scan in drive(n=3):
        live.push_scan(scan)
    PUSHED.set()
    thread.join(10.0)
    assert len(grids) == 1
    assert live.report()["scans"] == 3
    assert live.held < 1.0


def test_what_takes_less_time_is_done(monkeypatch):
    done = []
    times = {"map": 0.001, "copy": 0.008}

    class Slam:
        def map(self):
            done.append("map")
            clock[0] += times["map"]
            return GRID

        def __deepcopy__(self, memo):
            done.append("copy")
            clock[0] += times["copy"]
            return self

    clock = [0.0]
    monkeypatch.setattr("slams.live.drawing.time.perf_counter", lambda: clock[0])
    drawer, lock, slam = Drawer(), threading.RLock(), Slam()
    for _ in range(3):
        drawer.draw(slam, lock)
    assert done == ["map"] * 3  # a map that is drawn at once needs no copy
    times["map"] = 0.01
    for _ in range(3):
        drawer.draw(slam, lock)
    assert done[3:] == ["map", "copy", "map", "copy", "map"]  # a copy is drawn, too
    assert drawer.held == pytest.approx(0.008)
    times["copy"] = 0.02  # it has grown beyond what drawing took
    for _ in range(3):
        drawer.draw(slam, lock)
    assert done[8:] == ["copy", "map", "map", "map"]
    assert drawer.held == pytest.approx(0.01)


def test_what_is_too_large_is_not_even_tried():
    large = {"tiles": [np.zeros(1 << 20) for _ in range(4)], "scans": list(map(str, range(1000)))}
    assert copies_within(large, 0.1)
    assert not copies_within(large, 0.03)
    assert not copies_within({"scans": large["scans"]}, 0.003)
    assert copies_within(find("odometry").cls, 1e-9)  # classes are shared


def test_what_cannot_be_copied_is_drawn_in_place():
    live = LiveSlam(ODOMETRY, warm_up=False)
    live._slam.lock = threading.Lock()
    for _ in range(3):
        live._drawer._in_place = 1.0
        assert live.map().p.shape == (1, 1)
    assert live._drawer._by_copy == 0.0


def test_what_is_large_is_drawn_in_place_however_long_that_takes():
    live = LiveSlam(ODOMETRY, warm_up=False)
    live._slam.tiles = [np.zeros(1 << 20) for _ in range(8)]
    live._drawer._in_place = 1.0
    live.map()
    assert live._drawer._by_copy == 0.0
    assert live._drawer._in_place < 1.0


def test_a_map_is_shown_at_once_then_at_its_pace_and_at_the_end():
    shown, seen = [], threading.Event()
    live = LiveSlam(ODOMETRY, warm_up=False)

    def show(stamp, grid):
        shown.append(stamp)
        seen.set()

    maps = MapThread(live, show, every=60.0)
    maps.seen(5)
    assert seen.wait(10.0)
    maps.seen(6)
    maps.seen(7)
    maps.close()
    assert shown == [5, 7]
    assert maps.drawn == 2


def test_a_map_that_cannot_be_shown_is_kept_for_the_node_to_tell():
    def refuse(stamp, grid):
        raise OSError("no network")

    maps = MapThread(LiveSlam(ODOMETRY, warm_up=False), refuse, every=60.0)
    maps.seen(1)
    maps.close()
    assert str(maps.failed) == "no network"


def test_no_maps_when_none_are_wanted():
    maps = MapThread(LiveSlam(ODOMETRY, warm_up=False), lambda *_: 1 / 0, every=0.0)
    maps.seen(1)
    maps.close()
    assert maps.drawn == 0
