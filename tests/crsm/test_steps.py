"""The steps of `Crsm.update`, one by one: each is taken where it is due, and only there."""

import dataclasses
import math

import numpy as np
import pytest

from bench.sim.degrade import degrade
from bench.sim.setting import Setting
from bench.sim.simulation import simulate
from crsm.choice import Match
from crsm.climb_kernels import FINEST
from crsm.climber import NEARBY, Climbed, Climber
from crsm.map_kernels import FULL
from crsm.params import CrsmParams
from crsm.slam import Crsm
from slams.types import IDENTITY, Pose2
from tests.rooms import calls, laser, scan_at, still

FAR = Pose2(1.0, 0.0, 0.0)


def settled(n=6, **changes):
    """CRSM after `n` scans of a robot that stands still."""
    slam = Crsm(CrsmParams(max_cells=1 << 20, **changes))
    for k in range(n):
        slam.update(still(k))
    return slam


def at(slam, pose):
    """What the climber would have found, were it `pose`."""
    view = slam._reader
    prior = slam._climber.prior(IDENTITY, 1e4 * np.eye(3), len(view.rays))
    return slam._climber.climb(slam._map, view, prior, 0.0)._replace(pose=pose)


def test_only_a_sweep_that_takes_time_is_read_and_matched_twice(monkeypatch):
    for time_increment, times in ((0.0, 1), (0.08 / 181, 2)):
        lidar = laser(181, time_increment=time_increment)
        slam = settled()
        read = calls(monkeypatch, slam._reader, "take")
        slam.update(scan_at((0.0, 0.0, 0.0), lidar, t=0.6))
        assert len(read) == times


def test_the_pose_that_is_returned_is_that_of_a_sweeps_first_beam():
    lidar = laser(181, time_increment=0.08 / 181)
    slam = Crsm(CrsmParams(max_cells=1 << 20))
    for k in range(5):
        pose = Pose2(0.05 * k, 0.0, 0.0)
        found = slam.update(scan_at(pose, lidar, t=0.1 * k, odometry=pose))
    ahead = found.between(slam._track.pose).x  # half of 0.08 s at half a meter a second
    assert ahead == pytest.approx(0.02, abs=0.004)


def test_restarts_begin_with_the_motion_so_far_and_with_none(monkeypatch):
    slam = settled()
    slam._climber.usual.value = 2.0  # nothing is enough
    slam._track.predict(still(6))
    start = slam._track._prediction._replace(continued=Pose2(0.1, 0.0, 0.0))
    restarted = calls(monkeypatch, slam._climber, "restart")
    slam._climbed(slam._reader, start)
    before = slam._track.pose
    assert restarted[0][3] == [before @ start.continued, before]
    assert slam.report()["searched"] == 1 and slam.report()["restarts"] >= 2


@pytest.mark.parametrize(("state", "searched"), [("matched", 10), ("predicted", 2)])
def test_a_robot_that_is_not_matched_is_searched_for_twice_a_second(state, searched, monkeypatch):
    slam = settled()
    slam._climber.usual.value = 2.0  # nothing is enough
    start = slam._track.predict(still(6))._replace(dt=0.1)
    slam._track.state = state
    for _ in range(10):
        slam._climbed(slam._reader, start)
    assert slam.report()["searched"] == searched


def test_a_fit_from_the_prediction_competes_where_the_climb_ended_elsewhere(monkeypatch):
    slam = settled()
    fitted = calls(monkeypatch, slam._lines, "fit")
    for pose, starts in ((IDENTITY, [IDENTITY]), (FAR, [FAR, IDENTITY])):
        fitted.clear()
        match = slam._chosen(slam._reader, IDENTITY, at(slam, pose))
        assert [args[1] for args in fitted] == starts
        assert match.fit.pose == pytest.approx(IDENTITY, abs=0.01)


@pytest.mark.parametrize(("aside", "competes"), [(0.09, False), (0.11, True)])
def test_a_climb_competes_with_its_fit_only_from_elsewhere(aside, competes, monkeypatch):
    """Within a cell both explain the same share, and the prediction, where it began, costs less."""
    slam = settled()
    fit = slam._lines.seen_from(slam._reader, IDENTITY)
    monkeypatch.setattr(slam._lines, "fit", lambda view, start, prior: fit)
    seen = calls(monkeypatch, slam._lines, "seen_from")
    slam._chosen(slam._reader, IDENTITY, at(slam, Pose2(aside, 0.0, 0.0)))
    assert len(seen) == competes


@pytest.mark.parametrize(
    ("aside", "price", "explains", "wins"),
    [
        (0.08, 0.09, 0.9, False),  # the fit is not far from the prediction: not even looked at
        (0.08, 0.11, 0.796, True),  # alike
        (0.08, 0.11, 0.794, False),  # the fit pays, but explains more
        (0.11, 0.0, 0.9, True),
    ],
)
def test_a_climb_wins_from_a_fit_that_was_pulled_away_and_explains_no_more(
    aside, price, explains, wins, monkeypatch
):
    slam = settled()
    fit, there = slam._lines.seen_from(slam._reader, IDENTITY), Pose2(aside, 0.0, 0.0)
    monkeypatch.setattr(slam._lines, "fit", lambda view, start, prior: fit)

    def weighed(view, fit, refined):
        worth = 0.8 if refined else explains
        return Match(fit, worth, worth, worth - (price if refined else 0.0), refined)

    monkeypatch.setattr(slam, "_weighed", weighed)
    found = slam._chosen(slam._reader, there, at(slam, there))
    assert found.refined != wins


@pytest.mark.parametrize(("kind", "seed"), [("people", 2), ("people", 5), ("stall", 1)])
def test_the_robot_goes_along_with_nobody_and_on_with_stalled_wheels(kind, seed):
    """Legs seen twice say as much as posts; of a stall the fit alone knows, and explains more."""
    level = {"people": 8.0, "stall": 2.0}[kind]
    log = degrade(simulate(Setting("ring", seed=seed, duration=20.0)), kind, level, seed)
    log, slam = log.select(every=4), Crsm(CrsmParams())
    off = [before.between(slam.update(scan)) for before, scan in zip(true(log), log, strict=True)]
    assert max(math.hypot(step.x, step.y) for step in off) < 0.05  # up to 7 and 0.3 m


def true(log):
    poses = [Pose2(*row) for row in log.truth_at(log.t)]
    return [poses[0].between(pose) for pose in poses]


def test_what_wheels_and_gyro_say_does_not_keep_a_fit_from_being_taken():
    """Each is off by less than a cell, but always to one side: the heading would bend with them."""
    log = simulate(Setting("ring", seed=1, duration=10.0)).select(None, 4, True)
    truth, slam = log.truth_at(log.t), Crsm(CrsmParams())
    for scan in log:
        found = slam.update(scan)
    expected = Pose2(*truth[0]).between(Pose2(*truth[-1]))
    assert expected.between(found) == pytest.approx(IDENTITY, abs=0.006)


def test_a_match_is_worth_what_the_map_explains_less_what_it_contradicts(monkeypatch):
    slam = settled(12)
    view, track = slam._reader, slam._track
    there, off = (slam._lines.seen_from(view, pose) for pose in (IDENTITY, Pose2(0.3, 0.2, 0.0)))
    match = slam._weighed(view, off, True)
    assert match.quality == off.share
    assert match.evidence < match.quality - 0.05
    charge = track.charge(off.pose)
    assert charge > 0.0 and match.value == pytest.approx(match.evidence - charge)
    monkeypatch.setattr(track, "reachable", lambda pose: False)
    match = slam._weighed(view, there, True)
    assert match.value == pytest.approx(match.evidence - track.charge(there.pose) - 1.0)


def test_where_no_robot_can_be_is_refused(monkeypatch):
    slam = settled()
    monkeypatch.setattr(slam._track, "reachable", lambda pose: False)
    slam.update(still(6))
    assert (slam.report()["refused"], slam.state) == (1, "predicted")


@pytest.mark.parametrize(("share", "refused"), [(0.3, 1), (0.4, 0)])
def test_a_map_that_explains_much_less_than_usual_refuses(share, refused, monkeypatch):
    slam = settled()
    slam._usual.value = 1.0
    match = slam._weighed(slam._reader, slam._lines.seen_from(slam._reader, IDENTITY), True)
    match = match._replace(evidence=share, quality=0.77)  # of 0.35
    monkeypatch.setattr(slam, "_chosen", lambda view, expected, climbed: match)
    usual, fitness = (calls(monkeypatch, it, "learn") for it in (slam._usual, slam._climber))
    lines = calls(monkeypatch, slam._lines, "learn")
    slam.update(still(6))
    assert slam.report()["refused"] == refused
    assert slam.quality == 0.77
    assert [len(usual), len(fitness), len(lines)] == 3 * [1 - refused]


@pytest.mark.parametrize(
    ("state", "held", "adrift", "known"),
    [
        ("matched", False, False, True),
        ("predicted", False, False, False),
        ("predicted", True, False, True),
        ("lost", False, True, True),
        ("lost", False, False, False),
    ],
)
def test_what_is_matched_or_where_wheels_have_led_to_is_drawn(state, held, adrift, known):
    slam = settled()
    track, before = slam._track, slam.report()
    track.state, track.held, track.adrift = state, held, adrift
    for frozen, drawn in ((True, 0), (False, known)):
        slam.frozen = frozen
        slam._draw(slam._reader, 100.0)
        assert slam.report()["inserted"] - before["inserted"] == drawn
    assert slam.report()["rejected"] - before["rejected"] == 2 * (not known)


def test_a_frozen_map_takes_no_scan_whose_pose_is_given():
    slam = settled()
    for frozen, more in ((True, 0), (False, 1)):
        before, slam.frozen = slam.report()["inserted"], frozen
        slam.insert_at(still(6), FAR)
        assert slam.report()["inserted"] == before + more


def test_the_climb_alone_says_what_its_rays_measure():
    slam = settled(refine=False)
    view, there = slam._reader, Pose2(0.01, -0.02, 0.3)
    view.normals[:2, view.rays[:3]] = 0.0  # lone points
    for dark in (FULL, 0.0):
        slam._map.cells.dark[:] = dark
        match = slam._chosen(view, IDENTITY, at(slam, there))
        assert not match.refined
        expected = np.zeros((3, 3))  # lone points tell nothing
        c, s = np.cos(there.theta), np.sin(there.theta)
        turn = np.array([[c, -s], [s, c]])
        for i in view.rays:
            (x, y), normal = turn @ view.points[:2, i], turn @ view.normals[:2, i]
            row = np.array([*normal, normal @ (-y, x)])
            expected += np.outer(row, row) / view.noise**2
        assert match.fit.seen == pytest.approx(dark / FULL * expected, rel=1e-4)


def test_the_climb_alone_keeps_no_lines_and_fits_nothing(monkeypatch):
    slam = settled(refine=False)
    assert slam._lines.surface.slot.max() == 0
    fitted = calls(monkeypatch, slam._lines, "_fitted")
    slam.update(still(6))
    assert not fitted and slam.state == "matched"


@pytest.mark.parametrize(("hits", "state"), [(9, "predicted"), (12, "matched")])
def test_a_scan_of_too_few_points_is_not_matched(hits, state):
    slam = settled()
    scan = still(6)
    ranges = np.where(np.abs(np.arange(181) - 90) <= hits // 2, scan.ranges, np.inf)
    slam.update(dataclasses.replace(scan, ranges=ranges.astype(np.float32)))
    assert slam._reader.n in (hits, hits + 1)
    assert slam.state == state


# the climber


def test_a_prior_counts_by_what_the_map_usually_leaves_unexplained():
    climber = Climber(CrsmParams())
    for usual, weight in ((0.0, 2.0), (0.7, 0.6), (1.0, 0.1)):
        climber.usual.value = usual
        assert climber.prior(FAR, np.eye(3), 10).weight == pytest.approx(weight / 10)


def test_draws_have_the_covariance_that_is_expected_within_the_window():
    climber = Climber(CrsmParams(search_distance=0.4, search_angle=0.5))
    deviation = np.array([0.01, 0.05, 0.02])
    drawn = climber._draws(climber.prior(FAR, np.diag(deviation**-2), 10), 4000)
    around, wide = drawn[:2000] - np.array(FAR), drawn[2000:] - np.array(FAR)
    assert around.std(axis=0) == pytest.approx(deviation, rel=0.1)
    assert np.abs(wide).max(axis=0) == pytest.approx([0.4, 0.4, 0.5], rel=0.01)
    drawn = climber._draws(climber.prior(FAR, 1e-2 * np.eye(3), 10), 400)
    assert (np.abs(drawn - np.array(FAR)) <= [0.4001, 0.4001, 0.5001]).all()


def test_first_steps_are_as_long_as_the_prediction_is_uncertain(monkeypatch):
    slam, steps = settled(), []
    climber = slam._climber
    monkeypatch.setattr(
        "crsm.climber.climb", lambda *args: steps.append(args[4]) or (0.0, 0.0, 0.0, 0.0)
    )
    prior = climber.prior(IDENTITY, np.eye(3), 10)
    for uncertain in (0.0, 0.005, 0.03, 9.0):
        climber.climb(slam._map, slam._reader, prior, uncertain)
    assert steps == [0.004, 0.008, 0.032, 0.064]


def test_the_broad_field_is_climbed_first_where_steps_are_long(monkeypatch):
    slam, climbed = settled(refine=False, sharp=5), []
    climber, walls = slam._climber, slam._map

    def found(grid, rays, prior, at, *steps):
        climbed.append((grid, at, steps))
        return (*FAR, 0.5)

    monkeypatch.setattr("crsm.climber.climb", found)
    prior = climber.prior(IDENTITY, np.eye(3), 10)
    climber.climb(walls, slam._reader, prior, 0.008)
    assert [(grid.sharp, at, steps) for grid, at, steps in climbed] == [
        (5, IDENTITY, (0.008, FINEST))
    ]
    climbed.clear()
    climber.climb(walls, slam._reader, prior, 0.03)
    assert [(grid.sharp, at, steps) for grid, at, steps in climbed] == [
        (2, IDENTITY, (0.032, NEARBY)),
        (5, FAR, (NEARBY, FINEST)),
    ]


def test_restarts_climb_from_what_promises_most_and_keep_the_best(monkeypatch):
    slam = settled()
    climber, prior = slam._climber, slam._climber.prior(IDENTITY, np.eye(3), 90)
    start = at(slam, FAR)._replace(score=-9.0)
    promises, scores = iter(range(1000)), iter([0.2, 0.5, 0.1, 0.3, 0.4, 0.0])
    begun = []

    def promising(cells, rays, prior, starts, out):
        out[:] = [next(promises) for _ in out]

    def climbed(walls, view, prior, pose, uncertain):
        begun.append(pose)
        return start._replace(pose=pose, fitness=0.0, score=next(scores))

    monkeypatch.setattr("crsm.climber.promising", promising)
    monkeypatch.setattr(climber, "_climb", climbed)
    monkeypatch.setattr(climber, "_draws", lambda prior, n: np.arange(3.0 * n).reshape(n, 3))
    climber.usual.value = 1.0
    found = climber.restart(slam._map, slam._reader, prior, [FAR], start)
    last = climber.params.restarts - 1
    assert begun == [
        FAR,
        *(Pose2(3.0 * k, 3.0 * k + 1, 3.0 * k + 2) for k in range(last, last - 5, -1)),
    ]
    assert (found.pose, found.score) == (begun[1], 0.5)


def test_enough_is_a_share_of_the_usual_fitness():
    climber = Climber(CrsmParams())
    climber.usual.value = 0.5
    for fitness, enough in ((0.46, True), (0.44, False)):  # of 0.9
        assert climber.is_enough(Climbed(IDENTITY, fitness, 0.0)) == enough
