import pytest

from slams.localize import MapIndex
from tests.floors import grid_of


@pytest.fixture(scope="module")
def room():
    return MapIndex(grid_of())
