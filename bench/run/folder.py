"""The folder of a command's results: named after the log, never that of other results."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain, count
from pathlib import Path

from bench.results import FIGURES

ROOT = Path("results")
LONGEST = 60  # characters of a folder's name


def claimed(out: str | None, logs: Iterable[str], force: bool) -> Path:
    """The folder to write to.

    Args:
        out: the one asked for; by default results/compare-LOG, with a number where it is taken.
        logs: paths of the logs that the results are of.
        force: results in the folder asked for may be replaced.

    Raises:
        NotADirectoryError: it is a file.
        FileExistsError: the folder asked for has files already.
    """
    from slams.formats import files

    names = [Path(log).name.partition(".")[0] or "log" for log in logs]
    usual = ROOT / "-".join(["compare", *names])[:LONGEST].rstrip("-")
    if out is None and not force:
        files.check_folder(usual.parent)
        numbered = (usual.with_name(f"{usual.name}-{k}") for k in count(2))
        return next(path for path in chain([usual], numbered) if not path.exists())
    folder = Path(out or usual)
    files.check_folder(folder)
    if not folder.exists() or not any(folder.iterdir()):
        return folder
    if not (folder / FIGURES).exists():
        raise FileExistsError(f"{folder}: has files that are no results; expected a new folder")
    if not force:
        raise FileExistsError(
            f"{folder}: has results already; expected another --out, or --force to replace them"
        )
    return folder


def cleared(folder: Path, ours: tuple[str, ...]) -> None:
    """Delete what an earlier call wrote, in the folder and in those of single logs."""
    for place in [folder, *folder.glob("[0-9]*-*")]:
        for pattern in ours:
            for path in place.glob(pattern):
                path.unlink()
        if place != folder and place.is_dir() and not any(place.iterdir()):
            place.rmdir()
