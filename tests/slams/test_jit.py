"""Where compiled kernels are kept: numba unpickles what lies there, so it must be one's own."""

import os
import shutil
import tempfile
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


def cache_of(install, temp):
    """The folder that a process of this install keeps its kernels in."""
    temp.mkdir(exist_ok=True)
    done = python("-B", "-c", ASK, cwd=install, TMPDIR=str(temp))
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_a_read_only_install_keeps_its_kernels_where_nobody_else_can_write(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    package = tmp_path / "site" / "slams"
    shutil.copytree(ROOT / "slams", package, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "__pycache__").write_text("stands in the way, for root, too")
    (package.parent / "kernel.py").write_text(KERNEL)
    folder = Path(cache_of(package.parent, tmp_path / "mine"))
    assert folder.parent == tmp_path / "mine"
    assert folder.stat().st_mode & 0o777 == 0o700
    assert list(folder.rglob("*.nbi"))

    planted = tmp_path / "theirs" / folder.name
    planted.mkdir(parents=True)
    planted.chmod(0o777)  # its maker can still write into it
    assert cache_of(package.parent, planted.parent) == "none"
    assert list(planted.iterdir()) == []


@pytest.fixture
def name_in_temp(tmp_path, monkeypatch):
    """The folder that would be taken in the temp directory, not made yet."""
    (tmp_path / "file").touch()
    monkeypatch.setattr(jit, "__file__", str(tmp_path / "file" / "slams" / "jit.py"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = jit._cache_folder()
    assert folder.parent == tmp_path
    shutil.rmtree(folder, ignore_errors=True)
    return folder


def test_a_folder_of_somebody_else_is_not_used(name_in_temp, monkeypatch):
    name_in_temp.mkdir(mode=0o700)
    assert jit._cache_folder() == name_in_temp  # of an earlier process of ours
    stat = Path.lstat

    def of_another(path, **_):
        fields = list(stat(path))
        fields[4] += path == name_in_temp  # st_uid
        return os.stat_result(fields)

    monkeypatch.setattr(Path, "lstat", of_another)
    assert jit._cache_folder() is None


@pytest.mark.parametrize("what", ["link", "file", "nowhere"])
def test_what_is_no_folder_of_ours_is_not_used(what, name_in_temp, tmp_path, monkeypatch):
    if what == "link":
        (tmp_path / "elsewhere").mkdir(mode=0o700)
        name_in_temp.symlink_to(tmp_path / "elsewhere")
    elif what == "file":
        name_in_temp.touch()
    else:
        monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "file"))
    assert jit._cache_folder() is None


POSES = """
import numpy as np
from slams.registry import create
from slams.test_world import drive
slam = create("hector")
print(np.array([slam.update(scan) for scan in drive(n=40, rate=10.0)]).tobytes().hex())
"""


def test_kernels_just_compiled_give_the_bits_of_kernels_that_were_kept(tmp_path):
    kept = tmp_path / f"kernels-{jit.fingerprint()}"
    runs = [python("-c", POSES, NUMBA_CACHE_DIR=str(folder)) for folder in (tmp_path, kept)]
    assert runs[0].stdout, runs[0].stderr
    assert runs[0].stdout == runs[1].stdout
    assert list(tmp_path.iterdir()) == [kept] and not list(kept.glob("kernels-*"))


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
