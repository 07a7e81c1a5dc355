"""Maps drawn while scans go on coming."""

import os
import threading
import time

import numpy as np
import pytest

import slams
from slams.live import LiveSlam, snapshot
from slams.live.drawing import Drawer
from slams.live.maps import MapThread
from slams.live.snapshot import Snapshot
from slams.registry import find
from slams.types import OccupancyGrid
from tests.rooms import drive

ODOMETRY = "slams.baselines:Odometry"
GRID = OccupancyGrid(np.full((1, 1), np.nan, np.float32), 0.05, (0.0, 0.0))
needs_fork = pytest.mark.skipif(not snapshot.AT_HAND, reason="no fork on this system")


class Waits(find("odometry").cls):
    """Its maps are not ready before a byte comes: in this process, or in a copy of it."""

    def __init__(self, params):
        super().__init__(params)
        self.ready, self.go = os.pipe()

    def map(self):
        os.read(self.ready, 1)
        return OccupancyGrid(np.full((1, 1), self._pose.x, np.float32), 0.05, (0.0, 0.0))


class Sketches(Waits):
    def sketch(self):
        return self.map


@pytest.mark.parametrize("kind", [pytest.param(Waits, marks=needs_fork), Sketches])
def test_a_scan_goes_on_while_a_map_is_drawn(kind):
    live = LiveSlam(ODOMETRY, warm_up=False)
    live._slam = kind(live.params)
    if kind is Sketches:
        live._drawer._in_place = 0.0  # as if its sketch took no time
    grids = []
    thread = threading.Thread(target=lambda: grids.append(live.map()))
    thread.start()
    while not live.held:  # what is drawn from is there
        time.sleep(0.001)
    for scan in drive(n=3):
        live.push_scan(scan)
    os.write(live._slam.go, b"!")
    thread.join(10.0)
    assert live.report()["scans"] == 3
    assert live.held < 1.0
    x = 0.0 if kind is Waits else live.last.pose.x  # that of then; a sketch is the class's affair
    assert [grid.p.tolist() for grid in grids] == [[[pytest.approx(x)]]]
    for end in (live._slam.ready, live._slam.go):
        os.close(end)


class Clocked:
    """A map and a copy of the process that take as long as is said, on a clock of their own."""

    def __init__(self, monkeypatch, map_time, apart_time):
        self.done, self.now = [], 0.0
        self.map_time, self.apart_time = map_time, apart_time
        self.drawer, self.lock = Drawer(), threading.RLock()
        monkeypatch.setattr("slams.live.drawing.Snapshot", self.copied)
        monkeypatch.setattr(snapshot, "AT_HAND", True)
        for clock in ("perf_counter", "thread_time"):
            monkeypatch.setattr(f"slams.live.drawing.time.{clock}", lambda: self.now)

    def map(self):
        self.done.append("map")
        self.now += self.map_time
        return GRID

    def copied(self, slam):
        self.done.append("apart")
        self.now += self.apart_time
        return Copied(self.map_time)

    def drawn(self, *scans):
        """How maps are drawn after so many scans each."""
        del self.done[:]
        for n in scans:
            self.drawer.draw(self, self.lock, n)
        return self.done


class LongSketch(Sketches):
    """It copies a lot."""

    def sketch(self):
        end = time.thread_time() + 0.05
        while time.thread_time() < end:
            pass
        return lambda: GRID


@needs_fork
def test_a_sketch_that_takes_long_is_made_by_a_copy_of_the_process():
    live = LiveSlam(ODOMETRY, warm_up=False)
    live._slam = LongSketch(live.params)
    spent = []
    for _ in range(3):
        assert live.map().p.shape == GRID.p.shape
        spent.append(live._drawer._spent)
    assert max(spent) < 0.05 <= live._drawer._in_place


class Copied:
    """Nobody waits for what it does."""

    def __init__(self, seconds):
        self.seconds = seconds

    def map(self):
        return GRID


def test_what_takes_less_time_is_done(monkeypatch):
    run = Clocked(monkeypatch, map_time=0.001, apart_time=0.008)
    # how long a map takes is not known at first, and one that is drawn at once needs no process
    assert run.drawn(100, 101, 102) == ["apart", "map", "map"]
    run.map_time = 0.01
    assert run.drawn(103, 104, 105) == ["map", "apart", "apart"]
    assert run.drawer.held == pytest.approx(0.008)
    run.apart_time = 0.02  # the process has grown
    assert run.drawn(106, 107, 108) == ["apart", "map", "map"]
    assert run.drawer.held == pytest.approx(0.01)


def test_a_map_that_may_have_grown_holds_no_scan(monkeypatch):
    """The first one is asked for after hours, or the next one after a long way."""
    run = Clocked(monkeypatch, map_time=0.9, apart_time=0.008)
    assert run.drawn(16_000) == ["apart"]
    assert run.drawer.held == pytest.approx(0.008)
    run = Clocked(monkeypatch, map_time=0.001, apart_time=0.008)
    assert run.drawn(100, 110) == ["apart", "map"]
    run.map_time = 0.9
    assert run.drawn(16_000, 16_010) == ["apart", "apart"]
    assert run.drawer.held == pytest.approx(0.008)


@needs_fork
def test_a_snapshot_is_the_map_of_then():
    slam = slams.create("hector")
    for scan in drive(n=3):
        slam.update(scan)
    before, taken = slam.map(), Snapshot(slam)
    for scan in drive(n=9):
        slam.update(scan)
    drawn = taken.map()
    assert np.array_equal(drawn.p, before.p, equal_nan=True)
    assert taken.seconds > 0.0
    assert (drawn.resolution, drawn.origin) == (before.resolution, before.origin)
    assert not np.array_equal(drawn.p, slam.map().p, equal_nan=True)
    with pytest.raises(ChildProcessError):
        os.waitpid(taken._process, 0)  # nobody is left


class Fails(find("odometry").cls):
    def map(self):
        if os.getpid() != HERE:
            os.kill(os.getpid(), 9)
        return GRID


HERE = os.getpid()


@needs_fork
def test_a_process_that_is_ended_is_done_without():
    live = LiveSlam(ODOMETRY, warm_up=False)
    live._slam = Fails(live.params)
    assert live.map() is GRID  # drawn here
    assert live._drawer._by_snapshot == np.inf


@needs_fork
def test_what_an_algorithm_cannot_draw_is_told(monkeypatch):
    class Refuses:
        def map(self):
            raise ValueError("no room")

    with pytest.raises(RuntimeError, match="ValueError: no room"):
        Snapshot(Refuses()).map()
    monkeypatch.setattr(snapshot, "LONGEST", 0.01)
    stuck = Waits(slams.find("odometry").params())
    with pytest.raises(TimeoutError, match=r"no map within 0\.01 s"):
        Snapshot(stuck).map()


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
