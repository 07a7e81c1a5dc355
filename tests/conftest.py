import os
import signal

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(name, "1")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in the background of a shell; what
    signal.signal(signal.SIGINT, signal.default_int_handler)  # tests start would inherit it

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

from tests.places import SHARED  # noqa: E402
from tests.processes import close_sessions  # noqa: E402

settings.register_profile("same", derandomize=True, deadline=None)  # on a busy machine, too
settings.load_profile("same")


@pytest.fixture(autouse=True)
def _as_before():
    """Commands change what signals do, and no process outlives the test that started it."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    close_sessions()
    for number, handler in before.items():
        signal.signal(number, handler)


def pytest_collection_modifyitems(items):
    """By the files' names, whatever the folder: the accuracy of all algorithms comes first.

    It compiles the kernels; else many processes of the benchmark's tests do so at once.
    """
    items.sort(key=lambda item: item.path.name)


@pytest.fixture
def shared_data():
    """A file of the measured logs; skips where they are not at hand."""

    def path(name):
        found = SHARED / name
        if not found.exists():
            pytest.skip(f"needs the measured log {name}, which is not part of the project")
        return found

    return path


@pytest.fixture(scope="session")
def room_log():
    from tests.rooms import drive

    return drive()
