"""What the terminal shows."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from slams.live import status
from slams.live.estimate import Estimate
from slams.live.node import Drive
from slams.live.status import Terminal
from slams.types import Pose2


class Waiting(list):
    dropped = 3


@pytest.fixture
def node():
    estimate = Estimate(1.0, Pose2(1.25, -0.5, np.pi / 2), None, np.eye(3), 0.9, True, False, 0.0)
    drive = Drive(t=[0.0] * 40, delays=[0.0021], estimate=estimate)
    return SimpleNamespace(drive=drive, inbox=Waiting([1, 2]))


def test_a_line_a_second_on_a_terminal(node, monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    now = [50.0]
    monkeypatch.setattr(status.time, "monotonic", lambda: now[0])
    terminal = Terminal("slams.live", quiet=False)
    now[0] += 2.0
    terminal.status(node)
    terminal.say("something")
    text = capsys.readouterr().err
    assert "40 scans, 20.0/s, 3 left out, 2 wait; x 1.25 y -0.50 m, 90 deg; matched 0.90" in text
    assert text.endswith("\x1b[Kslams.live: note: something\n")
    node.drive.estimate = None
    terminal.status(node)
    assert capsys.readouterr().err.endswith("waiting for scans")


def test_only_notes_elsewhere_and_nothing_when_quiet(node, capsys):
    terminal = Terminal("slams.live", quiet=False)
    terminal.status(node)
    terminal.say("something")
    terminal.end()
    assert capsys.readouterr().err == "slams.live: note: something\n"
    quiet = Terminal("slams.live", quiet=True)
    quiet.say("something")
    assert capsys.readouterr().err == ""
