"""The steps of `Hector.update`, one by one: each is taken where it is due, and only there."""

import numpy as np
import pytest

from hector import Hector, HectorParams
from hector.map_kernels import probability
from hector.match_kernels import Solver, gauss_newton, normal_equations
from hector.matcher import BLUR, FINE, ROUGH, Matcher, gap
from hector.slam import FEWEST
from slams.geometry import Prior
from slams.refine.lines import ENOUGH, Match
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Pose2, Scan
from tests.rooms import LIDAR, calls, laser, scan_at, still


def settled(n=12, **changes):
    """Hector after `n` scans of a robot that stands still."""
    slam = Hector(HectorParams(**changes))
    for k in range(n):
        slam.update(still(k))
    return slam


def matched_as(slam, monkeypatch, **changes):
    """Whatever is seen, the match is that of the last scan with other numbers."""
    found = slam._match._replace(**changes)
    monkeypatch.setattr(slam, "_matched", lambda points, start: found)
    monkeypatch.setattr(slam._matcher, "best", lambda points, tried, track: (tried[0], 1.0))


@pytest.mark.parametrize("rough", [True, False])
def test_the_track_is_told_whether_a_match_is_by_cells_alone(rough, monkeypatch):
    slam = settled()
    told = calls(monkeypatch, slam._track, "matched")
    matched_as(slam, monkeypatch, rough=rough)
    slam.update(still(12))
    assert told[0][3] is rough


def test_only_a_sweep_that_takes_time_is_read_and_matched_twice(monkeypatch):
    for time_increment, times in ((0.0, 1), (0.08 / 181, 2)):
        lidar = laser(181, time_increment=time_increment)
        slam = Hector(HectorParams())
        for k in range(3):
            slam.update(scan_at((0.0, 0.0, 0.0), lidar, t=0.1 * k))
        read = calls(monkeypatch, slam._scan, "take")
        slam.update(scan_at((0.0, 0.0, 0.0), lidar, t=0.3))
        assert len(read) == times


def test_the_pose_that_is_returned_is_that_of_a_sweeps_first_beam():
    lidar = laser(181, time_increment=0.08 / 181)
    slam = Hector(HectorParams())
    for k in range(5):
        pose = Pose2(0.05 * k, 0.0, 0.0)
        found = slam.update(scan_at(pose, lidar, t=0.1 * k, odometry=pose))
    ahead = found.between(slam._track.pose).x  # half of 0.08 s at half a meter a second
    assert ahead == pytest.approx(0.02, abs=0.004)


@pytest.mark.parametrize("hz", [10.0, 40.0])
def test_other_starts_are_tried_at_ten_hertz_and_no_oftener(hz, monkeypatch):
    slam, step = Hector(HectorParams()), 0.04  # m a scan: another start than to stand still
    tried, often = calls(monkeypatch, Matcher, "climb"), []
    for k in range(24):
        pose, before = Pose2(step * k, 0.0, 0.0), len(tried)
        slam.update(scan_at(pose, LIDAR, t=k / hz, odometry=pose))
        often.append(len(tried) - before > 1)
    assert sum(often[4:]) == (20 if hz == 10.0 else 5)


def test_where_no_robot_can_be_is_doubted_and_refused(monkeypatch):
    slam = settled()
    monkeypatch.setattr(slam._track, "reachable", lambda pose: False)
    slam.update(still(12))
    report = slam.report()
    assert (report["doubted"], report["refused"], slam.state) == (1, 1, "predicted")


def test_a_map_that_explains_less_than_usual_is_doubted(monkeypatch):
    slam = settled()
    for share, doubted in ((0.9, 0), (0.8, 1)):  # of 0.85
        slam._usual.value = 1.0
        matched_as(slam, monkeypatch, share=share)
        slam.update(still(12 + doubted))
        assert slam.report()["doubted"] == doubted


def test_what_is_usual_is_learned_from_matches_only(monkeypatch):
    slam = settled()
    learned = calls(monkeypatch, slam._usual, "learn")
    variances = calls(monkeypatch, slam._map.lines, "learn")
    slam.update(still(12))
    assert (len(learned), len(variances)) == (1, 1)
    monkeypatch.setattr(slam._track, "reachable", lambda pose: False)
    slam.update(still(13))
    assert (len(learned), len(variances)) == (1, 1)


def test_a_search_in_vain_is_repeated_ever_more_seldom(monkeypatch):
    slam = settled()
    monkeypatch.setattr(slam._matcher, "best", lambda points, tried, track: (tried[0], 0.0))
    monkeypatch.setattr(slam._track, "reachable", lambda pose: False)
    searched = []
    for k in range(80):
        slam.update(scan_at((0.0, 0.0, 0.0), LIDAR, t=1.2 + 0.025 * k))
        searched.append(slam.report()["searched"])
    at = np.flatnonzero(np.diff(searched, prepend=0))
    assert 4 <= len(at) <= 6
    assert (np.diff(at[1:]) > np.diff(at)[:-1]).all()


def test_a_map_is_entered_at_rest_until_it_has_settled_and_then_no_more():
    assert settled(10).report()["inserted"] == 10
    slam = settled(20)
    assert slam.report()["inserted"] == 10


@pytest.mark.parametrize(
    ("pose", "due"),
    [
        (Pose2(0.2, 0.1, 0.2), False),
        (Pose2(0.2, -0.2, 0.0), True),
        (Pose2(0.0, 0.0, 0.3), True),
        (Pose2(0.0, 0.0, -0.3), True),
    ],
)
def test_a_scan_is_due_after_a_way_or_a_turn(pose, due):
    slam = settled(11)
    slam._track.pose = pose
    assert slam._due(slam._scan) == due


def test_a_scan_is_due_where_the_map_explains_less_than_at_the_last_insertion():
    slam = settled(11)
    slam._key = slam._key._replace(share=1.0)
    for share, due in ((0.86, False), (0.84, True)):
        slam._match = slam._match._replace(share=share)
        assert slam._due(slam._scan) == due
    slam.frozen = True
    assert not slam._due(slam._scan)


@pytest.mark.parametrize(
    ("state", "adrift", "held", "said", "due"),
    [
        ("predicted", False, False, 1.0, False),
        ("predicted", False, True, 1.0, True),
        ("predicted", False, True, -1.0, False),
        ("lost", True, False, -1.0, True),
    ],
)
def test_without_a_match_only_what_wheels_have_led_to_is_mapped(
    state, adrift, held, said, due, monkeypatch
):
    slam = settled(5)  # a map that has not settled: whatever is known enters it
    track = slam._track
    track.state, track.adrift, track.held = state, adrift, held
    monkeypatch.setattr(slam._map, "evidence", lambda points, pose: np.full(points.n, said))
    assert slam._due(slam._scan) == due


def test_a_frozen_map_takes_no_scan_whose_pose_is_given():
    slam = settled(11)
    for frozen, more in ((True, 0), (False, 1)):
        slam.frozen = frozen
        slam.insert_at(still(11), Pose2(1.0, 0.0, 0.0))
        assert slam.report()["inserted"] == 10 + more


@pytest.mark.parametrize(
    ("climbed", "fits", "found"),
    [
        (0.02, {0.0: 0.0}, [0.0]),  # near the start: one fit, from there
        (0.04, {0.04: 0.03, 0.0: 0.0}, [0.0, 0.03]),  # half a cell off: one from the start, too
        (0.04, {0.04: 0.03, 0.0: 0.025}, [0.03]),  # which is the same
        (0.2, {0.2: 0.1, 0.0: 0.1}, [0.1, 0.2]),  # a cell off the fit: the pyramid's own, too
    ],
)
def test_lines_are_fitted_from_the_start_and_where_the_pyramid_went_far_from_there(
    climbed, fits, found, monkeypatch
):
    slam = settled(3)

    def match(x):
        return slam._match._replace(pose=Pose2(x, 0.0, 0.0))

    monkeypatch.setattr(
        slam._map.lines,
        "fit",
        lambda points, start, prior, close=False: match(fits[round(start.x, 3)]),
    )
    prior = Prior(IDENTITY, np.eye(3))
    tried = slam._tried(slam._scan, IDENTITY, match(climbed), prior)
    assert [one.pose.x for one in tried] == found
    slam.params = slam.params.replace(refine=False)
    tried = slam._tried(slam._scan, IDENTITY, match(climbed), prior)
    assert [one.pose.x for one in tried] == [climbed]


def test_what_the_pyramid_found_from_the_prediction_is_what_counts_as_kept(monkeypatch):
    slam = settled(3)

    def other(starts, points, expected):
        slam._posed = Pose2(1.0, 0.0, 0.0)
        return []

    monkeypatch.setattr(slam, "_from", other)
    before = slam.report()["kept"]
    slam.update(still(3))
    assert slam.report()["kept"] == before + 1


def test_one_step_of_gauss_newton_is_damped_and_limited():
    slam = settled(3)
    level, points, start = slam._map.levels[0], slam._scan, Pose2(0.03, -0.02, 0.01)
    H, b = np.zeros((3, 3)), np.zeros(3)
    normal_equations(level, points.points, points.n, 1, start, H, b)
    nothing = Prior(IDENTITY, np.zeros((3, 3)))
    for damping in (0.0, 0.5):
        one = Solver(1, 9.0, 9.0, 0.0, damping, 1)
        pose, _, _ = gauss_newton(level, points.points, points.n, start, nothing, one, 0.0 * H)
        step = np.linalg.solve(H + damping * np.diag(np.diag(H)), b)
        assert np.array(pose) - np.array(start) == pytest.approx(step, rel=1e-6)
    short = Solver(1, 0.5 * np.hypot(*step[:2]), 0.5 * abs(step[2]), 0.0, damping, 1)
    pose, _, _ = gauss_newton(level, points.points, points.n, start, nothing, short, 0.0 * H)
    assert np.array(pose) - np.array(start) == pytest.approx(0.5 * step, rel=1e-6)


def test_what_cells_say_is_never_surer_than_their_ridges_are_exact():
    slam = settled(12)
    prior = Prior(IDENTITY, 1e4 * np.eye(3))
    points, matcher = slam._scan, slam._matcher
    found = matcher.climb(points, IDENTITY, prior)
    level = slam._map.levels[0]
    solver = matcher._solvers(points.n // ENOUGH)[0]
    H = np.zeros((3, 3))
    _, _, square = gauss_newton(level, points.points, points.n, found.pose, prior, solver, H)
    assert found.seen == pytest.approx(H / max(square, BLUR), rel=0.05, abs=1.0)
    assert found.seen[0, 0] > 5.0 * H[0, 0]


def test_two_poses_are_apart_as_the_ends_half_way_out_see_it():
    points = settled(1)._scan
    points.far = 8.0
    for other, apart in ((Pose2(0.3, 0.4, 0.0), 0.5), (Pose2(0.0, 0.0, -0.1), 0.4)):
        assert gap(points, IDENTITY, other) == pytest.approx(apart)
    across = gap(points, Pose2(0.0, 0.0, 3.1), Pose2(0.0, 0.0, -3.1))
    assert across == pytest.approx(4.0 * (2.0 * np.pi - 6.2))


@pytest.mark.parametrize(
    ("level", "n", "stride"), [(0, 1080, 4), (2, 1080, 4), (2, 400, 2), (0, 90, 1), (2, 90, 1)]
)
def test_fewer_beams_are_climbed_with_where_there_are_many(level, n, stride):
    solver = Matcher(HectorParams(), None)._solvers(n // ENOUGH)[level]
    assert solver.stride == stride
    cell = 0.05 * 2**level
    assert solver.tolerance == pytest.approx((ROUGH if stride > 1 else FINE) * cell)


@pytest.mark.parametrize(("level", "n", "stride"), [(0, 1080, 1), (1, 1080, 2), (2, 90, 1)])
def test_the_pyramid_alone_takes_all_beams_at_its_finest_level(level, n, stride):
    params = HectorParams(refine=False)
    solver = Matcher(params, None)._solvers(n // ENOUGH)[level]
    assert solver.stride == stride
    cell = 0.05 * 2**level
    assert solver.tolerance == pytest.approx(FINE * cell if level else params.converged)


def test_a_search_looks_at_the_coarsest_level_and_gives_the_best_first(monkeypatch):
    slam, told = settled(3), []

    def search(level, points, n, stride, center, window, out):
        told.append((level, window))
        out[:, 3] = np.arange(len(out))
        out[:, 0] = 10.0 * out[:, 3]

    monkeypatch.setattr("hector.map.match_kernels.search", search)
    found = slam._map.search(slam._scan, IDENTITY)
    (level, window), params = told[0], slam.params
    assert level is slam._map.levels[-1]
    assert window.shifts == round(params.search_distance / level.resolution)
    assert window.turns * window.turn_step == pytest.approx(params.search_angle, abs=0.1)
    last = 2 * window.turns
    assert [pose.x for pose in found] == [10.0 * (last - k) for k in range(params.search_tries)]


def test_what_was_never_seen_has_no_probability():
    assert [round(float(probability(x)), 4) for x in (0.0, 1.0, -1.0)] == [0.0, 0.7311, 0.2689]


# what speaks for a pose


def chosen(monkeypatch, said, charges, reachable=(True, True)):
    """Of two matches the one that `Matcher.best` takes: evidence of beams, price, reachable."""
    slam = settled(1)
    poses = [Pose2(0.0, 0.0, 0.0), Pose2(1.0, 0.0, 0.0)]
    tried = [Match(pose, 0.9, 1e-4, np.eye(3)) for pose in poses]
    evidence = dict(zip(poses, said, strict=True))
    monkeypatch.setattr(slam._map, "evidence", lambda points, pose: evidence[pose])
    track = slam._track
    monkeypatch.setattr(track, "charge", lambda pose: charges[poses.index(pose)])
    monkeypatch.setattr(track, "reachable", lambda pose: reachable[poses.index(pose)])
    return tried.index(slam._matcher.best(EndPoints(slam.params), tried, track)[0])


def test_another_start_wins_by_more_than_it_costs_to_contradict_the_prediction(monkeypatch):
    first, better = np.full(100, 0.5), np.full(100, 0.6)
    assert chosen(monkeypatch, (first, better), (0.0, 0.0)) == 1
    assert chosen(monkeypatch, (first, better), (0.0, 0.09)) == 1
    assert chosen(monkeypatch, (first, better), (0.0, 0.11)) == 0
    assert chosen(monkeypatch, (better, first), (0.2, 0.0)) == 1


def test_a_lead_that_may_be_chance_makes_a_contradiction_dearer(monkeypatch):
    first, few = np.zeros(100), np.where(np.arange(100) < 10, 1.0, 0.0)
    assert chosen(monkeypatch, (first, few), (0.0, 0.0)) == 1
    assert chosen(monkeypatch, (first, few), (0.0, 0.05)) == 0  # 0.1 < 0.05 + 2 * 0.3 / root(50)


def test_where_no_robot_can_be_is_no_match_unless_there_is_no_other(monkeypatch):
    first, better = np.full(100, 0.5), np.full(100, 0.9)
    assert chosen(monkeypatch, (first, better), (0.0, 0.0), (True, False)) == 0
    assert chosen(monkeypatch, (first, better), (0.0, 0.0), (False, False)) == 0
    assert chosen(monkeypatch, (better, first), (0.0, 0.0), (False, True)) == 1


@pytest.mark.parametrize(("ends", "begins"), [(FEWEST - 1, False), (FEWEST, True)])
def test_a_map_begins_with_a_scan_that_has_enough_to_be_found_again(ends, begins):
    slam = Hector(HectorParams())
    ranges = np.full(LIDAR.n_beams, np.inf, np.float32)
    ranges[:ends] = 2.0
    slam.update(Scan(0.0, ranges, LIDAR))
    report = slam.report()
    assert (report["inserted"], report["refused"], report["empty"]) == (int(begins), 0, 0)
    assert slam.state == ("matched" if begins else "predicted")
