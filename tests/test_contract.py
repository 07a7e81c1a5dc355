"""The contract of `update`, each clause over every registered algorithm and preset."""

import pytest

from slams.contract import CLAUSES
from slams.registry import find, names

LABELS = [
    f"{name}@{preset}" if preset != "default" else name
    for name in names()
    for preset in find(name).cls.Params.presets()
]


@pytest.mark.parametrize("clause", CLAUSES)
@pytest.mark.parametrize("label", LABELS)
def test_the_contract(label, clause):
    CLAUSES[clause](find(label))
