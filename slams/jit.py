"""The one place that imports numba.

Compiled kernels are cached on disk. numba's own check sees only the file a kernel stands in, not
the kernels it calls in other files, so the cache folder carries a hash of all kernel sources.
"""

from __future__ import annotations

import hashlib
import os
import stat
import tempfile
import time
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, overload

from slams.registry import BUILT_IN

# fastmath without the nan and inf flags: scans are full of both
FAST = frozenset({"contract", "reassoc", "nsz", "arcp", "afn"})
ROOT = Path(__file__).resolve().parent.parent
PRIVATE = 0o700


def kernel_files(root: Path = ROOT) -> list[Path]:
    """The sources that compiled kernels are made of, in all packages and their subfolders."""
    packages = {"slams", "bench", *(target.partition(".")[0] for target in BUILT_IN.values())}
    return sorted(
        path
        for package in packages
        for path in (root / package).rglob("*.py")
        if path.stem.endswith("kernels") or path.stem in ("geometry", "jit")
    )


def fingerprint(root: Path = ROOT) -> str:
    """A name that changes with the sources of the kernels."""
    digest = hashlib.sha256()
    for path in kernel_files(root):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path | None:
    """A writable folder named after the kernels' sources, never the home folder; None: no cache."""
    name = f"kernels-{fingerprint()}"
    beside = Path(__file__).resolve().parent / "__pycache__" / name
    try:
        beside.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=beside):
            return beside
    except OSError:
        return _own_in_temp(name)


def _own_in_temp(name: str) -> Path | None:
    """A folder in the temp directory that only this user can write; numba unpickles what is there.

    None where somebody else made one of that name, or where none can be made.
    """
    user = os.getuid() if hasattr(os, "getuid") else 0
    try:
        folder = Path(tempfile.gettempdir()) / f"slams-{user}-{name}"
        folder.mkdir(mode=PRIVATE, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    private = stat.S_IMODE(found.st_mode) == PRIVATE and found.st_uid == user
    # where there are no such modes, the temp directory itself is the user's
    own = stat.S_ISDIR(found.st_mode) and (private or not hasattr(os, "getuid"))
    return folder if own else None


if "NUMBA_CACHE_DIR" not in os.environ and (folder := _cache_folder()) is not None:
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
KEPT = "NUMBA_CACHE_DIR" in os.environ

import numba  # noqa: E402  (the cache folder must be set first)
from numba.core import event  # noqa: E402
from numba.core.options import DefaultOptions  # noqa: E402
from numba.core.registry import CPUDispatcher  # noqa: E402

F = TypeVar("F", bound=Callable[..., Any])


@overload
def njit(function: F) -> F: ...
@overload
def njit(
    *, fastmath: frozenset[str] = ..., inner: bool = ..., borrows: bool = ...
) -> Callable[[F], F]: ...
def njit(
    function: Any = None,
    *,
    fastmath: frozenset[str] = frozenset(),
    inner: bool = False,
    borrows: bool = False,
) -> Any:
    """Compile lazily, cache on disk, release the GIL. Use bare or with `fastmath=FAST`.

    A kernel that only kernels call is `inner`: neither a cache file of its own, as it stands in its
    callers', nor an entry from Python is made, which take half of its compile time. One that
    `borrows` neither makes nor returns an array: references to those it is given are not counted,
    which in a kernel called for every beam with a few arrays takes longer than all else in it.
    """
    options: dict[str, Any] = {
        "nogil": True,
        "error_model": "numpy",
        "fastmath": set(fastmath) if fastmath else False,
        "no_cfunc_wrapper": True,  # nobody calls kernels from C, and it costs a tenth to compile
        "no_rewrites": True,  # of powers and sums of arrays, which no kernel has: a twentieth
    }

    if borrows and hasattr(DefaultOptions, "_nrt"):  # of numba's own: without it all is the same
        options["_nrt"] = False
    if inner and fastmath:  # else a kernel just compiled and one from the cache may sum otherwise
        options["forceinline"] = True

    def _decorate(function: Any) -> Any:
        if inner and not getattr(numba.config, "DISABLE_JIT", False):
            return InnerKernel(function, options)
        return numba.njit(cache=KEPT and not inner, **options)(function)

    return _decorate if function is None else _decorate(function)


class InnerKernel(CPUDispatcher):
    """A kernel that kernels call; for a call from Python, as tests make it, it is compiled anew."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        super().__init__(function, None, {"nopython": True, "no_cpython_wrapper": True, **options})
        self._options = options

    @cached_property
    def _entry(self) -> Callable[..., Any]:
        made: Callable[..., Any] = numba.njit(**self._options)(self.py_func)
        return made

    def __call__(self, *args: Any) -> Any:
        """From Python: by a twin that has an entry from there."""
        return self._entry(*args)


class CompileClock(event.Listener):
    """Adds up the CPU seconds numba spends compiling while the clock is installed."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._depth = 0
        self._start = 0.0

    def on_start(self, event: Any) -> None:
        """Called by numba as a compilation starts; they nest."""
        if self._depth == 0:
            self._start = time.process_time()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Called by numba as a compilation ends."""
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.process_time() - self._start

    def __enter__(self) -> CompileClock:
        event.register("numba:compile", self)
        return self

    def __exit__(self, *_: object) -> None:
        event.unregister("numba:compile", self)
