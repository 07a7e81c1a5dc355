"""The node when times are odd: tf that comes late, clocks that jump, a laser that goes away."""

import time

import numpy as np
import pytest

from slams.live import diagnostics, node
from slams.live.estimate import MAX_CONSECUTIVE_LATE
from tests.slams.live.robots import Ending


def driven(stand, stamps):
    """The node after odometry and a scan of each of these stamps."""
    for n, t in enumerate(stamps):
        stand.odometry(t, (0.01 * n, 0.0, 0.0))
        stand.scan(t)
        if n == 0:
            stand.start()
        stand.drive()
    return stand.node


@pytest.mark.parametrize(("settling", "source"), [(60.0, None), (0.0, "tf")])
def test_odometry_and_tf_have_some_time_to_begin(settling, source, stand, monkeypatch):
    monkeypatch.setattr(node, "TF_SETTLING_TIME", settling)
    stand.moved(0.0, (0.0, 0.0, 0.0))
    stand.start(0.0, ending=Ending(5))
    assert stand.node.buffer.source == source


def test_a_clock_that_is_set_back_is_followed_with_its_odometry(stand):
    stamps = [100.0 + 0.1 * k for k in range(5)] + [3.0 + 0.1 * k for k in range(20)]
    node = driven(stand, stamps)
    report = node.report()
    assert (report["clock_set_back"], report["late"]) == (1, MAX_CONSECUTIVE_LATE + 1)
    assert node.drive.t[5:] == pytest.approx(stamps[5 + MAX_CONSECUTIVE_LATE :])
    assert node.live.last.map_to_odom is not None
    x = np.array(node.drive.poses)[:, 0]
    assert np.diff(x[5:])[1:] == pytest.approx(0.01)


def test_a_laser_that_is_plugged_in_again_is_mapped_on(stand, monkeypatch):
    stand.start_and_drive(0.0)
    real = time.monotonic
    monkeypatch.setattr(diagnostics.time, "monotonic", lambda: real() + 30.0)
    stand.look()
    assert any("is the laser unplugged?" in note for note in stand.notes)
    stand.scan(30.0)
    stand.drive()
    stand.look()
    assert sum("/scan" in note for note in stand.notes) == 2  # ready for it, and unplugged
    assert len(stand.node.drive.t) == 2


def test_delays_are_of_scans_that_waited_for_nothing_but_the_algorithm(stand):
    stand.start_and_drive(*(0.1 * k for k in range(4)))
    assert stand.node.drive.delays == []
    stand.scan(0.4)
    stand.drive()
    assert len(stand.node.drive.t) == 5 and len(stand.node.drive.delays) == 1


def test_a_clock_that_jumps_ahead_goes_on_there(stand):
    stamps = [0.0, 0.1, 5000.0, 5000.1]
    assert driven(stand, stamps).drive.t == stamps
