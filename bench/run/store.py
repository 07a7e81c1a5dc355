"""Results in a folder, each named by everything that it depends on, the code too."""

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

# numbers come from these; others only read and draw
LIBRARIES = ("numpy", "numba", "llvmlite", "scipy", "opencv-python-headless", "kiss-icp")
# every result follows from these
PACKAGES = ("slams", "bench.sim", "bench.run", "bench.judge", "bench.results")
SOURCES = (".py", ".so", ".pyd")  # an outsider's algorithm may be compiled


def canonical(value: Any) -> str:
    """The one JSON text of a value: keys sorted, no space, floats to the last bit.

    Raises:
        ValueError: a number that is not finite.
        TypeError: something that JSON does not have.
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def plain(value: Any) -> Any:
    """The value as a store gives it back: keys sorted, arrays as lists, not finite as None."""
    text = json.dumps(value, sort_keys=True, default=_of_numpy)
    return json.loads(text, parse_constant=lambda _: None)


def _of_numpy(value: Any) -> Any:
    """Arrays and numbers of numpy, without importing it."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"a result has a {type(value).__name__} in it, expected what JSON has")


def digest(text: str) -> str:
    """SHA-256 of a text, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


class Store:
    """A folder of results: DIR/ab/abcdef.json, with what each cost beside it, abcdef.cost.json.

    The results' files are the same bytes on every machine; what they cost never is. Folders are
    merged by copying one over the other. A file that is damaged, cut off or under another's name
    counts as absent. Any number of processes and machines may use one folder.

    Raises:
        OSError: the folder cannot be made or written to.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)

    def path(self, key: str) -> Path:
        """Where the result of that name lies."""
        return self.folder / key[:2] / f"{key}.json"

    def read(self, key: str) -> Any | None:
        """The result of that name; None where there is none, or not a whole one."""
        return _value(self.path(key), key)

    def cost(self, key: str) -> Any | None:
        """What was measured as the result was made; None where nothing was."""
        return _value(self.path(key).with_suffix(".cost.json"), key)

    def write(self, key: str, value: Any, measured: Any = None) -> None:
        """Keep a result, whole or not at all.

        Raises:
            RuntimeError: the disk is full, or the folder no longer to be written to.
        """
        path = self.path(key)
        try:
            path.parent.mkdir(exist_ok=True)
            if measured is not None:  # first: a result that is there has its cost
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
    """Hash of the source text of packages or modules, of Python and of the libraries below them.

    Args:
        packages: names as imported ("slams", "bench.sim", "my_slam"); what they import from
            elsewhere is not seen.

    Raises:
        LookupError: no such package, or none that has source text.
    """
    python = ".".join(platform.python_version_tuple()[:2])
    libraries = versions(LIBRARIES) | {"python": python}
    sources = {name: _text_hash(name) for name in packages}
    return digest(canonical({"sources": sources, "libraries": libraries}))


def sources_of(cls: type) -> tuple[str, ...]:
    """The packages that a run of an algorithm follows from, its own or its module among them."""
    package = cls.__module__.partition(".")[0]
    return PACKAGES if package in PACKAGES else (*PACKAGES, package)


def _text_hash(name: str) -> str:
    """Hash of all source files of a package with their names; line ends do not count."""
    found = hashlib.sha256()
    for label, path in sorted(_files(name).items()):
        text = path.read_bytes().replace(b"\r\n", b"\n")
        found.update(f"{label} {len(text)}\n".encode() + text)
    return found.hexdigest()


def _files(name: str) -> dict[str, Path]:
    """Source files by their place in the package: the same wherever that is installed."""
    try:
        spec = find_spec(name)
    except (ModuleNotFoundError, ValueError):
        spec = None
    folders = [Path(folder) for folder in (spec and spec.submodule_search_locations) or ()]
    found = [(folder, file) for folder in folders for file in folder.rglob("*")]
    files = {f.relative_to(d).as_posix(): f for d, f in found if f.suffix in SOURCES}
    if not folders and spec is not None and spec.origin is not None:
        files = {Path(spec.origin).name: Path(spec.origin)}
    if not all(file.is_file() for file in files.values()) or not files:
        raise LookupError(f"{name}: expected a package or module with source text to tell versions")
    return files
