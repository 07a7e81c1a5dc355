"""Where compiled kernels are kept: numba unpickles what lies there, so it must be one's own."""

import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from slams import jit
from slams.types import Floats
from tests.places import ROOT
from tests.processes import python

KERNEL = """
from slams.jit import njit

@njit
def doubled(x):
    return 2 * x
"""
ASK = "import os, kernel; kernel.doubled(1); print(os.environ.get('NUMBA_CACHE_DIR', 'none'))"


@pytest.fixture
def read_only(tmp_path):
    """A copy of the package in which no file can be made, as in a system's site-packages."""
    package = tmp_path / "site" / "slams"
    shutil.copytree(ROOT / "slams", package, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "__pycache__").write_text("stands in the way, for root, too")
    (package.parent / "kernel.py").write_text(KERNEL)
    return package.parent


@pytest.mark.parametrize(
    ("variables", "folder"),
    [
        ({"XDG_CACHE_HOME": "mine"}, "mine/slams"),
        ({"HOME": "home"}, "home/.cache/slams"),
        ({"HOME": "site/kernel.py"}, "none"),  # no folder
        ({"HOME": "home", "NUMBA_CACHE_DIR": "asked"}, "asked"),
    ],
)
def test_a_read_only_install_keeps_its_kernels_in_the_cache_of_the_user(
    variables, folder, read_only, tmp_path, monkeypatch
):
    """As others can write to the temp directory, and numba unpickles what it finds."""
    for name in ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    given = {name: str(tmp_path / value) for name, value in variables.items()}
    done = python("-B", "-c", ASK, cwd=read_only, PYTHONPATH="", **given)
    assert done.returncode == 0, done.stderr
    found = Path(done.stdout.strip())
    assert str(found).startswith(folder if folder == "none" else str(tmp_path / folder))
    assert folder == "none" or list(found.rglob("*.nbi"))


POSES = """
import numpy as np
from slams.registry import find
from slams.test_world import drive
entry = find("hector")
slam = entry.cls(entry.params())
print(np.array([slam.update(scan) for scan in drive(n=40, rate=10.0)]).tobytes().hex())
"""


def test_kernels_just_compiled_give_the_bits_of_kernels_that_were_kept(tmp_path):
    runs = [python("-c", POSES, NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2)]
    assert runs[0].stdout, runs[0].stderr
    assert runs[0].stdout == runs[1].stdout


class Pair(NamedTuple):
    one: Floats
    other: Floats


def test_a_kernel_that_borrows_arrays_does_not_count_references_to_them():
    def _larger(pair: Pair, i: int) -> float:
        return pair.one[i] if pair.one[i] > pair.other[i] else pair.other[i]

    pair = Pair(np.array([1.0, 4.0]), np.array([3.0, 2.0]))
    counted = []
    for borrows in (False, True):
        kernel = jit.njit(inner=True, borrows=borrows)(_larger)
        assert (kernel(pair, 0), kernel(pair, 1)) == (3.0, 4.0)
        (code,) = kernel._entry.inspect_llvm().values()
        body = code[code.index("\ndefine") :]
        counted.append("call void @NRT_incref" in body[: body.index("\n}")])
    assert counted == [True, False]
