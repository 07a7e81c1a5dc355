"""Which version of the code a result is of: a hash of source text and of the libraries."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from bench.run.store import canonical, digest

# numbers come from these; others only read and draw
LIBRARIES = ("numpy", "numba", "llvmlite", "scipy", "opencv-python-headless", "kiss-icp")
# every result follows from these
PACKAGES = ("slams", "bench.sim", "bench.run", "bench.judge", "bench.results")
SOURCES = (".py", ".so", ".pyd")  # an outsider's algorithm may be compiled


@cache
def code_version(packages: tuple[str, ...]) -> str:
    """Hash of the source text of packages or modules, of Python and of the libraries below them.

    Args:
        packages: names as imported ("slams", "bench.sim", "my_slam"); what they import from
            elsewhere is not seen.

    Raises:
        LookupError: no such package, or none that has source text.
    """
    sources = {name: _text_hash(name) for name in packages}
    return digest(canonical({"sources": sources, "libraries": _libraries()}))


def package_of(cls: type) -> str:
    """The package, or the module that stands alone, that a class comes from."""
    return cls.__module__.partition(".")[0]


def sources_with(package: str | None = None) -> tuple[str, ...]:
    """The packages that a run of an algorithm of `package` follows from."""
    return PACKAGES if package is None or package in PACKAGES else (*PACKAGES, package)


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


def _libraries() -> dict[str, str]:
    found = {"python": ".".join(platform.python_version_tuple()[:2])}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "none"
    return found
