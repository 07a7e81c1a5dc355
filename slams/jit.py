"""The only module that imports numba.

Compiled kernels are cached on disk. numba checks only the file of a kernel for changes, not those
of the kernels it calls. The name of the cache folder therefore contains a hash of all kernel files.
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

# fastmath without its assumption that nothing is nan or inf: scans contain both
FAST = frozenset({"contract", "reassoc", "nsz", "arcp", "afn"})
SOURCE_ROOT = Path(__file__).resolve().parent.parent
OWNER_ONLY_MODE = 0o700


def kernel_files(root: Path = SOURCE_ROOT) -> list[Path]:
    """The source files of compiled kernels, in all packages and their subfolders."""
    packages = {"slams", "bench", *(target.partition(".")[0] for target in BUILT_IN.values())}
    return sorted(
        path
        for package in packages
        for path in (root / package).rglob("*.py")
        if path.stem.endswith("kernels") or path.stem in ("geometry", "jit")
    )


def fingerprint(root: Path = SOURCE_ROOT) -> str:
    """A hash of the sources of the kernels."""
    digest = hashlib.sha256()
    for path in kernel_files(root):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _folder_in(given: Path) -> Path:
    """The folder in NUMBA_CACHE_DIR, or that itself if the process that started this one set it."""
    name = f"kernels-{fingerprint()}"
    return given if given.name == name else given / name


def _cache_folder() -> Path | None:
    """A writable folder beside this file, or in the temp directory; None if there is none."""
    name = f"kernels-{fingerprint()}"
    folder = Path(__file__).resolve().parent / "__pycache__" / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return _private_temp_folder(name)


def _private_temp_folder(name: str) -> Path | None:
    """A folder in the temp directory that only this user can write, as numba unpickles its files.

    None if it cannot be made, or if another user has made a folder of that name.
    """
    user = os.getuid() if hasattr(os, "getuid") else 0
    try:
        folder = Path(tempfile.gettempdir()) / f"slams-{user}-{name}"
        folder.mkdir(mode=OWNER_ONLY_MODE, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    private = stat.S_IMODE(found.st_mode) == OWNER_ONLY_MODE and found.st_uid == user
    # systems without such modes have a temp directory for each user
    own = stat.S_ISDIR(found.st_mode) and (private or not hasattr(os, "getuid"))
    return folder if own else None


given = os.environ.get("NUMBA_CACHE_DIR")
folder = _folder_in(Path(given)) if given else _cache_folder()
if folder is not None:
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
IS_CACHED = folder is not None

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

    `inner`: only kernels call this kernel. It gets no cache file, as the files of its callers
    contain it, and no entry point from Python. This halves its compile time. `borrows`: the kernel
    neither makes nor returns an array. References to its arguments are then not counted, which
    would dominate the run time of a small kernel that is called for every beam.
    """
    options: dict[str, Any] = {
        "nogil": True,
        "error_model": "numpy",
        "fastmath": set(fastmath) if fastmath else False,
        "no_cfunc_wrapper": True,  # not called from C; saves a tenth of the compile time
        "no_rewrites": True,  # of array expressions, which no kernel has; saves a twentieth
    }

    if borrows and hasattr(DefaultOptions, "_nrt"):  # private to numba; results do not change
        options["_nrt"] = False
    if inner and fastmath:  # else kernels from the cache may sum in another order
        options["forceinline"] = True

    def _decorate(function: Any) -> Any:
        if inner and not getattr(numba.config, "DISABLE_JIT", False):
            return InnerKernel(function, options)
        return numba.njit(cache=IS_CACHED and not inner, **options)(function)

    return _decorate if function is None else _decorate(function)


class InnerKernel(CPUDispatcher):
    """A kernel that only kernels call; tests may call it from Python, where it is recompiled."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        super().__init__(function, None, {"nopython": True, "no_cpython_wrapper": True, **options})
        self._options = options

    @cached_property
    def _entry(self) -> Callable[..., Any]:
        made: Callable[..., Any] = numba.njit(**self._options)(self.py_func)
        return made

    def __call__(self, *args: Any) -> Any:
        """Call a copy of the kernel that has an entry point from Python."""
        return self._entry(*args)


class CompileClock(event.Listener):
    """CPU seconds that numba spends compiling while this context is active."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._depth = 0
        self._start = 0.0

    def on_start(self, event: Any) -> None:
        """Called by numba at the start of a compilation; compilations may be nested."""
        if self._depth == 0:
            self._start = time.process_time()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Called by numba at the end of a compilation."""
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.process_time() - self._start

    def __enter__(self) -> CompileClock:
        event.register("numba:compile", self)
        return self

    def __exit__(self, *_: object) -> None:
        event.unregister("numba:compile", self)
