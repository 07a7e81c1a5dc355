"""The folder of a command's results, named after the log."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from bench.results import RESULTS_FILE

RESULTS_FOLDER = Path("results")
MAX_NAME_LENGTH = 60  # characters of a folder's name


def claimed(out: str | None, logs: Iterable[str], force: bool) -> Path:
    """The folder to write to.

    Args:
        out: the requested folder; by default results/compare-LOG, with a number if it exists.
        logs: paths of the logs.
        force: existing results may be replaced.

    Raises:
        NotADirectoryError: it is a file.
        FileExistsError: the requested folder has files already.
    """
    from slams.formats import files

    default = named_after("compare", logs)
    if out is None and not force:
        files.check_folder(default.parent)
        return files.unused(default)
    folder = Path(out or default)
    files.check_folder(folder)
    if not folder.exists() or not any(folder.iterdir()):
        return folder
    if not (folder / RESULTS_FILE).exists():
        raise FileExistsError(f"{folder}: has files that are not results; expected a new folder")
    if not force:
        raise FileExistsError(
            f"{folder}: has results already; expected another --out, or --force to replace them"
        )
    return folder


def named_after(command: str, logs: Iterable[str]) -> Path:
    """The default folder of a command over these logs."""
    names = [Path(log).name.partition(".")[0] or "log" for log in logs]
    return RESULTS_FOLDER / "-".join([command, *names])[:MAX_NAME_LENGTH].rstrip("-")


def cleared(folder: Path, patterns: tuple[str, ...], inputs: Iterable[str] = ()) -> None:
    """Delete the files of earlier calls but no inputs, here and in the folders of single logs."""
    kept = {Path(path).resolve() for path in inputs}
    for place in [folder, *folder.glob("[0-9]*-*")]:
        for path in (path for pattern in patterns for path in place.glob(pattern)):
            if path.resolve() not in kept:
                path.unlink()
        if place != folder and place.is_dir() and not any(place.iterdir()):
            place.rmdir()
