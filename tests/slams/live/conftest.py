import signal

import pytest

from tests.slams.live.commands import started

__all__ = ["started"]


@pytest.fixture(autouse=True)
def handlers():
    """The commands change what Ctrl-C and SIGTERM do."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
