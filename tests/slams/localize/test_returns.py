"""When a lost robot is brought back: how well its place is explained, how often it is sought."""

from dataclasses import replace

import numpy as np
import pytest

from slams.localize import relocator
from slams.localize.relocator import Relocator
from slams.localize.search import Atlas, Candidate
from slams.motion.params import MotionParams
from slams.motion.track import Track
from slams.types import IDENTITY, Pose2
from tests.rooms import laser, scan_at

LIDAR, PLACE = laser(181), Pose2(3.0, 2.0, 1.0)


class Guide(Atlas):
    """An atlas that has one place, explained by so much; it counts the searches."""

    def __init__(self, explained):
        self.explained, self.searches, self.looks = explained, [], []

    def search(self, scan):
        self.searches.append(scan.t)
        return [self.look(scan, PLACE)]

    def look(self, scan, pose):
        self.looks.append(scan.t)
        return Candidate(pose, self.explained, 0.0, 1.0)

    def farther_along(self, scan, pose, along):
        return None


def stamped(k, dark=False):
    scan = scan_at((0.0, 0.0, 0.0), LIDAR, t=0.1 * k)
    return replace(scan, ranges=np.full(181, np.inf, np.float32)) if dark else scan


def sought(monkeypatch, explained, scans=30, adrift=False, dark=0):
    """A track that is lost, and looked for in so many scans; the first `dark` of them are empty."""
    guide, track = Guide(explained), Track(MotionParams())
    monkeypatch.setattr(relocator, "Atlas", lambda grid: guide)
    for k in range(15):
        track.predict(stamped(k))
        if k == 0:
            track.matched(IDENTITY, 1e6 * np.eye(3), stamped(k))
        else:
            track.missed(stamped(k))
    assert track.state == "lost"
    seeker, looked = Relocator(track, True), []
    for k in range(15, 15 + scans):
        track.predict(stamped(k))
        track.missed(stamped(k))
        track.adrift = adrift
        before = track.lost
        seeker.update(stamped(k, k < 15 + dark), lambda: None)
        looked.append(track.lost - before)
        if track.state == "matched":
            break
    return track, seeker, guide, looked


def test_a_place_is_taken_in_the_second_look_and_its_scan_was_not_lost(monkeypatch):
    track, seeker, guide, looked = sought(monkeypatch, 0.8)
    assert (track.state, track.pose, seeker.found) == ("matched", PLACE, 1)
    assert looked == [0, -1]
    assert len(guide.searches) == 1


def test_a_place_that_is_explained_too_little_is_not_taken(monkeypatch):
    track, seeker, _, _ = sought(monkeypatch, 0.55)  # a finder would be sure from 0.5 on
    assert (track.state, seeker.found) == ("lost", 0)
    track, seeker, _, _ = sought(monkeypatch, 0.65)  # enough, soon after it was lost
    assert (track.state, seeker.found) == ("matched", 1)


def test_who_saw_nothing_for_seconds_is_found_where_he_can_have_come(monkeypatch):
    """Ground that was not mapped meanwhile explains nothing; what is out of reach is another's."""
    track, _, _, _ = sought(monkeypatch, 0.65, scans=60, dark=40)
    assert track.state == "matched"  # 3.6 m off, after 4 s
    monkeypatch.setattr(relocator, "PACE", 0.4)
    track, _, _, _ = sought(monkeypatch, 0.65, scans=60, dark=40)
    assert track.state == "lost"
    track, _, _, _ = sought(monkeypatch, 0.85, scans=60, dark=40)
    assert track.state == "matched"


def test_who_has_looked_for_seconds_may_be_off_the_map(monkeypatch):
    track, seeker, guide, _ = sought(monkeypatch, 0.55, scans=75, dark=40)
    assert track.state == "lost" and seeker._seeing > relocator.EARLY
    guide.explained = 0.65
    for k in range(90, 130):
        track.predict(stamped(k))
        track.missed(stamped(k))
        seeker.update(stamped(k), lambda: None)
    assert track.state == "lost"


def test_it_is_looked_for_ever_more_seldom(monkeypatch):
    _, _, guide, _ = sought(monkeypatch, 0.55, scans=1200)
    searches = np.array(guide.searches) - guide.searches[0]
    often = [int(((searches >= t) & (searches < t + 32.0)).sum()) for t in (0.0, 32.0, 64.0)]
    assert often[0] > often[1] >= often[2]
    assert 7 <= often[2] <= 10  # every other 8 s, a search every 2 to 3 s


def test_a_place_in_doubt_is_looked_at_ever_more_seldom(monkeypatch):
    _, _, guide, _ = sought(monkeypatch, 0.55, scans=85)
    looks = np.unique(np.round(guide.looks, 1))
    rests = np.diff(looks[looks < looks[0] + relocator.STAYS])
    assert rests[:2] == pytest.approx(0.1)
    assert (np.diff(rests) > -0.11).all()  # a scan more or less
    assert 0.9 < rests[-1] < 1.3


def test_who_is_adrift_is_not_looked_for(monkeypatch):
    track, _, guide, _ = sought(monkeypatch, 0.9, adrift=True)
    assert track.state == "lost" and guide.searches == []


@pytest.mark.parametrize(("agrees", "looks"), [(True, 1), (False, 2)])
def test_a_match_after_a_gap_that_the_map_confirms_is_believed_at_once(agrees, looks, monkeypatch):
    guide, track = Guide(0.9), Track(MotionParams())
    monkeypatch.setattr(relocator, "Atlas", lambda grid: guide)
    track.predict(stamped(0))
    track.matched(PLACE if agrees else IDENTITY, 1e6 * np.eye(3), stamped(0))
    seeker = Relocator(track, True)
    for k in range(1, 4):
        track.state, track._unproven, track._seconds = "lost", 1.0, 0.0
        seeker.update(stamped(k), lambda: None)
        if track.state == "matched":
            break
    assert k == looks
    assert seeker.found == (not agrees) and track.pose == PLACE
