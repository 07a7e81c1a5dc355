"""An algorithm with loops: wheels drift on a drive around a building, the return closes it."""

import math
import pickle
import subprocess
import sys
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import slams
from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from slams import metrics
from slams.loops import LoopEdge, PoseGraph
from slams.loops.detector import (
    AMBIGUITY_DISTANCE,
    LOCAL_MAP_RADIUS,
    LOOP_SEARCH_DEVIATIONS,
    MAX_UNMATCHED_KEYFRAMES,
    LoopDetector,
    Query,
    VerifiedMatch,
)
from slams.loops.matching import SearchResult, keyframe
from slams.loops.slam import MIN_CORRECTION, Redraw, _variances, looped
from slams.player import replay
from slams.registry import find, label_of
from slams.scanlog import TimeSeries
from slams.types import IDENTITY, Corrected, Pose2
from tests.rooms import ALGORITHMS, driven, still
from tests.wheels import Drifting

INFORMATION = np.diag((1e3, 1e3, 1e4))


@cache
def around():
    """Two laps of a ring of corridors, with wheels that have a heading error."""
    log = simulate(Setting("hall", seed=3, size=16.0, length=90.0, v=1.0, noise=0.01))
    log = log.rows(np.arange(0, len(log.t), 8))
    true = log.truth_at(log.t)
    bent, pose = [IDENTITY], IDENTITY
    for one, other in zip(true[:-1], true[1:], strict=True):
        step = Pose2(*one).between(Pose2(*other))
        pose = pose @ Pose2(1.01 * step.x, step.y, 1.01 * step.theta + 0.002 * abs(step.x))
        bent.append(pose)
    return replace(log, odom=TimeSeries(log.t, np.array(bent)), yaw_rate=None)


def new():
    cls = looped(Drifting)
    return cls(cls.Params())


@cache
def driven_around():
    """An algorithm without matching that has driven around with loops, and its run."""
    slam = new()
    return slam, replay(slam, around())


def ate(poses, log):
    return metrics.ate(poses, log.truth_at(log.t))


def test_loops_correct_the_poses_and_the_map_of_any_algorithm():
    log, (slam, run) = around(), driven_around()
    assert isinstance(slam, Corrected)
    assert slam.report()["loops"] > 5
    assert slam.report()["redrawn"] >= 1
    assert ate(run.corrected, log) < 0.3 * ate(run.poses, log)
    drawn = np.array([pose for _, pose in slam.slam.inserted])
    off = np.hypot(*(slam.graph.poses[: len(drawn)] - drawn)[:, :2].T)
    assert np.median(off) < 4.0 * MIN_CORRECTION  # the map has these poses, but for later loops


def test_every_loop_is_where_the_truth_has_it():
    log, (slam, _) = around(), driven_around()
    for edge in slam.graph.loops:
        stamps = [slam.keyframes[k].scan.t for k in (edge.earlier, edge.later)]
        one, other = (Pose2(*row) for row in log.truth_at(np.array(stamps)))
        off = one.between(other).between(edge.pose)
        assert math.hypot(off.x, off.y) < 0.15
        assert abs(off.theta) < 0.03


def test_a_drive_without_a_return_closes_nothing():
    log = around()
    log = log.rows(np.arange(0, len(log.t) // 6))
    slam = new()
    replay(slam, log)
    assert slam.report()["loops"] == 0


@pytest.mark.parametrize("name", ALGORITHMS)
def test_the_four_go_on_in_the_new_map(name):
    """A robot whose map is replaced keeps its motion: the next pose is a step from the last."""
    log = around()
    label = f"{name}+loops"
    entry = find(label)
    assert label_of(entry.cls) == label
    one = slams.create(name, relocate=False)
    for scan in log.rows(np.arange(40)):
        last = one.update(scan)
    other, scans = slams.create(name), list(log)
    moved, true = Pose2(2.0, -1.0, 0.7), [Pose2(*row) for row in log.truth_at(log.t)]
    for k in range(40):
        other.insert_at(scans[k], moved @ true[0].between(true[k]))
    one.adopt(other, moved @ last)
    found = (moved @ last).between(one.update(scans[40]))
    assert found == pytest.approx(true[39].between(true[40]), abs=0.03)


def test_a_state_goes_on_bit_for_bit(tmp_path):
    from slams.state import load_state, save

    log = around()
    scans, half = list(log), len(log.t) // 2
    slam = driven("hector+loops", log.rows(np.arange(half)))
    save(slam, tmp_path / "floor.state")
    again = load_state(tmp_path / "floor.state")
    for k in range(half, half + 60):
        assert again.update(scans[k]) == slam.update(scans[k])
    assert np.array_equal(again.corrected(), slam.corrected())


def test_parameters_pass_to_another_process():
    params = find("hector+loops").params().replace(loop_path=12.5)
    code = "import pickle, sys; print(pickle.load(sys.stdin.buffer).as_dict())"
    pickled = {"input": pickle.dumps(params), "capture_output": True, "check": True}
    shown = subprocess.run([sys.executable, "-c", code], **pickled).stdout.decode()
    assert shown.strip() == str(params.as_dict())


def test_while_frozen_nothing_enters_the_graph():
    slam, scans = new(), list(around())[:80]
    for scan in scans[:40]:
        slam.update(scan)
    n, slam.frozen = slam.graph.n, True
    poses = np.array([slam.update(scan) for scan in scans[40:]])
    assert slam.slam.frozen and slam.graph.n == n > 1
    assert slam.corrected()[40:] == pytest.approx(poses)


def test_an_algorithm_without_the_hooks_is_refused():
    with pytest.raises(TypeError, match=r"Odometry cannot close loops: it has no insert_at"):
        find("odometry+loops")


def test_a_step_is_as_uncertain_as_the_pose_against_the_map_not_as_the_map():
    slam = new()
    slam.slam.covariance, slam.slam.local_covariance = 9.0 * np.eye(3), np.diag([1.0, 2.0, 3.0])
    slam.slam.local_covariance[0, 1] = slam.slam.local_covariance[1, 0] = 0.5
    assert _variances(slam._covariance(), 0.0) == pytest.approx([1.0, 2.0, 3.0])
    assert _variances(slam._covariance(), 0.25 * math.pi) == pytest.approx([2.0, 1.0, 3.0])
    slam.slam.local_covariance[0, 1] = math.nan
    assert not slam._covariance().any()
    for k, variance in ((0, 0.01), (5, 0.04), (10, 0.01)):
        slam.slam.local_covariance = variance * np.eye(3)
        slam.update(still(k, odometry=Pose2(0.1 * k, 0.0, 0.0)))
    assert slam.graph._variances[1:] == pytest.approx(0.03, rel=0.02)  # of two steps of 0.5 m
    slam.slam.local_covariance = np.diag([0.01, 0.05, 0.01])
    slam.update(still(15, odometry=Pose2(1.5, 0.0, 0.5 * math.pi)))
    slam.update(still(20, odometry=Pose2(1.5, 0.5, 0.5 * math.pi)))  # after a turn on the spot
    assert slam.graph._variances[-1, :2].max() < 0.001


@pytest.mark.parametrize(
    ("jumps", "verified"),
    [("algorithm", True), ("algorithm", False), ("wheels", True), ("delayed scan", False)],
)
def test_a_loop_that_the_algorithm_closes_is_one_of_the_graph(jumps, verified):
    """The step is then that of the wheels: the whole path is corrected, not only its end.

    A jump without a verified loop makes the step uncertain, unless the pose jumps back.
    """
    slam, asked = new(), []

    def verify_jump(map_poses, pose):
        asked.append(pose)
        edge = LoopEdge(0, slam.graph.n - 1, map_poses[0].between(pose), np.diag((1e6, 1e6, 1e6)))
        return edge if verified else None

    slam._detector.verify_jump = verify_jump
    for k in range(12):
        lateral = 0.4 * (k == 7) if jumps == "delayed scan" else float(k >= 8)
        if k in {7, 8}:
            slam.slam._origin = Pose2(0.0, -lateral if jumps == "wheels" else lateral, 0.0)
        wheels = Pose2(0.1 * k, lateral if jumps == "wheels" else 0.0, 0.0)
        slam.update(still(k, odometry=wheels))
    first, spread = np.sqrt(slam.graph.uncertainty(0)[[1, -1], 1, 1])
    if jumps == "wheels" or not verified:
        assert len(asked) == (jumps != "wheels") and not slam.graph.loops
        expected = {"algorithm": 1.0, "wheels": 1.0, "delayed scan": 0.02}[jumps]
        assert first < 0.05 and spread == pytest.approx(expected, rel=0.5)
        return
    assert len(asked) == len(slam.graph.loops) == 1
    assert asked[0] == pytest.approx((0.5, 1.0, 0.0))
    assert spread < 0.1
    np.testing.assert_allclose(slam.graph.poses[1:, 1], 1.0, atol=0.01)


def test_after_a_redraw_keyframes_follow_in_the_new_map():
    log = around()
    slam = new()
    redrawn, loops = 0, -1
    for scan in log:
        pose, report = slam.update(scan), slam.report()
        if report["redrawn"] > redrawn:
            redrawn, loops = report["redrawn"], report["loops"]
        if report["loops"] == loops:  # no change of the graph since
            assert slam.corrected()[-1] == pytest.approx(pose, abs=1e-6)
    assert redrawn > 0


def test_a_redraw_whose_keyframes_have_moved_is_outdated():
    graph, made = PoseGraph(), Drifting(None)
    graph.append(IDENTITY, np.full(3, 1e-4))
    graph.append(Pose2(1.0, 0.0, 0.0), np.full(3, 1e-4))
    keys = [keyframe(still(k), IDENTITY) for k in range(2)]
    redraw = Redraw(made, keys)
    assert not redraw.is_outdated(graph)
    assert redraw.insert(4, graph) and not redraw.is_outdated(graph)
    graph.poses[1, 1] += 2.0 * MIN_CORRECTION
    assert redraw.is_outdated(graph)


def detector_of(steps, variances=1e-3, loop_path=10.0):
    """A detector over keyframes a step apart, whose scans match nowhere."""
    graph = PoseGraph()
    for step in steps:
        graph.append(step, np.full(3, variances))
    keys = [keyframe(still(k), IDENTITY) for k in range(graph.n)]
    detector = LoopDetector(graph, keys, loop_path)
    unmatched = SearchResult(IDENTITY, 0.0, np.zeros((2, 2)))
    detector._local_map = lambda middle: SimpleNamespace(search=lambda *_: unmatched)
    return detector, graph


def straight(n):
    return [IDENTITY, *[Pose2(0.5, 0.0, 0.0)] * (n - 1)]


def to_and_fro(times):
    """12 m, and back, and again."""
    return [IDENTITY, *([*straight(24)[1:], Pose2(0.5, 0.0, math.pi)] * times)[:-1]]


def suppose(detector, later, pose=IDENTITY):
    edge = LoopEdge(0, later, pose, INFORMATION)
    detector._hypothesis, detector._checked = [VerifiedMatch(edge, 0.8, True)], [later]


def test_a_hypothesis_waits_where_nothing_is_old_enough():
    """Later keyframes have no complete local map yet, earlier ones have no older keyframes."""
    detector, _ = detector_of(straight(30))
    suppose(detector, 22)
    assert detector.work() == []
    assert detector._hypothesis and detector._checked == [22]


def test_a_hypothesis_whose_prediction_is_ambiguous_is_dropped():
    """With an uncertainty as large as the distance of two rooms, any room would confirm it."""
    detector, _ = detector_of(straight(60), variances=0.2)
    suppose(detector, 40)
    assert detector._hypothesis_query() is None and not detector._hypothesis


def test_a_match_far_from_where_it_is_expected_does_not_fit():
    """The match is in another office that looks alike."""
    detector, _ = detector_of(straight(60))
    detector._verify = lambda edge, *_: VerifiedMatch(edge, 0.9, True)
    for off, is_expected in ((3.0, True), (4.0, False)):
        found = SearchResult(Pose2(off, 0.0, 0.0), 1.0, np.zeros((2, 2)))
        detector._local_map = lambda _, found=found: SimpleNamespace(search=lambda *_: found)
        query = Query(40, None, [], [], False)
        detector._match(query, (0, IDENTITY, np.eye(3)))
        assert query.matches[0].is_expected == is_expected


@pytest.mark.parametrize(
    ("drift", "score", "off", "accepted"),
    [(0.5, 0.9, 0.0, True), (5.0, 0.9, 0.0, False), (0.5, 0.5, 0.0, False), (0.5, 0.9, 0.2, False)],
)
def test_a_loop_of_the_algorithm_is_verified_as_others_are(drift, score, off, accepted):
    """Searched for at the algorithm's pose, in the map of the nearest old keyframe; gated.

    The match has to be at that pose: a delayed scan moves the pose, too, and closes no loop.
    """
    detector, graph = detector_of([*straight(30), Pose2(0.5, 0.0, math.pi), *straight(30)[1:]])
    detector._verify = lambda edge, *_: VerifiedMatch(edge, score, True)
    windows, maps = [], []

    def search(ends, window, enough):
        windows.append(window)
        return SearchResult(window.middle @ Pose2(off, 0.0, 0.0), 1.0, np.zeros((2, 2)))

    detector._local_map = lambda k: maps.append(k) or SimpleNamespace(search=search)
    drawn = [graph.pose(k) for k in range(graph.n)]
    at = Pose2(drift, 0.0, 0.0) @ graph.pose(-1)
    edge = detector.verify_jump(drawn, at)
    nearest = min(range(30), key=lambda k: math.hypot(*drawn[k].between(at)[:2]))
    assert maps[0] == graph.n - 1 and maps[1] == nearest
    assert windows[0].middle == pytest.approx(drawn[nearest].between(at))
    assert (edge is not None) == accepted
    if accepted:
        assert (edge.earlier, edge.later) == (nearest, graph.n - 1)
    assert detector_of(straight(12))[0].verify_jump(drawn[:12], at) is None  # nothing is old enough


@pytest.mark.parametrize(
    ("off", "score", "is_observed", "stays"),
    [
        (0.0, 0.0, True, False),
        (3.0, 1.0, True, False),
        (3.0, 1.0, False, True),
        (0.0, 1.0, True, True),
    ],
)
def test_a_hypothesis_is_dropped_but_not_by_corridors(off, score, is_observed, stays):
    """No match, or one elsewhere, rejects it; a match along a corridor does neither."""
    detector, _ = detector_of(straight(60))
    suppose(detector, 40)

    def search(ends, window, enough):
        return SearchResult(window.middle @ Pose2(off, 0.0, 0.0), score, np.zeros((2, 2)))

    detector._local_map = lambda middle: SimpleNamespace(search=search)
    detector._verify = lambda edge, *_: VerifiedMatch(edge, 0.5, is_observed)
    for _ in range(2 * MAX_UNMATCHED_KEYFRAMES):
        assert detector.work() == []
    assert bool(detector._hypothesis) == stays


def test_a_match_that_was_not_predicted_needs_a_higher_score():
    detector, _ = detector_of(straight(60))

    def best(*found, is_predicted=False):
        return detector._best(Query(40, None, [], list(found), is_predicted))

    edge = LoopEdge(0, 40, IDENTITY)
    good, weak = VerifiedMatch(edge, 0.9, True), VerifiedMatch(edge, 0.5, True)
    assert best(good, weak) is good
    assert best(weak) is None and best(VerifiedMatch(edge, 0.9, False)) is None
    assert best(weak, is_predicted=True) is weak
    assert best(good._replace(is_expected=False)) is None
    elsewhere = edge._replace(pose=Pose2(3.0 * LOCAL_MAP_RADIUS, 0.0, 0.0))
    assert best(good, VerifiedMatch(elsewhere, 0.85, True)) is None


def test_where_a_hypothesis_predicts_a_place_both_directions_are_tried():
    """A laser that faces ahead observes other walls on the way back."""
    detector, graph = detector_of(to_and_fro(4))
    suppose(detector, 60, graph.step(0, 60))
    headings = np.cos([graph.poses[k, 2] for k, *_ in detector._hypothesis_query().candidates])
    assert sorted(headings.tolist()) == pytest.approx([-1.0, 1.0])


def test_beside_a_keyframe_several_candidates_are_tried():
    """Else, with few scans and a large map, a search would last for many keyframes."""
    for tries, calls in ((1, 3), (4, 1)):
        detector, _ = detector_of(to_and_fro(2))
        query = detector._next_query()
        detector._query = query._replace(candidates=3 * query.candidates[:1])
        for _ in range(calls):
            assert detector._query is not None
            detector.work(tries)
        assert detector._query is None
    slam, given = new(), []
    slam._detector.work = lambda tries: given.append(tries) or []
    for k in range(12):
        slam.update(still(k, odometry=Pose2(0.1 * k, 0.0, 0.0)))
    assert given.count(1) > 6 and 1 < max(given) == given[0]


def test_a_place_has_one_candidate_for_each_direction():
    """Four times 12 m, to and fro: a laser observes other walls on the way back."""
    detector, graph = detector_of(to_and_fro(4), variances=0.02)
    query = detector._next_query()
    ahead = np.array([graph.poses[k] for k, *_ in query.candidates])
    for heading in (1.0, -1.0):
        places = np.sort(ahead[np.cos(ahead[:, 2]) * heading > 0.0, 0])
        assert len(places) >= 2 and np.diff(places).min() > LOCAL_MAP_RADIUS
        same = graph.poses[graph.path < graph.path[query.later] - 10.0]
        same = same[np.cos(same[:, 2]) * heading > 0.0, 0]
        assert np.abs(same[:, None] - places).min(axis=1).max() <= LOCAL_MAP_RADIUS


def test_only_places_that_the_covariance_allows_are_candidates():
    detector, graph = detector_of(to_and_fro(4), variances=2e-4)
    query = detector._next_query()
    places = np.array([graph.poses[k, 0] for k, *_ in query.candidates])
    deviation = max(math.sqrt(S[0, 0] + S[1, 1]) for *_, S in query.candidates)
    assert not query.is_predicted and len(places) > 1
    far = np.abs(places - graph.poses[query.later, 0]).max()
    assert far < AMBIGUITY_DISTANCE + LOOP_SEARCH_DEVIATIONS * deviation < LOCAL_MAP_RADIUS


def test_where_the_nearest_place_is_impossible_others_are_candidates():
    """A loop may make one place certain, 5 m beside, and leave those behind it open."""
    beside = [IDENTITY, *straight(24)[1:], Pose2(0.0, 6.0, math.pi), *straight(40)[1:]]
    detector, graph = detector_of(beside)
    covariances = np.tile(np.eye(3), (graph.n, 1, 1))
    graph.uncertainty = lambda later: covariances
    nearest = detector._next_query().candidates[0][0]
    covariances[nearest] *= 1e-6
    detector._last_query_path = 0.0
    candidates = [k for k, *_ in detector._next_query().candidates]
    assert candidates and nearest not in candidates


@pytest.mark.parametrize(("off", "waits"), [(0.2, True), (2.0, False)])
def test_after_a_loop_that_confirms_the_graph_the_next_search_waits(off, waits):
    slam = new()
    for k in range(12):
        slam.update(still(k, odometry=Pose2(0.5 * k, 0.0, 0.0)))
    step = slam.graph.step(0, 8) @ Pose2(off * MIN_CORRECTION, 0.0, 0.0)
    slam._detector.work = lambda _: [LoopEdge(0, 8, step, INFORMATION)]
    before = slam._detector._last_query_path
    slam.update(still(12, odometry=Pose2(6.0, 0.0, 0.0)))
    assert slam._detector._last_query_path == before + (LOCAL_MAP_RADIUS if waits else 0.0)


def test_a_graph_is_optimized_until_it_rests():
    slam = new()
    for k in range(12):
        slam.update(still(k, odometry=Pose2(0.5 * k, 0.0, 0.0)))
    slam.graph.loops.append(LoopEdge(0, 11, Pose2(2.0, 3.0, 2.0), INFORMATION))
    slam._is_optimizing = True
    while slam._is_optimizing:
        slam._work(still(12), IDENTITY, 1)
    assert slam.graph.iterate() < 1e-4
