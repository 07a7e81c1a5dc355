"""Result files and folders that appear complete or not at all, and checks before a run."""

from __future__ import annotations

import os
import platform
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from itertools import chain, count
from pathlib import Path


def check_folder(folder: str | Path) -> None:
    """Check, before any work is done, that a path can become a folder of results.

    Raises:
        NotADirectoryError: the path, or one of its parents, is a file.
        PermissionError: the folder cannot be written.
    """
    folder = Path(folder)
    nearest = next(path for path in (folder, *folder.parents) if path.exists())
    if not nearest.is_dir():
        raise NotADirectoryError(f"{nearest}: is a file; expected a folder for the results")
    _check_writable(nearest)


def unused(folder: Path) -> Path:
    """The folder, or the first of FOLDER-2, FOLDER-3, ... that does not exist."""
    numbered = (folder.with_name(f"{folder.name}-{k}") for k in count(2))
    return next(path for path in chain([folder], numbered) if not path.exists())


def check_file(path: str | Path, *endings: str) -> None:
    """Check, before any work is done, that a path can become a file, with one of the endings.

    Raises:
        ValueError: the name has none of the endings.
        FileNotFoundError: the folder of the file does not exist.
        IsADirectoryError: the path is a folder.
        PermissionError: the folder of the file cannot be written.
    """
    path = Path(path)
    if endings and path.suffix not in endings:
        raise ValueError(f"{path}: expected a name that ends in {' or '.join(endings)}")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path.parent}: no such folder; make it first")
    if path.is_dir():
        raise IsADirectoryError(f"{path}: is a folder; expected the name of a file")
    _check_writable(path.parent)


def _check_writable(folder: Path) -> None:
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"{folder}: permission denied; expected a folder that can be written")


def check_new(path: str | Path, force: bool) -> None:
    """Refuse an existing file or a folder that is not empty, unless `force` is set.

    Raises:
        FileExistsError: the sentence names the option.
    """
    path = Path(path)
    exists = any(path.iterdir()) if path.is_dir() else path.exists()
    if exists and not force:
        raise FileExistsError(f"{path}: exists; --force replaces it, or choose another name")


def check_new_file(path: str | Path, force: bool, *endings: str) -> None:
    """`check_file` and `check_new`."""
    check_file(path, *endings)
    check_new(path, force)


@contextmanager
def complete_file(path: Path) -> Iterator[Path]:
    """A temporary file that is renamed to `path` when the block ends without an error."""
    partial = _partial_path(path)
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _partial_path(path: Path) -> Path:
    return path.with_name(f".{path.name}.{platform.node()}.{os.getpid()}.part")


@contextmanager
def complete_folder(folder: str | Path, stale: Collection[str] = ()) -> Iterator[Path]:
    """A temporary folder whose files move to `folder` when the block ends without an error.

    Existing files are replaced only by files of the same name; files named in `stale`, of an
    earlier result, are removed.

    Raises:
        OSError: the folder cannot be made or written.
    """
    folder = Path(folder).resolve()  # the temporary name needs a name, which "." has not
    check_folder(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    partial = _partial_path(folder)
    shutil.rmtree(partial, ignore_errors=True)  # left by a killed run with the same process id
    partial.mkdir()
    try:
        yield partial
        for name in stale:
            if (folder / name).is_file():
                (folder / name).unlink()
        _move(partial, folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _move(source: Path, target: Path) -> None:
    if not target.exists():
        source.replace(target)
        return
    for path in sorted(source.rglob("*")):
        destination = target / path.relative_to(source)
        if path.is_dir():
            destination.mkdir(exist_ok=True)
        else:
            path.replace(destination)
