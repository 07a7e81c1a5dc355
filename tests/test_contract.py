"""The contract of `update`, each clause over every registered algorithm and preset."""

import numpy as np
import pytest

from slams import check
from slams.player import replay
from slams.registry import find, names
from tests.rooms import drive

LABELS = [
    f"{name}@{preset}" if preset != "default" else name
    for name in names()
    for preset in find(name).cls.Params.presets()
]


@pytest.mark.parametrize("clause", check.CHECKS, ids=lambda clause: clause.name)
@pytest.mark.parametrize("label", LABELS)
def test_the_contract(label, clause):
    clause.run(find(label))


@pytest.mark.parametrize("label", LABELS)
def test_a_map_shows_something(label):
    entry = find(label)
    slam = entry.cls(entry.params())
    replay(slam, drive(n=12))
    assert np.isfinite(slam.map().p).sum() > 100
