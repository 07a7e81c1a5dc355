"""What goes wrong while driving, reported when it begins and when it ends; the status line."""

import os
import sys
from argparse import Namespace
from types import SimpleNamespace

import numpy as np
import pytest

from slams.live import diagnostics
from slams.live.diagnostics import (
    COUNT_MESSAGES,
    REPORT_PERIOD,
    SCAN_TIMEOUT,
    Diagnostics,
    Terminal,
)
from slams.live.estimate import Estimate
from slams.live.node import Drive
from slams.live.scans import ScanQueue
from slams.types import Pose2
from tests.slams.live.robots import scan_record


class Stand:
    """Diagnostics on a clock of their own."""

    def __init__(self, monkeypatch):
        self.now, self.notes, self.last = 1000.0, [], {}
        self.all = []
        monkeypatch.setattr(diagnostics.time, "monotonic", lambda: self.now)
        self.diagnostics = Diagnostics(self.notes.append)

    def reported(self, **counts):
        report = dict.fromkeys(COUNT_MESSAGES, 0) | counts
        self.diagnostics.check(report, self.last)
        notes, self.notes[:] = list(self.notes), []
        self.all += notes
        return notes


@pytest.fixture
def stand(monkeypatch):
    return Stand(monkeypatch)


def test_a_laser_that_is_unplugged_is_reported_every_period_until_it_comes_back(stand):
    assert stand.reported() == []
    start = stand.now
    for _ in range(11):  # the other one goes on
        stand.now += 0.15 * REPORT_PERIOD
        stand.last = {"/scan": start, "/rear": stand.now}
        stand.reported()
    sentence = "no scan on /scan for {} s: is the laser unplugged?"
    assert stand.all == [sentence.format(3), sentence.format(14)]
    stand.last["/scan"] = stand.now + 10.0
    stand.now += REPORT_PERIOD + 0.5 * SCAN_TIMEOUT
    assert "/scan" not in "".join(stand.reported())


def test_an_assumption_is_reported_once(stand):
    for _ in range(3):
        stand.diagnostics.note("the laser is the base")
        stand.now += 10.0 * REPORT_PERIOD
    assert stand.notes == ["the laser is the base"]


@pytest.mark.parametrize("name", COUNT_MESSAGES)
def test_what_is_counted_is_reported_again_after_a_while(name, stand):
    assert stand.reported(**{name: 3}) == [f"3 {COUNT_MESSAGES[name]}"]
    assert stand.reported(**{name: 4}) == []
    stand.now += REPORT_PERIOD
    assert stand.reported(**{name: 5}) == [f"5 {COUNT_MESSAGES[name]}"]
    stand.now += REPORT_PERIOD
    assert stand.reported(**{name: 5}) == []


@pytest.fixture
def node():
    estimate = Estimate(1.0, Pose2(1.25, -0.5, np.pi / 2), None, np.eye(3), 0.9, True, 0.0)
    drive, live = Drive(t=[0.0] * 40, delays=[0.0021]), SimpleNamespace(last=estimate)
    scans = ScanQueue(["/scan"], lambda frame: None, 2, 0.0)
    for k in range(5):
        scans.put(scan_record(0.1 * k))
    return SimpleNamespace(drive=drive, scans=scans, live=live)


def test_a_line_a_second_on_a_terminal(node, stand, monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    terminal = Terminal(Namespace(program="slams.live", quiet=False))
    stand.now += 2.0
    terminal.show_status(node)
    terminal.notify("something")
    text = capsys.readouterr().err
    assert "40 scans, 3 left out; x 1.25 y -0.50 m, 90 deg; matched 0.90" in text
    assert text.endswith("\x1b[Kslams.live: note: something\n")
    with monkeypatch.context() as closed:
        closed.setattr(sys.stderr, "write", lambda text: os.close(-1))
        terminal.show_status(node)
        terminal.notify("nobody reads it")
        terminal.end()
    node.live.last = None
    terminal.show_status(node)
    assert capsys.readouterr().err.endswith("waiting for scans")


def test_only_notes_elsewhere_and_nothing_when_quiet(node, capsys):
    for quiet, expected in ((False, "slams.live: note: something\n"), (True, "")):
        terminal = Terminal(Namespace(program="slams.live", quiet=quiet))
        terminal.show_status(node)
        terminal.notify("something")
        terminal.end()
        assert capsys.readouterr().err == expected
