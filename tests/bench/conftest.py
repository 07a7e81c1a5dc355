import pytest

from bench.run import pool
from tests.bench import toy_runs
from tests.rooms import drive


@pytest.fixture
def room_file(tmp_path):
    """A log of two seconds in the room, as a command is given it."""
    drive(n=40).save(tmp_path / "room.npz")
    return str(tmp_path / "room.npz")


@pytest.fixture(scope="module")
def here():
    """Runs are done in this process: starting another takes longer."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(pool, "finished", toy_runs.here)
        yield
