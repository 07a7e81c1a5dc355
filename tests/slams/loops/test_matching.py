"""Matching with local maps: bounds hold, poses are found, walls are not seen through."""

import math

import numpy as np
import pytest

from slams.frontend.correlative import Window
from slams.loops.detector import _information
from slams.loops.matching import LocalMap, keyframe, observed, read
from slams.refine.lines import Match
from slams.test_world import drive, laser, scan_at
from slams.types import IDENTITY, Pose2

LIDAR = laser(n_beams=361)


def local_map():
    poses = [Pose2(0.3 * k, 0.1 * k, 0.1 * k) for k in range(4)]
    return LocalMap([keyframe(scan_at(p, LIDAR), IDENTITY) for p in poses], poses)


@pytest.mark.parametrize(("half", "rotation"), [(1.0, 0.3), (3.5, 3.0)])
def test_a_scan_is_found_in_a_wide_window(half, rotation):
    true = Pose2(0.9, -0.3, 0.4)
    scan = scan_at(true, LIDAR)
    key, place = keyframe(scan, IDENTITY), local_map()
    found = place.search(key.ends, Window(Pose2(0.4, 0.2, 0.2), half, rotation), 0.5)
    assert math.hypot(found.pose.x - true.x, found.pose.y - true.y) < 0.15
    points, middle = read(scan, IDENTITY)
    pose = place.fit(points, found.pose @ middle).pose
    assert pose == pytest.approx(true, abs=0.02)
    assert place.agreement(key.ends, pose) > 0.9


def test_what_is_seen_through_is_charged():
    place, true = local_map(), Pose2(0.6, 0.2, 0.0)
    ends = keyframe(scan_at(true, LIDAR), IDENTITY).ends
    right = place.agreement(ends, true)
    assert right > 0.9
    assert place.agreement(0.6 * ends, true) < 0.0  # walls in front of walls
    assert place.agreement(1.5 * ends, true) < 0.3  # hidden behind walls: neither for nor against


def test_a_corridor_is_observed_across_only():
    log = drive(n=1)
    points, _ = read(next(iter(log)), IDENTITY)
    spread = np.array(((0.25, 0.0), (0.0, 0.001)))
    across = observed(points, 0.0, spread)
    assert across @ np.array((1.0, 0.0)) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert across @ np.array((0.0, 1.0)) == pytest.approx([0.0, 1.0], abs=0.02)


def test_what_is_blind_along_two_directions_that_are_not_square_still_informs():
    """A corridor aslant to the direction in which poses match as well: no less than nothing."""
    axes = [np.array((math.cos(a), math.sin(a))) for a in (0.0, 0.6)]
    across, beside = (np.eye(2) - np.outer(axis, axis) for axis in axes)
    match = Match(IDENTITY, seen=np.diag((1e6, 1e4, 1e7)))
    assert np.linalg.eigvalsh(_information(match, across @ beside))[0] > 0.0
