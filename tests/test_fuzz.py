"""Wrong numbers in logs, pushes and bags: a finite pose or a sentence, bounded memory, no rest."""

import resource
import warnings

import numpy as np
import pytest

from tests.wrong_numbers import FAMILIES

ROOM = 300_000  # kB that all cases of a test may take
CASES = {"npz": 450, "live": 350, "bag": 200}
EACH = 12  # pushes into each algorithm
KEPT = [  # these once broke a property, as others did that are among the cases
    ("live", 37, "hector"),
    ("live", 40, "crsm"),
    ("live", 114, "crsm"),
]


def one(family, case, folder, algorithm="odometry"):
    """A case has a seed of its own, so that it can be run alone; whether its input was taken."""
    rng = np.random.default_rng([list(FAMILIES).index(family), case])
    inside = folder / f"{case}"
    inside.mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return FAMILIES[family](rng, inside, algorithm)


def run(family, cases, folder, algorithm="odometry"):
    """How many cases were taken, and a sentence for each that broke a property."""
    taken, broken = 0, []
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for case in cases:
        try:
            taken += one(family, case, folder, algorithm)
        except Exception as error:  # whatever it is, it is what the cases are after
            broken.append(f"{case}: {type(error).__name__}: {str(error)[:300]}")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < ROOM
    return taken, broken


@pytest.mark.parametrize("family", CASES)
def test_wrong_numbers_are_survived_or_refused(family, tmp_path):
    taken, broken = run(family, range(CASES[family]), tmp_path)
    assert broken == []
    assert 0 < taken < CASES[family]


@pytest.mark.parametrize("algorithm", ["hector", "tsd", "crsm", "gmapping"])
def test_an_algorithm_survives_wrong_pushes(algorithm, tmp_path):
    first = CASES["live"]
    taken, broken = run("live", range(first, first + EACH), tmp_path, algorithm)
    assert broken == []
    assert taken > 0


@pytest.mark.parametrize(("family", "case", "algorithm"), KEPT)
def test_what_once_broke(family, case, algorithm, tmp_path):
    one(family, case, tmp_path, algorithm)
