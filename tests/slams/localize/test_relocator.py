"""A lost robot is found again where its own map has the place, or stays lost."""

import numpy as np
import pytest

from crsm import Crsm, CrsmParams
from hector.params import HectorParams
from hector.slam import Hector
from slams.localize import relocator
from slams.localize.relocator import Relocator
from slams.motion.params import MotionParams
from slams.motion.track import Track
from slams.types import OccupancyGrid, Pose2, Scan
from tests.floors import ALIKE, grid_of
from tests.rooms import ROOM, laser, scan_at
from tsd.params import TsdParams
from tsd.slam import Tsd

LIDAR = laser(541, range_max=30.0)
HERE = Pose2(1.5, -2.0, 2.0)
DEFAULTS = [(Hector, HectorParams), (Tsd, TsdParams), (Crsm, CrsmParams)]


def stamped(k, pose=HERE, segments=ROOM):
    return scan_at(pose, LIDAR, segments, 0.01, np.random.default_rng(k), t=0.1 * k)


def lost_track():
    track = Track(MotionParams())
    for k in range(15):
        scan = stamped(k)
        track.predict(scan)
        track.matched(Pose2(0.0, 0.0, 0.0), 1e6 * np.eye(3), scan) if k == 0 else track.missed(scan)
    assert track.state == "lost"
    return track


class Drawn:
    """Draws a map, and counts how often."""

    def __init__(self, grid=None):
        self.grid, self.times = grid if grid is not None else grid_of(ROOM), 0

    def __call__(self):
        self.times += 1
        return self.grid


def run(track, draw, scans, on=True):
    relocator = Relocator(track, on)
    for k, scan in enumerate(scans):
        track.predict(scan)
        track.missed(scan)
        relocator.update(scan, draw)
        if track.state == "matched":
            return relocator, k
    return relocator, None


def test_who_is_lost_is_found_in_the_second_scan():
    track, draw = lost_track(), Drawn()
    found, k = run(track, draw, [stamped(15 + k) for k in range(5)])
    assert k == 1 and found.found == draw.times == 1
    assert track.pose == pytest.approx(HERE, abs=0.05)
    assert track.state == "matched" and not track.adrift


def test_switched_off_nothing_is_looked_for():
    draw = Drawn()
    found, k = run(lost_track(), draw, [stamped(15 + k) for k in range(5)], on=False)
    assert k is None and found.found == draw.times == 0


def test_who_is_not_lost_or_only_adrift_is_left_alone():
    draw = Drawn()
    for state, adrift in (("matched", False), ("predicted", False), ("lost", True)):
        track = lost_track()
        track.state, track.adrift = state, adrift
        Relocator(track, True).update(stamped(15), draw)
    assert draw.times == 0


def test_a_place_that_the_map_does_not_have_is_not_found():
    elsewhere = np.array([*ROOM[:1], (-2.0, 1.0, 3.0, 2.0), (3.0, 2.0, 4.0, -3.0)])
    scans = [stamped(15 + k, Pose2(0.0, 0.0, 0.0), elsewhere) for k in range(20)]
    found, k = run(lost_track(), Drawn(), scans)
    assert k is None and found.found == 0


def test_alike_rooms_are_not_guessed():
    draw = Drawn(grid_of(ALIKE, inside=(2.0, 1.5)))
    scans = [stamped(15 + k, Pose2(2.0, 1.5, 0.4), ALIKE) for k in range(20)]
    found, k = run(lost_track(), draw, scans)
    assert k is None and found.found == 0


def test_it_looks_ever_more_seldom_and_draws_the_map_once(monkeypatch):
    looked = []

    class Vain:
        candidates = ()

        def __init__(self, *_):
            pass

        def add(self, scan):
            looked.append(round(scan.t - 1.5, 1))

    monkeypatch.setattr(relocator, "Finder", Vain)
    draw = Drawn()
    run(lost_track(), draw, [stamped(15 + k) for k in range(200)])
    assert looked == [0.0, 0.5, 1.5, 3.5, 7.5, 15.5] and draw.times == 1


def matched_after_a_gap(pose):
    """A track that a scan after a gap of 9 s has been matched at `pose` by; the next scan."""
    track = Track(MotionParams())
    for k in range(15):
        scan = stamped(k)
        track.predict(scan)
        track.matched(Pose2(0.0, 0.0, 0.0), 1e6 * np.eye(3), scan)
    scan = stamped(105)
    track.predict(scan)
    track.matched(pose, 1e6 * np.eye(3), scan)
    assert track.state == "lost" and track.unproven
    return track, scan


def test_a_match_after_a_gap_that_does_not_stand_proves_nothing():
    track, _ = matched_after_a_gap(Pose2(2.0, 1.0, 0.5))
    for k in range(106, 130):  # every other scan is matched
        scan = stamped(k)
        track.predict(scan)
        if k % 2:
            track.matched(Pose2(2.0, 1.0, 0.5), 1e6 * np.eye(3), scan)
        else:
            track.missed(scan)
        assert track.state == "lost" and track.proving
    for k in range(130, 142):
        scan = stamped(k)
        track.predict(scan)
        track.matched(Pose2(2.0, 1.0, 0.5), 1e6 * np.eye(3), scan)
    assert track.state == "matched" and not track.proving
    track, _ = matched_after_a_gap(Pose2(2.0, 1.0, 0.5))
    for k in range(106, 120):
        scan = stamped(k)
        track.predict(scan)
        track.missed(scan)
    assert track.state == "lost" and not track.proving  # lost as ever


def test_who_matches_now_and_then_after_a_gap_is_found_elsewhere():
    wrong = Pose2(2.0, 1.0, 0.5)
    track, scan = matched_after_a_gap(wrong)
    relocator, draw = Relocator(track, True), Drawn()
    relocator.update(scan, draw)
    scan = stamped(106)
    track.predict(scan)
    track.missed(scan)
    relocator.update(scan, draw)
    assert relocator.found == 1 and track.state == "matched"
    assert track.pose == pytest.approx(HERE, abs=0.05)


def test_a_match_after_a_gap_that_goes_through_walls_does_not_become_right(monkeypatch):
    wrong = Pose2(2.0, 1.0, 0.5)
    track, scan = matched_after_a_gap(wrong)
    relocator = Relocator(track, True)
    monkeypatch.setattr(relocator, "_look", lambda *_: None)
    for k in range(106, 125):
        scan = stamped(k)
        track.predict(scan)
        track.matched(wrong, 1e6 * np.eye(3), scan)
        relocator.update(scan, Drawn())
    assert track.state == "lost" and track.unproven


def test_a_map_without_walls_is_no_reason_to_break():
    empty = OccupancyGrid(np.full((9, 9), np.nan, np.float32), 0.05, (0.0, 0.0))
    found, k = run(lost_track(), Drawn(empty), [stamped(15 + k) for k in range(5)])
    assert k is None and found.found == 0


@pytest.mark.parametrize(("kind", "params"), DEFAULTS)
@pytest.mark.parametrize("on", [True, False])
def test_an_algorithm_carried_elsewhere_in_its_map_is_found_again(kind, params, on):
    slam = kind(params(relocate=on))
    for k in range(30):
        slam.update(stamped(k, Pose2(-3.0 + 0.05 * k, 1.0, 0.0)))
    dark = Scan(3.0, np.full(541, np.nan, np.float32), LIDAR)
    for k in range(30, 45):
        slam.update(Scan(0.1 * k, dark.ranges, LIDAR))
    there = Pose2(1.5, -2.0, 2.0)
    for k in range(45, 80):
        found = slam.update(stamped(k, there))
    off = Pose2(-3.0, 1.0, 0.0).between(there)
    report = slam.report()
    assert report.get("relocalized", report.get("found_again")) <= on
    if on:
        assert found == pytest.approx(off, abs=0.03)
        assert slam.state == "matched"
