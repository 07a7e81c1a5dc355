"""What localizing in a map that stays is measured by."""

import json

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


def test_errors_are_those_of_the_map_and_of_the_truth(tmp_path, capsys):
    out = tmp_path / "out"
    small = ("--arenas", "1", "--places", "3", "--duration", "3", "--size", "8")
    assert localize.main([*small, "--algorithms", "hector", "--out", str(out)]) == 0
    found = json.loads((out / "localize.json").read_text())
    assert [row["right"] for row in found["searched"]] == [True] * 3
    own, plan = found["driven"]
    assert [row["map"] for row in found["driven"]] == ["first drive", "floor plan"]
    assert 0.0 < own["mean_m"] < 0.01 and own["mean_m"] < plan["mean_m"] < 0.03
    assert own["mean_m"] < own["p95_m"] and own["first_m"] > 0.0
    said = capsys.readouterr().out
    assert said.startswith("found from nothing: 3 of 3 right, ")
    assert "hector in the floor plan: mean " in said


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--arenas", "0"], "--arenas: got 0, expected 1 or more"),
        (["--algorithms", "odometry"], "odometry cannot localize in a map that is given"),
    ],
)
def test_what_cannot_be_measured_is_refused(arguments, sentence, tmp_path, capsys):
    assert localize.main([*arguments, "--out", str(tmp_path / "out")]) == 2
    assert sentence in capsys.readouterr().err
