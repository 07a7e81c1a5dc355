import pytest

from tests.slams.live.robots import mounted


@pytest.fixture
def stand(monkeypatch):
    """A node on a bus of its own, its laser placed by tf."""
    return mounted(monkeypatch)
