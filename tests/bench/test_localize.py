"""What localizing in a map that stays is measured by."""

import numpy as np
import pytest

from bench import localize
from bench.sim.world import World


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
    monkeypatch.setattr(localize, "PLACES", 3)
    small = ("--arenas", "1", "--duration", "3", "--size", "8")
    assert localize.main([*small, "--algorithms", "hector"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("found from nothing: 3 of 3 right, ")
    own, plan = (line.split() for line in said.splitlines()[-2:])
    assert own[:3] == ["first", "drive:", "hector"] and plan[:3] == ["floor", "plan:", "hector"]
    (mean, worst, p95, first, arenas), of_plan = map(float, own[3:]), float(plan[3])
    assert 0.0 < mean < 10.0 and mean < of_plan < 30.0  # mm
    assert mean == worst < p95 and first > 0.0 and arenas == 1


def test_a_drive_that_is_not_found_is_no_arena_of_the_table():
    known = {"algorithm": "a", "map": "floor plan"}
    good = {"first_m": 0.002, "mean_m": 0.001, "p95_m": 0.004}
    better = {"first_m": 0.001, "mean_m": 0.0005, "p95_m": 0.001}
    (line,) = localize.drive_table([known | good, known | better, known]).to_numpy()
    assert line == pytest.approx([0.75, 1.0, 4.0, 1.5, 2.0])


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--arenas", "0"], "--arenas: got 0, expected 1 or more"),
        (["--algorithms", "odometry"], "odometry cannot localize in a map that is given"),
    ],
)
def test_what_cannot_be_measured_is_refused(arguments, sentence, capsys):
    assert localize.main(arguments) == 2
    assert sentence in capsys.readouterr().err
