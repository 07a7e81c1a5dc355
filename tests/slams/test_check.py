"""The checks of the contract fail where it is broken, and say so in one sentence."""

import ctypes
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from slams import contract
from slams.baselines import BaselineParams, Odometry
from slams.params import param
from slams.registry import Entry
from slams.types import IDENTITY, OccupancyGrid, Pose2
from tests.processes import python


class Good(Odometry):
    """Keeps the whole contract."""


def but(**changes):
    """A good one but for some of its attributes."""
    return type("Changed", (Good,), changes)


class Nan(Good):
    def update(self, scan):
        pose = super().update(scan)
        return pose if np.isfinite(scan.ranges).any() else Pose2(np.nan, 0.0, 0.0)


class Raises(Good):
    def update(self, scan):
        scan.ranges[100]
        return super().update(scan)


class Writes(Good):
    def update(self, scan):
        ctypes.memset(scan.ranges.ctypes.data, 0, 8)  # numpy itself would refuse
        return super().update(scan)


class Chance(Good):
    def update(self, scan):
        x, y, theta = super().update(scan)
        return Pose2(x + np.random.default_rng().normal() * (scan.t > 0.0), y, theta)


class Shares(Good):
    seen: list = []

    def update(self, scan):
        self.seen.append(scan)
        x, y, theta = super().update(scan)
        return Pose2(x + (self.seen[-2].t if len(self.seen) > 1 and scan.t else 0.0), y, theta)


class OdomFrame(Good):
    def update(self, scan):
        pose = super().update(scan)
        if not self.report()["odometry"]:
            return pose
        return Pose2(scan.odometry.x if scan.odometry else 0.0, 0.0, 0.0)


class OneLaser(Good):
    n = None

    def update(self, scan):
        self.n = self.n or scan.laser.n_beams
        if scan.laser.n_beams != self.n:
            raise ValueError(f"{scan.laser.n_beams} beams")
        return super().update(scan)


def with_map(p, x=-0.1):
    """A good one but for its map of cells `p` from (x, x) on."""
    grid = OccupancyGrid(p, 0.1, (x, x))
    return but(map=lambda self: grid)


NoReport = but(report=lambda self: None)
NoCounts = but(report=lambda self: {})
NoPose = but(update=lambda self, scan: None)
NoFrame = but(update=lambda self, scan: scan.odometry or IDENTITY)
Numbers = but(update=lambda self, scan: (0.0, 0.0, 0.0))
NoMap = with_map(np.zeros((0, 0), np.float32))


class NoMapOfNothing(Good):
    """It has one of what was seen."""

    seen = False

    def update(self, scan):
        self.seen = self.seen or bool(np.isfinite(scan.ranges).any())
        return super().update(scan)

    def map(self):
        return super().map() if self.seen else NoMap.map(self)


@dataclass(frozen=True)
class TwoParams(BaselineParams):
    PRESETS = {"bad": {"wrong": True}}

    wrong: bool = param(False, "1", "whether it is wrong", source="ours: a test")


class Preset(Good):
    Params = TwoParams

    def __init__(self, params):
        super().__init__(params)
        self.wrong = params.wrong

    def update(self, scan):
        pose = super().update(scan)
        return Pose2(1.0, 0.0, 0.0) if self.wrong else pose


def failures(cls):
    entry = Entry("it", cls, "default")
    found = {name[0]: contract.broken(entry, run) for name, run in contract.CLAUSES.items()}
    return {number: sentence for number, sentence in found.items() if sentence}


def test_a_good_one_passes():
    assert failures(Good) == {}


@pytest.mark.parametrize(
    ("cls", "number", "sentence"),
    [
        (NoReport, "0", "report() before the first scan is not a dict"),
        (NoFrame, "1", "the first pose is (3.0, -2.0, 0.5)"),
        (Nan, "2", "the pose is (nan, 0.0, 0.0) [scans: nothing but inf later]"),
        (Raises, "2", "IndexError: index 100 is out of bounds"),
        (NoPose, "1", "update returned None, expected a Pose2"),
        (Numbers, "1", "update returned (0.0, 0.0, 0.0), expected a Pose2"),
        (Writes, "3", "the ranges of a scan changed"),
        (Chance, "4", "scan 1 of the same log got ("),
        (NoCounts, "5", "report()['odometry'] is None after scans without odometry"),
        (Shares, "6", "a second instance changed the poses of the first"),
        (OdomFrame, "7", "another odom frame moves a pose by"),
        (OneLaser, "8", "raised ValueError: 361 beams (test_check.py:"),
        (with_map(np.zeros((2, 2), np.float32), 5.0), "9", "the first pose is not on the map"),
        (with_map(np.full((2, 2), 100.0, np.float32)), "9", "map().p is not in 0..1"),
        (with_map(np.zeros((2, 2))), "9", "map().p is float64"),
        (with_map(np.full((2, 2), np.nan, np.float32)), "9", "map() has no observed cell"),
        (NoMap, "9", "map().p is float32 (0, 0), expected float32 (ny, nx) with cells"),
        (NoMapOfNothing, "2", "map() has no cell [scans: nothing but inf alone]"),
    ],
)
def test_each_clause_finds_what_breaks_it(cls, number, sentence):
    Shares.seen.clear()
    found = failures(cls)
    assert sentence in found[number]
    assert "\n" not in found[number]


def test_the_command(tmp_path):
    (tmp_path / "mine.py").write_text("from tests.slams.test_check import *\n")
    path = f"{tmp_path}:{':'.join(p for p in sys.path if p)}"

    def run(*labels):
        return python("-m", "slams.check", *labels, PYTHONPATH=path)

    good = run("mine:Good", "odometry")
    assert good.returncode == 0, good.stderr
    assert good.stdout.count("  ok      ") == 2 * len(contract.CLAUSES)
    bad = run("mine:Preset")
    assert bad.returncode == 1
    assert "mine:Preset@bad\n" in bad.stdout
    assert "  FAILED  1 the first pose is the origin: the first pose is (1.0, 0.0" in bad.stdout
    assert run("mine:Preset@default").returncode == 0
