"""The steps of `Crsm.update`, one by one: each is taken where it is due, and only there."""

import numpy as np
import pytest

from bench.sim.degrade import degrade
from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from slams.types import Pose2
from tests.rooms import calls, made, settled, still


def test_the_climb_alone_keeps_no_lines_and_fits_nothing(monkeypatch):
    slam = settled("crsm", 12, refine=False)
    assert slam._map.lines.surface.slot.max() == 0
    fitted = calls(monkeypatch, slam._map.lines, "fit")
    slam.update(still(12))
    assert not fitted and slam.state == "matched"


@pytest.mark.parametrize("kind", ["stall=3", "jitter=50"])
def test_a_long_corridor_moves_on_though_wheels_say_otherwise(kind):
    """A prior that weighs too much against few critical rays along the corridor held the robot."""
    name, level = kind.split("=")
    log = degrade(simulate(Setting("ring", seed=102, duration=30.0)), name, float(level), 102)
    slam = made("crsm")
    scans = list(log.select(every=4))
    found = [slam.update(scan) for scan in scans]
    truth = log.truth_at(np.array([scan.t for scan in scans]))
    there = Pose2(*truth[0])
    off = [there.between(Pose2(*t)).between(p) for t, p in zip(truth, found, strict=True)]
    assert max(np.hypot(o.x, o.y) for o in off) < 0.2
