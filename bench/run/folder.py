"""The folder of a command's results: named after the log, never that of other results."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import count
from pathlib import Path

ROOT = Path("results")
LONGEST = 60  # characters of a folder's name


def claimed(
    out: str | None, command: str, logs: Iterable[str], ours: tuple[str, ...], force: bool
) -> Path:
    """The folder to write to.

    Args:
        out: the one asked for; by default results/COMMAND-LOG, with a number where it is taken.
        command: what makes the results.
        logs: paths of the logs they are of.
        ours: patterns of the files the command writes, the one with the figures first.
        force: results in the folder asked for may be replaced.

    Raises:
        NotADirectoryError: it is a file.
        FileExistsError: the folder asked for has files already.
    """
    from slams.formats import files

    if out is None and not force:
        return _new(default(command, logs))
    folder = Path(out or default(command, logs))
    files.check_folder(folder)
    if not folder.exists() or not any(folder.iterdir()):
        return folder
    if not any(folder.glob(ours[0])):
        raise FileExistsError(f"{folder}: has files that are no results; expected a new folder")
    if not force:
        raise FileExistsError(
            f"{folder}: has results already; expected another --out, or --force to replace them"
        )
    return folder


def default(command: str, logs: Iterable[str]) -> Path:
    """The folder named after the logs; of the simulated one after the command alone."""
    names = [Path(log).name.partition(".")[0] or "log" for log in logs]
    return ROOT / "-".join([command, *names])[:LONGEST].rstrip("-")


def cleared(folder: Path, ours: tuple[str, ...]) -> None:
    """Delete what an earlier call wrote, in the folder and in those of single logs."""
    for place in [folder, *folder.glob("[0-9]*-*")]:
        for pattern in ours:
            for path in place.glob(pattern):
                path.unlink()
        if place != folder and place.is_dir() and not any(place.iterdir()):
            place.rmdir()


def _new(folder: Path) -> Path:
    """The folder, or the first of folder-2, folder-3, ... that is not there."""
    from slams.formats import files

    files.check_folder(folder.parent)
    numbered = (folder if k == 1 else folder.with_name(f"{folder.name}-{k}") for k in count(1))
    return next(path for path in numbered if not path.exists())
