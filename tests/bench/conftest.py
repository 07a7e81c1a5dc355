import pytest

from bench.run import pool
from tests.bench import toy_runs


@pytest.fixture(scope="module")
def here():
    """Runs are done in this process: starting another takes longer."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(pool, "finished", toy_runs.here)
        yield
