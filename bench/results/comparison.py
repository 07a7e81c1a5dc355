"""Results: what came of a run, of a log, of a comparison, as typed values, written and read.

Everything the benchmark shows is drawn from these. A folder of results holds `results.json` (every
figure) and `arrays.npz` (poses, times, maps), so that `slams report DIR` draws all of it
again without a run.
"""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bench.results.runs import Line, Outcome, Reference, Row, Rows
from slams.types import OccupancyGrid, Pose2

if TYPE_CHECKING:
    from collections.abc import Mapping

FORMAT = "results-4"
FIGURES, ARRAYS = "results.json", "arrays.npz"


class LogResult(NamedTuple):
    """Everything that came of one log."""

    reference: Reference
    outcomes: list[Outcome]

    @property
    def entry(self) -> Line:
        """The log's own figures."""
        return self.reference.entry

    @property
    def rows(self) -> Rows:
        """The figures of every run."""
        return [outcome.row for outcome in self.outcomes]


class Comparison(NamedTuple):
    """Everything that came of a comparison.

    `facts` tell how it was made (command, machine, versions), `over_logs` are the verdicts over all
    its logs.
    """

    facts: Line
    logs: list[LogResult]
    over_logs: list[Line]

    @property
    def rows(self) -> Rows:
        """The figures of every run on every log."""
        return [row for log in self.logs for row in log.rows]

    def by_algorithm(self) -> dict[str, Rows]:
        """The rows of each algorithm, a row for each log."""
        found: dict[str, Rows] = {}
        for row in self.rows:
            found.setdefault(row["algorithm"], []).append(row)
        return found

    def as_dict(self) -> Line:
        """The content of results.json."""
        return {
            "format": FORMAT,
            **self.facts,
            "logs": [log.entry for log in self.logs],
            "rows": self.rows,
            "over_logs": self.over_logs,
        }


def save(folder: Path, comparison: Comparison) -> None:
    """Write results.json and arrays.npz."""
    from slams.formats.npz import write_npz

    write_figures(folder / FIGURES, comparison.as_dict())
    arrays: dict[str, Any] = {"format": FORMAT}
    for k, log in enumerate(comparison.logs):
        arrays |= _arrays(f"{k}", log.reference)
        for i, outcome in enumerate(log.outcomes):
            arrays |= _arrays(f"{k}/{i}", outcome)
    write_npz(folder / ARRAYS, arrays)


def read(folder: str | Path) -> Comparison:
    """Read what `save` wrote.

    Raises:
        OSError: a file cannot be opened.
        ValueError: the folder holds no complete results of this version; the sentence says why.
    """
    folder = Path(folder)
    found = read_figures(folder / FIGURES, FORMAT)
    arrays = _read_arrays(folder / ARRAYS)
    rows = iter(found["rows"])
    logs = []
    for k, entry in enumerate(found["logs"]):
        count = sum(1 for key in arrays if re.fullmatch(rf"{k}/\d+/t", key))
        outcomes = [_outcome_of(next(rows), _under(arrays, f"{k}/{i}")) for i in range(count)]
        logs.append(LogResult(_reference_of(entry, _under(arrays, f"{k}")), outcomes))
    known = ("format", "logs", "rows", "over_logs")
    facts = {key: value for key, value in found.items() if key not in known}
    return Comparison(facts, logs, found["over_logs"])


def write_figures(path: Path, figures: Mapping[str, Any]) -> None:
    """Write a dict of figures as strict JSON: what is not finite becomes null."""
    from slams.summary import as_json

    path.write_text(as_json(dict(figures)), encoding="utf-8")


def read_figures(path: str | Path, expected: str | None = None) -> Line:
    """Read what `write_figures` wrote, of the format that is expected.

    Raises:
        ValueError: it is no JSON object, or of another format.
    """
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"{path}: damaged ({error}); run it again") from error
    if not isinstance(found, dict):
        raise ValueError(f"{path}: got {type(found).__name__}, expected an object of results")
    if expected is not None and found.get("format") != expected:
        raise ValueError(
            f"{path}: got format {found.get('format')!r}, expected {expected!r}: written by "
            "another version; run it again"
        )
    return found


def _arrays(place: str, value: Any) -> dict[str, Any]:
    """The arrays and numbers inside a value by their place; dicts are in results.json."""
    if value is None or isinstance(value, dict):
        return {}
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value)]
    elif isinstance(value, tuple) and hasattr(value, "_fields") and not isinstance(value, Pose2):
        names = list(value._fields)
    else:
        return {place: value}
    parts = (_arrays(f"{place}/{name}", getattr(value, name)) for name in names)
    return {key: array for part in parts for key, array in part.items()}


def _outcome_of(row: Row, arrays: dict[str, Any]) -> Outcome:
    from bench.judge.metrics import Common

    common = None
    if "common/t" in arrays:
        t, estimate, truth = (arrays[f"common/{key}"] for key in ("t", "estimate", "truth"))
        common = Common(t, estimate, truth, int(arrays["common/dropped"]))
    series = arrays["t"], arrays["poses"], arrays["seconds"]
    return Outcome(row, *series, _grid(arrays), common, Pose2(*arrays["frame"].tolist()))


def _reference_of(entry: Line, arrays: dict[str, Any]) -> Reference:
    start = Pose2(*arrays["start"].tolist()) if "start" in arrays else None
    return Reference(entry, arrays.get("path"), _grid(arrays), start)


def _grid(arrays: dict[str, Any]) -> OccupancyGrid | None:
    if "grid/p" not in arrays:
        return None
    x, y = arrays["grid/origin"].tolist()
    return OccupancyGrid(arrays["grid/p"], float(arrays["grid/resolution"]), (x, y))


def _read_arrays(path: Path) -> dict[str, Any]:
    import zipfile

    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return {key: archive[key] for key in archive.files}
    except (zipfile.BadZipFile, ValueError, EOFError) as error:
        raise ValueError(f"{path}: damaged ({error}); run it again") from error


def _under(arrays: dict[str, Any], place: str) -> dict[str, Any]:
    """The arrays of one place."""
    return {key[len(place) + 1 :]: arrays[key] for key in arrays if key.startswith(f"{place}/")}
