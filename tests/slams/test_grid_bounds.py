"""Maps grow to where the robot can have driven, and not beyond a limit, in all algorithms."""

import dataclasses
import math
import tracemalloc

import numpy as np
import pytest

from slams.grid_bounds import MAX_UNSEEN_DISTANCE, Box, GridBounds
from slams.player import WARM_UP_SCANS, replay, warm_up
from slams.registry import BUILT_IN, find
from slams.scanlog import Track
from slams.summary import as_text, summarize
from tests.rooms import drive

LABELS = [f"{name}{preset}" for name in BUILT_IN for preset in ("", "@original")]
LABELS = [label for label in LABELS if not label.startswith(("odometry", "kiss"))]
GROWING = [label for label in LABELS if "max_cells" in find(label).params().specs()]


def test_a_box_reaches_around_both_and_knows_what_is_how_far_away():
    box = Box.around(1.0, 2.0, 3.0)
    assert box == (-2.0, -1.0, 4.0, 5.0)
    assert box.joined(Box(0.0, -7.0, 1.0, 0.0)) == (-2.0, -7.0, 4.0, 5.0)
    assert box.cells(0.5) == 144.0
    assert box.away(Box.around(3.9, 4.9, 50.0)) == 0.0
    assert box.away(Box.around(7.0, 9.0, 50.0)) == 5.0
    assert math.isnan(box.away(Box.around(math.nan, 0.0, 1.0)))


def test_a_map_may_grow_step_by_step_but_not_leap():
    extent = GridBounds(1 << 26, 0.05)
    assert extent.admits(Box.around(0.99 * MAX_UNSEEN_DISTANCE, 0.0, 10.0))
    assert extent.admits(Box.around(1.98 * MAX_UNSEEN_DISTANCE, 0.0, 10.0))
    covered = extent.covered
    for x in (4.0 * MAX_UNSEEN_DISTANCE, 1e300, math.inf, math.nan):
        assert not extent.admits(Box.around(x, 0.0, 10.0))
    assert extent.counts == {"too_far": 4, "too_large": 0}
    assert extent.covered == covered


def test_a_map_that_is_full_still_takes_what_is_inside():
    extent = GridBounds(10_000, 0.1)
    assert extent.admits(Box(-5.0, -5.0, 4.9, 4.9))
    assert not extent.admits(Box(4.0, 0.0, 6.0, 1.0))
    assert not extent.admits(Box(0.0, 0.0, math.inf, 1.0))
    assert extent.admits(Box(-5.0, 0.0, 4.9, 1.0))
    assert extent.counts == {"too_far": 1, "too_large": 1}


def degraded(meters):
    """A drive whose odometry jumps aside in its middle."""
    log = drive(n=40)
    values = log.odom.values.copy()
    values[20:, 1] += meters
    return dataclasses.replace(log, odom=Track(log.odom.t, values))


def kept_mb(label, log, **changes):
    entry = find(label)
    params = entry.params().replace(**changes)
    warm_up(entry.cls, params, log.select(WARM_UP_SCANS))  # compiling, too, takes memory
    tracemalloc.start()
    try:
        slam = entry.cls(params)
        run = replay(slam, log)
        grid = slam.map()
        return slam, run, grid, tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("label", LABELS)
@pytest.mark.parametrize("meters", [1e3, 1e6])
def test_odometry_that_jumps_costs_no_memory(label, meters):
    usual = kept_mb(label, drive(n=40))[3]
    slam, run, grid, mb = kept_mb(label, degraded(meters))
    assert mb < usual + 50.0, f"{mb:.0f} MB instead of {usual:.0f}"
    assert grid.p.size < 1.1e6
    assert np.isfinite(run.poses).all()
    report = slam.report()
    if np.abs(run.poses[-1, 1]) > MAX_UNSEEN_DISTANCE and label in GROWING:
        assert report["too_far"] > 0


@pytest.mark.parametrize("label", GROWING)
def test_a_map_at_its_limit_stops_growing_and_says_so(label):
    entry, log = find(label), drive(n=40)
    resolution = {"crsm": 0.02, "crsm@original": 0.005, "tsd@original": 0.01}.get(label, 0.02)
    cell = "resolution" if "resolution" in entry.params().specs() else "cell"
    slam, run, grid, _ = kept_mb(label, log, max_cells=1 << 16, **{cell: resolution})
    assert slam.report()["too_large"] > 0
    assert np.isfinite(run.poses).all()
    assert grid.p.size < 1 << 22, "what the first map has, nothing more"
    text = as_text(summarize(run, log, label, entry.params(), 0.0))
    assert "it has reached max_cells" in text
