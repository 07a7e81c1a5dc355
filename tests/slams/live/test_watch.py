"""What goes wrong while driving, told when it begins and when it ends."""

import pytest

from slams.live import LATE_IN_A_ROW, LiveSlam, watch
from slams.live.inbox import Inbox
from slams.live.watch import AGAIN, SILENT, Watch
from tests.rooms import scan_at
from tests.slams.live.bus import Bus


@pytest.fixture
def stand(monkeypatch):
    class Stand:
        def __init__(self):
            self.now, self.said = 1000.0, []
            monkeypatch.setattr(watch.time, "monotonic", lambda: self.now)
            self.inbox, self.wire = Inbox(2), Bus().wire()
            self.live = LiveSlam("odometry", warm_up=False)
            self.watch = Watch("/scan", self.inbox, self.live, self.wire, self.said.append)

        def told(self):
            self.watch.look()
            said, self.said[:] = list(self.said), []
            return said

    return Stand()


def test_a_laser_that_is_unplugged_and_comes_back_is_told_once_each(stand):
    assert stand.told() == []
    stand.inbox.put(None)
    assert stand.told() == []
    stand.now += SILENT + 0.1
    assert "no scan on /scan for 2 s" in stand.told()[0]
    stand.now += 50.0
    assert stand.told() == []
    stand.inbox.put(None)
    assert "back after about 52 s" in stand.told()[0]
    assert stand.told() == []


def test_several_publishers_are_told(stand):
    stand.wire.several = 2
    assert "2 publishers on /scan" in stand.told()[0]
    assert stand.told() == []


def test_a_queue_that_overflows_is_told_again_after_a_while(stand):
    for _ in range(5):
        stand.inbox.put(None)
    assert stand.told()[0].startswith("3 scans left out so far")
    stand.inbox.put(None)
    assert stand.told() == []
    stand.now += AGAIN
    stand.inbox.put(None)
    assert stand.told()[0].startswith("5 scans left out so far")


def test_scans_that_are_not_stamped_are_told(stand):
    for _ in range(3):
        stand.live.push_scan(scan_at((0.0, 0.0, 0.0), t=0.0))
    assert "2 scans have the stamp of the one before" in stand.told()[0]


def test_a_clock_that_jumps_is_told(stand):
    for k in range(3):
        stand.watch.stamped(10.0 + k)
        stand.now += 1.0
    assert stand.told() == []
    stand.watch.stamped(100.0)
    assert "jumped ahead by 87.0 s" in stand.told()[0]
    for k in range(20):
        stand.live.push_scan(scan_at((0.0, 0.0, 0.0), t=100.0 if k == 0 else 0.1 * k))
    told = sorted(stand.told())
    assert told[0].startswith("1 times the clock was set back")
    assert told[1].startswith(f"{LATE_IN_A_ROW + 1} scans came late")
    assert len(told) == 2
