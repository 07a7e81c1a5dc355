"""The contract of `update`, each clause over every registered algorithm and preset."""

import pytest

from slams.contract import CLAUSES
from slams.registry import find
from tests.rooms import labels

LOOPED = ("hector+loops", "tsd+loops", "crsm@paper+loops")


@pytest.mark.parametrize("clause", CLAUSES)
@pytest.mark.parametrize("label", [*labels(), *LOOPED])
def test_the_contract(label, clause):
    CLAUSES[clause](find(label))
