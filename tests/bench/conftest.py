"""No process outlives the test that started it, and few are started."""

import pytest

from bench.run import pool
from tests.bench import toy_runs
from tests.processes import close_sessions


@pytest.fixture(autouse=True)
def _no_orphans():
    yield
    close_sessions()


@pytest.fixture(scope="module")
def here():
    """Runs are done in this process: starting another takes longer."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(pool, "finished", toy_runs.here)
        yield
