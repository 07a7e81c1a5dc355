"""Results in a folder, each named by a hash of all its inputs, including the code."""

from __future__ import annotations

import hashlib
import json
import platform
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from slams.formats.files import complete_file
from slams.summary import versions

# libraries that affect numbers; others only read and draw
LIBRARIES = ("numpy", "numba", "llvmlite", "scipy", "opencv-python-headless", "kiss-icp")
# packages that affect results
HASHED_PACKAGES = ("slams", "bench.sim", "bench.run", "bench.judge", "bench.results")
SOURCE_SUFFIXES = (".py", ".so", ".pyd")  # an external algorithm may be compiled


def canonical(value: Any) -> str:
    """The unique JSON text of a value: sorted keys, no spaces, all digits of floats.

    Raises:
        ValueError: a number that is not finite.
        TypeError: a value that JSON does not support.
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def plain(value: Any) -> Any:
    """The value as a store returns it: sorted keys, arrays as lists, nan and inf as None."""
    text = json.dumps(value, sort_keys=True, default=_of_numpy)
    return json.loads(text, parse_constant=lambda _: None)


def _of_numpy(value: Any) -> Any:
    """Convert arrays and numbers of numpy, without importing numpy."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"a result has a {type(value).__name__} in it, expected what JSON has")


def digest(text: str) -> str:
    """SHA-256 of a text, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


class Store:
    """A folder of results DIR/ab/abcdef.json, each with its cost in abcdef.cost.json.

    Result files have the same bytes on every machine. Folders are merged by copying. A file that is
    damaged, truncated or under another name counts as absent. Any number of processes and machines
    may use one folder.

    Raises:
        OSError: the folder cannot be created.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)

    def path(self, key: str) -> Path:
        """The path of a result."""
        return self.folder / key[:2] / f"{key}.json"

    def read(self, key: str) -> Any | None:
        """A result; None if it does not exist or is damaged."""
        return _value(self.path(key), key)

    def cost(self, key: str) -> Any | None:
        """The cost of a result; None if unknown."""
        return _value(self.path(key).with_suffix(".cost.json"), key)

    def write(self, key: str, value: Any, measured: Any = None) -> None:
        """Write a result completely or not at all.

        Raises:
            RuntimeError: the disk is full, or the folder is not writable.
        """
        path = self.path(key)
        try:
            path.parent.mkdir(exist_ok=True)
            if measured is not None:  # first, so that every result has its cost
                self._put(path.with_suffix(".cost.json"), key, measured)
            self._put(path, key, value)
        except OSError as error:
            raise RuntimeError(
                f"{self.folder}: {error.strerror or error}; the results so far are kept: "
                "make room and start again"
            ) from error

    def _put(self, path: Path, key: str, value: Any) -> None:
        with complete_file(path) as partial:
            partial.write_text(canonical(_signed(key, plain(value))) + "\n", encoding="utf-8")


def _signed(key: str, value: Any) -> dict[str, Any]:
    return {"key": key, "sha256": digest(key + canonical(value)), "value": value}


def _value(path: Path, key: str) -> Any | None:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        return found["value"] if found == _signed(key, found["value"]) else None
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return None


@cache
def code_version(packages: tuple[str, ...]) -> str:
    """Hash of the source text of packages or modules, and of the versions of Python and libraries.

    Args:
        packages: names as imported ("slams", "bench.sim", "my_slam"); other imports of theirs are
            not included.

    Raises:
        LookupError: no such package, or a package without source text.
    """
    python = ".".join(platform.python_version_tuple()[:2])
    libraries = versions(LIBRARIES) | {"python": python}
    sources = {name: _text_hash(name) for name in packages}
    return digest(canonical({"sources": sources, "libraries": libraries}))


def sources_of(cls: type) -> tuple[str, ...]:
    """The packages that affect a run of an algorithm, including its own."""
    package = cls.__module__.partition(".")[0]
    return HASHED_PACKAGES if package in HASHED_PACKAGES else (*HASHED_PACKAGES, package)


def _text_hash(name: str) -> str:
    """Hash of all source files of a package with their names; line ends have no effect."""
    found = hashlib.sha256()
    for label, path in sorted(_files(name).items()):
        text = path.read_bytes().replace(b"\r\n", b"\n")
        found.update(f"{label} {len(text)}\n".encode() + text)
    return found.hexdigest()


def _files(name: str) -> dict[str, Path]:
    """Source files by their path in the package, which does not depend on the installation."""
    try:
        spec = find_spec(name)
    except (ModuleNotFoundError, ValueError):
        spec = None
    folders = [Path(folder) for folder in (spec and spec.submodule_search_locations) or ()]
    found = [(folder, file) for folder in folders for file in folder.rglob("*")]
    files = {f.relative_to(d).as_posix(): f for d, f in found if f.suffix in SOURCE_SUFFIXES}
    if not folders and spec is not None and spec.origin is not None:
        files = {Path(spec.origin).name: Path(spec.origin)}
    if not all(file.is_file() for file in files.values()) or not files:
        raise LookupError(f"{name}: expected a package or module with source text to tell versions")
    return files
