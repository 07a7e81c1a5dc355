"""No process outlives the test that started it."""

import pytest

from tests.processes import close_sessions


@pytest.fixture(autouse=True)
def _no_orphans():
    yield
    close_sessions()
