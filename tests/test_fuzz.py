"""Wrong numbers in logs, pushes and bags: a finite pose or a sentence, bounded memory, no rest."""

import pytest

from tests.fuzz.campaign import one, run

CASES = {"npz": 450, "live": 350, "bag": 200}
EACH = 12  # pushes into each algorithm
KEPT = [  # these once broke a property
    ("npz", 153, "odometry"),
    ("live", 81, "odometry"),
    ("live", 86, "odometry"),
    ("live", 37, "hector"),
    ("live", 40, "crsm"),
    ("live", 114, "crsm"),
]


@pytest.mark.parametrize("family", CASES)
def test_wrong_numbers_are_survived_or_refused(family):
    taken, broken = run(family, CASES[family])
    assert broken == []
    assert 0 < taken < CASES[family]


@pytest.mark.parametrize("algorithm", ["hector", "tsd", "crsm", "gmapping"])
def test_an_algorithm_survives_wrong_pushes(algorithm):
    taken, broken = run("live", EACH, algorithm, first=CASES["live"])
    assert broken == []
    assert taken > 0


@pytest.mark.parametrize(("family", "case", "algorithm"), KEPT)
def test_what_once_broke(family, case, algorithm):
    one(family, case, algorithm)
