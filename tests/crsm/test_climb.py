"""Random restart hill climbing: fitness and score by hand, the climb, its restarts."""

import math

import numpy as np
import pytest

from crsm import match_kernels
from crsm.map_kernels import add_walls
from crsm.match_kernels import WeightedPrior, climb, fitness, score
from crsm.matcher import (
    FIRST_RESTART_STEP,
    FIRST_STEP,
    LAST_STEP,
    LAST_STEP_BEFORE_LINES,
    MEAN_FITNESS_SCANS,
    Matcher,
)
from crsm.params import CrsmParams
from slams.frontend.motion_filter import Prediction
from slams.jit import njit
from slams.scan.end_points import pose_distance
from slams.types import IDENTITY, Pose2
from tests.crsm.room import mapped, noisy_view
from tests.crsm.test_map import RULE, blank, darkness_at, wall
from tests.rooms import calls

LOOSE = WeightedPrior(0.0, 0.0, 0.0, np.eye(3), 1e-6)
OFF = Pose2(0.33, -0.3, 0.4)


@njit(inner=True)
def fitness_at(grid, ends, pose):
    return fitness(grid, ends, pose)


@njit(inner=True)
def score_at(grid, ends, prior, pose):
    return score(grid, ends, prior, pose)


def one_wall():
    grid, ends = blank(), wall(0.0, 1.0)
    add_walls(grid, ends, len(ends), IDENTITY, 1, tuple(RULE))
    return grid


def expecting(pose, deviation):
    return Prediction(pose, np.eye(3) / deviation**2, np.eye(3) * deviation**2, IDENTITY, 0.1)


def test_fitness_is_the_mean_darkness_under_turned_ends():
    grid = one_wall()
    ends = np.array([[1.0, 0.0], [1.0, 0.3], [0.2, 0.0]])
    dark = [darkness_at(grid, x, y) for x, y in ends]
    assert fitness_at(grid, ends, (0.0, 0.0, 0.0)) == pytest.approx(np.mean(dark))
    turned = ends @ np.array([[0.0, -1.0], [1.0, 0.0]]) + (0.1, -0.2)  # by -90 degrees
    pose = (-0.2, -0.1, math.pi / 2)  # takes it back
    assert fitness_at(grid, turned, pose) == pytest.approx(np.mean(dark))
    assert match_kernels.fitness_of(tuple(grid), turned, pose) == pytest.approx(np.mean(dark))


def test_score_is_fitness_less_the_cost_of_the_prior():
    grid = one_wall()
    ends, information = np.array([[1.0, 0.0]]), np.diag([100.0, 400.0, 900.0])
    prior = WeightedPrior(0.1, 0.2, 0.3, information, 0.5)
    pose = (0.2, 0.1, 0.25)
    distance = 100 * 0.1**2 + 400 * 0.1**2 + 900 * 0.05**2
    expected = fitness_at(grid, ends, pose) - 0.5 * 3.0 * math.log1p(distance / 3.0)
    assert score_at(grid, ends, prior, pose) == pytest.approx(expected)


def test_climb_ends_where_no_finest_step_gains():
    slam, view = mapped(), noisy_view(9)
    levels, fine = tuple(map(tuple, slam._map.levels)), slam._map.levels[0]
    start = (0.04, -0.03, 0.03)
    (x, y, theta), fit, top = climb(levels, view.ends, tuple(LOOSE), start, 0.032, LAST_STEP)
    assert (abs(x), abs(y), abs(theta)) < (0.02, 0.02, 0.01)
    assert fit == pytest.approx(fitness_at(fine, view.ends, (x, y, theta)))
    assert top == pytest.approx(score_at(fine, view.ends, LOOSE, (x, y, theta)))
    for dx, dy in ((LAST_STEP, 0.0), (-LAST_STEP, 0.0), (0.0, LAST_STEP), (0.0, -LAST_STEP)):
        assert score_at(fine, view.ends, LOOSE, (x + dx, y + dy, theta)) <= top
    middle = view.ends.mean(axis=0)
    angle = LAST_STEP / np.sqrt(((view.ends - middle) ** 2).sum(axis=1).mean())
    for turn in (angle, -angle):  # about the middle of the rays
        before, after = Pose2(x, y, theta), Pose2(x, y, theta + turn)
        shift = before.transform(middle[None])[0] - after.transform(middle[None])[0]
        at = (x + shift[0], y + shift[1], theta + turn)
        assert score_at(fine, view.ends, LOOSE, at) <= top


def test_restarts_find_what_one_climb_does_not():
    slam, view = mapped(), noisy_view(9)
    matcher = Matcher(CrsmParams(), slam._map)
    alone = matcher.climb(view, OFF, expecting(OFF, 0.3))
    assert matcher.restarts == 0  # there is no mean fitness yet
    assert pose_distance(view, alone.pose, IDENTITY) > 0.2
    for _ in range(5 * MEAN_FITNESS_SCANS):
        matcher.learn(view, IDENTITY)
    found = matcher.climb(view, OFF, expecting(OFF, 0.3))
    assert pose_distance(view, found.pose, IDENTITY) < 0.05
    assert 0 < matcher.restarts <= CrsmParams().climbs + 1
    assert found.inlier_ratio > 0.9 * matcher.mean_fitness


def test_a_prior_counts_by_the_noise_over_the_width_of_a_wall(monkeypatch):
    slam, view = mapped(), noisy_view(9)
    made = calls(monkeypatch, match_kernels, "climb")
    for stroke in (0.5, 1.0):
        Matcher(CrsmParams(stroke=stroke), slam._map).climb(view, OFF, expecting(OFF, 0.3))
        expected = (view.noise / (0.05 * stroke)) ** 2 / len(view.ends)
        assert made[-1][2][-1] == pytest.approx(expected)


def test_a_fit_to_lines_follows_a_rough_climb_and_weighs_it(monkeypatch):
    slam, view = mapped(), noisy_view(9)
    made = calls(monkeypatch, match_kernels, "climb")
    rough = Matcher(CrsmParams(), slam._map).climb(view, IDENTITY, expecting(IDENTITY, 0.1))
    alone = Matcher(CrsmParams(refine=False), slam._map)
    found = alone.climb(view, IDENTITY, expecting(IDENTITY, 0.1))
    assert [finest for *_, finest in made] == [LAST_STEP_BEFORE_LINES, LAST_STEP]
    assert not rough.information.any()
    seen = view.information(found.pose.theta) * found.inlier_ratio
    assert found.information == pytest.approx(seen)


def test_long_steps_are_made_on_the_coarse_grid():
    slam, view = mapped(), noisy_view(9)
    levels = tuple(map(tuple, slam._map.levels))
    at = [
        climb(levels, view.ends, tuple(LOOSE), (0.25, -0.2, 0.25), step, LAST_STEP)[1]
        for step in (FIRST_STEP, FIRST_RESTART_STEP)
    ]
    assert at[1] > at[0] + 0.1
    assert at[1] > 0.6


def test_a_start_that_is_not_the_prediction_is_climbed_from_with_long_steps_alone(monkeypatch):
    slam, view = mapped(), noisy_view(9)
    matcher = Matcher(CrsmParams(), slam._map)
    matcher.mean_fitness = 2.0  # no climb reaches it
    made = calls(monkeypatch, match_kernels, "climb")
    matcher.climb(view, OFF, expecting(IDENTITY, 0.3))
    assert [step for *_, step, _ in made] == [FIRST_RESTART_STEP]
    assert matcher.restarts == 0
    matcher.climb(view, IDENTITY, expecting(IDENTITY, 0.3))
    assert [step for *_, step, _ in made][1:3] == [FIRST_STEP, FIRST_RESTART_STEP]
    assert made[1][3] == made[2][3] == tuple(IDENTITY)


def test_mean_fitness_is_a_moving_average():
    slam, view = mapped(), noisy_view(9)
    matcher = Matcher(CrsmParams(), slam._map)
    matcher.learn(view, IDENTITY)
    fit = fitness_at(slam._map.levels[0], view.ends, (0.0, 0.0, 0.0))
    assert matcher.mean_fitness == pytest.approx(fit / MEAN_FITNESS_SCANS)
