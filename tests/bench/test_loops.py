import json

import numpy as np
import pytest

from bench import loops


@pytest.fixture
def small(monkeypatch):
    """A ring that is driven around once and a bit in a minute."""
    for name, value in {"SIZE": 16.0, "WAY": 80.0, "SPEED": 1.0, "AGAIN": 20.0}.items():
        monkeypatch.setattr(loops, name, value)


def test_key_scans_are_a_step_of_way_or_turn_apart():
    turned = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.1])
    x = np.array([0.0, 0.4, 0.8, 1.4, 1.4, 1.4, 1.4])
    assert loops._keys(np.column_stack([x, 0.0 * x, turned])) == [0, 2, 4]
    around = np.column_stack([0.0 * x, 0.0 * x, np.linspace(3.0, 3.3, 7)])  # over pi: no leap
    around[:, 2] = (around[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    assert loops._keys(around) == [0]


def test_a_building_has_a_short_sight_and_wheels_that_are_wrong(small):
    log = loops.building(3)
    assert log.laser.range_max == 8.0 and log.laser.n_beams == 181
    assert log.laser.angle_increment * 180 == pytest.approx(np.pi)
    true, counted = log.truth.values, log.odom.values
    way = np.hypot(*np.diff(true[:, :2], axis=0).T).sum()
    assert np.hypot(*np.diff(counted[:, :2], axis=0).T).sum() != pytest.approx(way, rel=1e-3)
    np.testing.assert_array_equal(loops.building(3).odom.values, counted)


def test_the_error_between_two_visits_tells_a_closed_loop_from_an_open_one(small):
    log = loops.building(3)
    blind = loops.replace(log, ranges=np.full_like(log.ranges, np.inf))
    for label in ("gmapping:n_particles=2", "tsd"):
        assert loops.revisit_error(log, label) < 0.1
        assert loops.revisit_error(blind, label) > 1.0  # by wheels alone


def test_what_is_written_and_said(small, tmp_path, capsys):
    out, labels = tmp_path / "loops", ["gmapping:n_particles=1", "hector+loops"]
    words = ["--algorithms", *labels, "--buildings", "1", "--seed", "3"]
    assert loops.main([*words, "--out", str(out)]) == 0
    found = json.loads((out / "loops.json").read_text())
    assert found["buildings"] == [3] and list(found["revisit_m"]) == labels
    said = capsys.readouterr().out
    for label, (error,) in found["revisit_m"].items():
        closed = f"{label}: {int(error <= 0.2)} of 1 closed; "
        assert f"{closed}error between two visits [m]: {error:.2f}\n" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--buildings", "0"], "--buildings: got 0, expected 1 or more"),
        (["--algorithms", "gmapping:n_particles=0"], "n_particles"),
        (["--algorithms", "nobody"], "nobody"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(words, said, tmp_path, capsys):
    assert loops.main([*words, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
