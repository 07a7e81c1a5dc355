"""What localizing in a map that stays, and closing loops, are measured by."""

from types import SimpleNamespace

import numpy as np
import pytest

from bench import localize, loops
from bench.sim.world import World
from tests.floors import grid_of
from tests.rooms import ROOM, drive, laser


def test_a_floor_plan_is_dark_wherever_a_wall_is():
    occupied = np.zeros((10, 15), bool)
    occupied[0, 4] = occupied[8, 13] = True
    unknown = np.zeros_like(occupied)
    unknown[5:, :5] = True
    plan = localize.floor_plan(World(occupied, unknown, 0.02, (-1.0, 2.0)))
    assert plan.p.shape == (4, 6) and plan.origin == (-1.0, 2.0)
    assert np.argwhere(plan.p == 1.0).tolist() == [[0, 1], [3, 5]]
    assert np.isnan(plan.p[2:, :2]).all() and plan.p[0, 0] == 0.0


def test_errors_are_those_of_the_map_and_of_the_truth(capsys, monkeypatch):
    monkeypatch.setattr(localize, "SEARCHES_PER_ARENA", 3)
    small = ("--arenas", "1", "--duration", "3", "--size", "8")
    assert localize.main([*small, "--algorithms", "hector"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("global localization: 3 of 3 correct, ")
    own, plan = (line.split() for line in said.splitlines()[-2:])
    assert own[:3] == ["first", "drive:", "hector"] and plan[:3] == ["floor", "plan:", "hector"]
    (mean, worst, p95, first, arenas), of_plan = map(float, own[3:]), float(plan[3])
    assert 0.0 < mean < 10.0 and mean < of_plan < 30.0  # mm
    assert mean == worst < p95 and first > 0.0 and arenas == 1


def test_a_scan_of_too_few_beams_is_found_nowhere():
    place = SimpleNamespace(plan=grid_of(ROOM), first=drive(n=3, lidar=laser(11)))
    for found in localize._searched(place):
        assert (found["right"], found["confident"], found["error_m"]) == (False, False, np.inf)


def test_a_drive_that_is_not_found_is_no_arena_of_the_table():
    known = {"algorithm": "a", "map": "floor plan"}
    good = {"first_m": 0.002, "mean_m": 0.001, "p95_m": 0.004}
    better = {"first_m": 0.001, "mean_m": 0.0005, "p95_m": 0.001}
    (line,) = localize.drive_table([known | good, known | better, known]).to_numpy()
    assert line == pytest.approx([0.75, 1.0, 4.0, 1.5, 2.0])


@pytest.fixture
def small(monkeypatch):
    """A ring that is driven around once and a bit in a minute."""
    monkeypatch.setattr(loops, "BUILDING_SIZE", 16.0)
    monkeypatch.setattr(loops, "DRIVE_LENGTH", 80.0)
    monkeypatch.setattr(loops, "ROBOT_SPEED", 1.0)
    monkeypatch.setattr(loops, "LOOP_REVISIT_TIME", 20.0)


def test_keyframes_are_a_distance_or_rotation_apart():
    turned = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.1])
    x = np.array([0.0, 0.4, 0.8, 1.4, 1.4, 1.4, 1.4])
    assert loops._keyframes(np.column_stack([x, 0.0 * x, turned])) == [0, 2, 4]
    around = np.column_stack([0.0 * x, 0.0 * x, np.linspace(3.0, 3.3, 7)])  # across pi: no jump
    around[:, 2] = (around[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    assert loops._keyframes(around) == [0]


def test_a_building_has_a_short_sight_and_wheels_that_are_wrong(small):
    log = loops.building(3)
    assert log.laser.range_max == 8.0 and log.laser.n_beams == 181
    assert log.laser.angle_increment * 180 == pytest.approx(np.pi)
    true, counted = log.truth.values, log.odom.values
    way = np.hypot(*np.diff(true[:, :2], axis=0).T).sum()
    assert np.hypot(*np.diff(counted[:, :2], axis=0).T).sum() != pytest.approx(way, rel=1e-3)
    np.testing.assert_array_equal(loops.building(3).odom.values, counted)


def test_the_error_between_two_visits_separates_closed_and_open_loops(small):
    log = loops.building(3)
    blind = loops.replace(log, ranges=np.full_like(log.ranges, np.inf))
    for label in ("gmapping:n_particles=2", "tsd"):
        assert loops.revisit_error(log, label) < 0.1
        assert loops.revisit_error(blind, label) > 1.0  # by wheels alone


def test_a_line_for_each_algorithm_has_the_number_of_closed_loops(small, monkeypatch, capsys):
    errors = {"gmapping:n_particles=1": [0.2, 0.3], "hector+loops": [0.1, 0.054]}
    known = {label: iter(of) for label, of in errors.items()}
    monkeypatch.setattr(loops, "revisit_error", lambda log, label: next(known[label]))
    assert loops.main(["--algorithms", *errors, "--buildings", "2", "--seed", "3"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "gmapping:n_particles=1: 1 of 2 closed; error between two visits [m]: 0.20 0.30",
        "hector+loops: 2 of 2 closed; error between two visits [m]: 0.10 0.05",
    ]
