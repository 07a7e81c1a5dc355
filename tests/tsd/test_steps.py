"""The steps of `Tsd.update`, one by one: each is taken where it is due, and only there."""

import math

import numpy as np
import pytest

from slams.types import IDENTITY, Pose2
from tests.rooms import calls, laser, scan_at, still
from tests.tsd.cases import default
from tsd.evidence import Match
from tsd.registration import Found
from tsd.search import SHORTEST, UNCERTAIN

FAR = Pose2(1.0, 0.0, 0.0)
FINE = Match(IDENTITY, 1.0, 1.0, 1.0, 0.01, 1e6 * np.eye(3))
POOR = Match(IDENTITY, 0.1, 0.02, 0.0, 0.1, np.zeros((3, 3)))


def settled(n=5, **changes):
    """tsd after `n` scans of a robot that stands still."""
    slam = default(**changes)
    for k in range(n):
        slam.update(still(k))
    return slam


def test_only_a_sweep_that_takes_time_is_seen_again(monkeypatch):
    slam = settled()
    scan, reached = still(5), Pose2(0.1, 0.0, 0.0)
    slam._track.predict(scan)
    assert not slam._looks_again(scan, reached)
    lidar = laser(181, time_increment=0.08 / 181)
    swept = scan_at((0.0, 0.0, 0.0), lidar, t=0.6)
    slam._view.take(swept, IDENTITY)
    slam._track.missed(scan)
    slam._track.predict(swept)
    for velocity, again in (
        (IDENTITY, False),
        (Pose2(0.002 / 0.08, 0.0, 0.0), True),  # blurs by more than 2 mm, or by a milliradian
        (Pose2(0.001 / 0.08, 0.0, 0.0), False),
        (Pose2(0.0, 0.0, 0.0011 / 0.08), True),
        (Pose2(0.0, 0.0, -0.0009 / 0.08), False),
    ):
        slam._velocity = IDENTITY
        moved = Pose2(*(1.02 * v for v in velocity))
        monkeypatch.setattr(slam._track.motion, "velocity_to", lambda pose, moved=moved: moved)
        assert slam._looks_again(swept, IDENTITY) == again, velocity
        assert slam._velocity == (moved if again else IDENTITY)


def test_a_sweep_is_posed_again_only_if_its_first_pose_is_good(monkeypatch):
    slam = settled()
    seen = []
    monkeypatch.setattr(slam, "_looks_again", lambda scan, pose: seen.append(pose) or True)
    posed = calls(monkeypatch, slam, "_pose")
    slam.update(still(5))
    assert len(posed) == 2 and posed[1][0] == seen[0]
    monkeypatch.setattr(slam, "_pose", lambda start, known: POOR)
    slam._searched = False
    slam.update(still(6))
    assert len(seen) == 1


def test_the_pose_that_is_returned_is_that_of_a_sweeps_first_beam():
    lidar = laser(181, time_increment=0.08 / 181)
    slam = default()
    for k in range(5):
        pose = Pose2(0.05 * k, 0.0, 0.0)
        found = slam.update(scan_at(pose, lidar, t=0.1 * k, odometry=pose))
    ahead = found.between(slam._track.pose).x  # half of 0.08 s at half a meter a second
    assert ahead == pytest.approx(0.02, abs=0.004)


def test_a_given_pose_is_entered_unless_the_map_is_frozen():
    slam = settled()
    for frozen, more in ((True, 0), (False, 1)):
        before, slam.frozen = slam.report()["pushed"], frozen
        slam.insert_at(still(5), FAR)
        assert slam.report()["pushed"] == before + more
    assert slam._pushed_at == FAR


@pytest.mark.parametrize(
    ("pose", "moved"),
    [
        (Pose2(0.04, 0.02, 0.02), False),
        (Pose2(0.04, 0.04, 0.0), True),
        (Pose2(0.0, 0.0, 0.04), True),
        (Pose2(0.0, 0.0, -0.04), True),
    ],
)
def test_a_scan_is_pushed_after_a_way_or_a_turn(pose, moved):
    slam = settled()
    slam._track.pose = pose
    assert slam._moved() == moved


def test_at_rest_nothing_is_pushed():
    assert settled(6).report()["pushed"] == 1


@pytest.mark.parametrize(
    ("state", "adrift", "pushed"),
    [("matched", False, 1), ("lost", True, 1), ("lost", False, 0)],
)
def test_what_is_matched_or_only_adrift_is_pushed(state, adrift, pushed, monkeypatch):
    slam = settled()
    track, before = slam._track, slam.report()["pushed"]
    monkeypatch.setattr(slam, "_pose", lambda start, known: FINE)
    slam._searched = False

    def matched(pose, seen, scan, rough=False, leads=None):
        track.pose, track.state, track.adrift = FAR, state, adrift

    monkeypatch.setattr(track, "matched", matched)
    slam.update(still(5))
    assert slam.report()["pushed"] - before == pushed


@pytest.mark.parametrize(
    ("held", "contradicted", "restarted"),
    [(True, False, 1), (True, True, 0), (False, False, 0)],
)
def test_a_refused_scan_is_mapped_where_wheels_have_held_the_pose(
    held, contradicted, restarted, monkeypatch
):
    slam = settled()
    monkeypatch.setattr(slam, "_pose", lambda start, known: POOR)
    slam._searched = False
    monkeypatch.setattr(slam._track, "missed", lambda scan: None)
    monkeypatch.setattr(slam._direct, "contradicts", lambda pose: contradicted)
    slam._track.held, before = held, slam.report()["pushed"]
    slam.update(still(5))
    report = slam.report()
    assert (report["rejected"], report["restarted"]) == (1, restarted)
    assert report["pushed"] - before == restarted


def test_what_a_field_contradicts_is_where_fewer_than_half_agree(monkeypatch):
    slam = settled()
    for agree, contradicts in ((49.0, True), (51.0, False)):
        monkeypatch.setattr(slam._direct, "_along", lambda *_, agree=agree: (100.0, agree))
        assert slam._direct.contradicts(IDENTITY) == contradicts


@pytest.mark.parametrize("refine", [True, False])
def test_the_track_may_look_along_a_corridor_where_scans_are_refined(refine, monkeypatch):
    slam = settled(refine=refine)
    told = calls(monkeypatch, slam._track, "matched")
    learned = calls(monkeypatch, slam._evidence, "learn")
    slam.update(still(5))
    assert told[0][3] == (slam._direct.leads if refine else None)
    assert len(learned) == 1 and slam.quality == learned[0][0].close


@pytest.mark.parametrize("refine", [True, False])
def test_of_two_that_are_one_the_refined_wins_or_in_preset_paper_that_of_icp(refine, monkeypatch):
    slam = settled(refine=refine)
    weighed = calls(monkeypatch, slam._evidence, "best")
    slam.update(still(5))
    first, *_ = weighed[0][0]
    assert (first is slam._refined[0]) if refine else (first.pose is slam._posed[0])


def test_what_icp_finds_where_the_field_was_aligned_already_is_not_aligned_again(monkeypatch):
    slam, posed = settled(), Found(FINE.pose, FINE.information)
    monkeypatch.setattr(slam._registration, "icp", lambda start, known: posed)
    for elsewhere, found in ((False, 0), (True, 2)):
        slam._posed, slam._refined = [], [FINE._replace(pose=FAR if elsewhere else IDENTITY)]
        assert len(slam._candidates(IDENTITY, IDENTITY)) == found


def test_the_first_search_tries_the_last_pose_and_motion_too(monkeypatch):
    slam = settled()
    slam._track.predict(still(5))
    known = slam._track._prediction._replace(continued=Pose2(0.1, 0.0, 0.0))
    monkeypatch.setattr(slam._registration, "ransac", lambda start, width: [FAR])
    before = slam._track.pose
    assert slam._proposed(IDENTITY, known, 1.0) == [before, before @ known.continued, FAR]
    assert slam._proposed(IDENTITY, known, 2.0) == [FAR]


def test_a_search_goes_from_narrow_to_wide_and_from_what_it_proposes(monkeypatch):
    slam = settled()
    known, tried = slam._track.predict(still(5)), []
    monkeypatch.setattr(slam._search, "wanted", lambda match, width: True)
    monkeypatch.setattr(slam, "_proposed", lambda start, known, width: [Pose2(width, 0.0, 0.0)])
    monkeypatch.setattr(
        slam, "_candidates", lambda start, known: tried.append((start, known)) or []
    )
    slam._pose(IDENTITY, known)
    starts = [Pose2(1.0, 0.0, 0.0), Pose2(2.0, 0.0, 0.0)]
    assert tried == [(IDENTITY, known.pose), *((start, start) for start in starts)]


# when it is searched


def test_a_search_is_wanted_in_doubt_and_the_wide_one_only_if_the_map_hardly_knows_the_scan():
    slam = settled()
    search, track = slam._search, slam._track
    fine = FINE._replace(close=slam._evidence.usual.value)
    for uncertain, wanted in ((0.9 * UNCERTAIN, False), (1.1 * UNCERTAIN, True)):
        track.expected = np.diag([uncertain**2, 0.0, 0.0])
        assert search.wanted(fine, 1.0) == wanted
        assert search.wanted(POOR, 1.0) and search.wanted(POOR, 2.0)
        assert not search.wanted(fine, 2.0)


def test_a_poor_scan_leaves_doubt_and_a_search_in_vain_is_fruitless():
    slam = settled()
    search = slam._search
    slam._track.expected = 1e-6 * np.eye(3)
    fine = FINE._replace(close=slam._evidence.usual.value)
    search.end(POOR, searched=True, better=False)
    assert search.fruitless and not search.wanted(POOR, 1.0)
    search.begin(1.01 * SHORTEST)
    assert search.wanted(fine, 1.0)
    search.end(fine, searched=True, better=True)
    assert not search.fruitless and not search.wanted(fine, 1.0)


# what speaks for a pose


def test_what_no_robot_can_reach_is_worth_less_and_never_good(monkeypatch):
    slam = settled()
    evidence = slam._evidence
    before = evidence.weigh(IDENTITY, np.zeros((3, 3)))
    assert evidence.good(before)
    monkeypatch.setattr(slam._track, "reachable", lambda pose: False)
    after = evidence.weigh(IDENTITY, np.zeros((3, 3)))
    assert after.worth == pytest.approx(before.worth - 1.0)
    assert not evidence.good(before)


def test_of_a_robot_that_is_lost_more_is_asked_than_of_one_adrift():
    slam = settled()
    track, some = slam._track, FINE._replace(known=0.3, close=0.25)
    for state, adrift, good in (
        ("matched", False, True),
        ("lost", True, True),
        ("lost", False, False),
    ):
        track.state, track.adrift = state, adrift
        assert slam._evidence.good(some) == good


def test_another_pose_must_lead_by_more_than_noise_gives():
    evidence = settled()._evidence
    other = FINE._replace(pose=FAR)
    for lead, wins in ((0.9, False), (1.1, True)):
        match = other._replace(worth=FINE.worth + lead * evidence.gain)
        assert (evidence.best([FINE, match]) is match) == wins


# the mechanism


@pytest.mark.parametrize(("least", "posed"), [(0.8, True), (1.0, False)])
def test_too_few_pairs_are_no_pose(least, posed):
    slam = settled(min_known=least)
    slam._view.take(still(5), IDENTITY)
    assert (slam._registration.icp(IDENTITY, IDENTITY) is not None) == posed
    assert slam._registration.icp(Pose2(30.0, 0.0, 0.0), IDENTITY) is None


def test_the_gate_of_a_noisy_laser_is_wider(monkeypatch):
    slam, rules = settled(), []
    monkeypatch.setattr("tsd.registration.icp", lambda *args: rules.append(args[5]) or (0, 0, 0))
    for noise in (0.01, 0.03):
        monkeypatch.setattr(type(slam._view), "noise", noise)
        slam._registration.icp(IDENTITY, IDENTITY)
    assert [rule.narrowest for rule in rules] == pytest.approx([0.05, 0.15])


def test_hypotheses_that_are_one_are_tried_once_and_within_the_window(monkeypatch):
    slam = settled()
    made = [(0.0, 0.0, 0.0, 5.0), (0.01, 0.0, 0.0, 9.0), (0.5, 0.0, 0.0, 7.0), (0.9, 0.0, 0.0, 0.0)]
    rules = []

    def try_pairs(field, lines, trials, some, count, start, rule, best):
        best[:] = 0.0
        best[: len(made)] = made
        rules.append(rule)

    monkeypatch.setattr("tsd.registration.try_pairs", try_pairs)
    found = slam._registration.ransac(IDENTITY, 2.0)
    assert found == [Pose2(0.01, 0.0, 0.0), Pose2(0.5, 0.0, 0.0)]
    assert rules[0].distance == pytest.approx(1.2)
    assert rules[0].least_cosine == pytest.approx(math.cos(1.2))


@pytest.mark.parametrize("fov", [1.5 * math.pi, 2.0 * math.pi * 720 / 721])
def test_the_rays_of_a_model_scan_fill_the_field_of_view(fov):
    slam = default()
    slam._view.take(scan_at((0.0, 0.0, 0.0), laser(721, fov=fov)), IDENTITY)
    fan = slam._registration._fan()
    last = fan.first + (fan.rays - 1) * fan.gap
    assert fan.rays == 90 and fan.first + last == pytest.approx(0.0)
    full = fov > 1.6 * math.pi
    assert last - fan.first == pytest.approx(2.0 * math.pi * 89 / 90 if full else fov)
    assert fan.around == (90 if full else 0)


def test_surely_no_noisier_than_declared_until_scans_show_it(monkeypatch):
    slam = settled()
    for seen, noise in ((0.015, 0.01), (0.03, 0.03)):
        slam._view._noise.value = seen
        assert slam._view.noise == noise


def test_hits_with_gaps_between_do_not_tell_of_a_slip():
    slam = settled()
    view, told = slam._view, []
    for sparse in (1.0, 200.0):  # times as far between two beams
        beams = view.beams._replace(angle_increment=sparse * view.beams.angle_increment)
        view.beams, kept = beams, view.beams
        told.append(slam._direct._along(IDENTITY, np.zeros((0, 2)), np.zeros((0, 2)))[0])
        view.beams = kept
    assert told[0] > 0.9 * view.count and told[1] < 0.1 * view.count


def test_things_that_moved_are_left_out_as_the_gate_closes():
    slam = settled(refine=False)
    view = slam._view
    slam._track.prior = lambda pose: np.zeros((3, 3))
    elements = view.elements[: view.count]
    moved = np.arange(view.count) % 10 == 0
    elements[moved, :2] += 0.3 * elements[moved, 2:4]  # toward the laser
    found = slam._registration.icp(IDENTITY, IDENTITY)
    assert math.hypot(found.pose.x, found.pose.y) < 1e-3
