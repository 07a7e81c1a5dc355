"""Results: what came of a run, of a log, of a comparison, as typed values, written and read.

Everything the benchmark shows is drawn from these. A folder of results holds `results.json` (every
figure) and `arrays.npz` (poses, times, maps), so that `python -m bench.report DIR` draws all of it
again without a run.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

import numpy as np

from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from collections.abc import Mapping

    from bench.judge.metrics import Common, SpanErrors

FORMAT = "results-3"
FIGURES, ARRAYS = "results.json", "arrays.npz"


class Errors(TypedDict):
    """Against the truth: `spans` have the moments of the errors over each span of time or way."""

    dropped: int
    spans: dict[str, dict[str, Any]]
    ate_m: float
    end_m: float
    drift: float | None


class Row(TypedDict, total=False):
    """Every figure of one run, as it stands in results.json; None where it has no meaning.

    A run that failed has `algorithm`, `log` and the reason in `failed`, and nothing else. `used`
    are the sensors the poses come from, None where nobody knows; `posed` and `refined` the shares
    of the scans that the paper's own mechanism and the step behind it took part in.
    """

    algorithm: str
    log: str
    failed: str | None
    used: list[str] | None
    posed: float | None
    refined: float | None
    scans: int
    duration_s: float
    cpu_ms_per_scan: float
    compile_s: float
    real_time_factor: float
    cost: dict[str, Any] | None
    errors: Errors | None
    relations: dict[str, Any] | None
    starts: dict[str, Any] | None
    loss: dict[str, Any]
    map: dict[str, Any] | None
    live: dict[str, Any] | None
    report: dict[str, Any]
    seed: int
    parameters: dict[str, Any]
    meta: dict[str, Any]


Rows = list[Row]
Line = dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """What came of one run; a failed one has only its row.

    `t` (n,) [s], `poses` (n, 3) and `seconds` (n,) CPU of each update (empty where nobody measured
    it); `grid` lies in the frame of the first pose, or, where another program drew it, in one in
    which the first pose is `frame`; `common` are the poses that have a truth, beside it.
    """

    row: Row
    t: Floats = field(default_factory=lambda: np.zeros(0))
    poses: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    seconds: Floats = field(default_factory=lambda: np.zeros(0))
    grid: OccupancyGrid | None = None
    common: Common | None = None
    frame: Pose2 = IDENTITY

    @cached_property
    def errors(self) -> dict[str, SpanErrors]:
        """The errors over every span that the log has, by the span's name."""
        from bench.judge import metrics

        return {} if self.common is None else metrics.errors_over_spans(self.common)


class Reference(NamedTuple):
    """What is known of a log besides its scans.

    `entry` is the log's in results.json; `path` (n, 3) the truth seen from its first pose, `grid`
    the true map in the frame of the world, `start` the first true pose in it.
    """

    entry: Line
    path: Floats | None = None
    grid: OccupancyGrid | None = None
    start: Pose2 | None = None


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
        arrays |= _keyed(f"{k}", _arrays_of_reference(log.reference))
        for i, outcome in enumerate(log.outcomes):
            arrays |= _keyed(f"{k}/{i}", _arrays_of_outcome(outcome))
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
        count = sum(1 for key in arrays if key.startswith(f"{k}/") and key.endswith("/t"))
        outcomes = [_outcome(next(rows), _under(arrays, f"{k}/{i}")) for i in range(count)]
        logs.append(LogResult(_reference(entry, _under(arrays, f"{k}")), outcomes))
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
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: damaged ({error}); run it again") from error
    if not isinstance(found, dict):
        raise ValueError(f"{path}: got {type(found).__name__}, expected an object of results")
    if expected is not None and found.get("format") != expected:
        raise ValueError(
            f"{path}: got format {found.get('format')!r}, expected {expected!r}: written by "
            "another version; run it again"
        )
    return found


def _read_arrays(path: Path) -> dict[str, Any]:
    import zipfile

    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return {key: archive[key] for key in archive.files}
    except (zipfile.BadZipFile, ValueError, EOFError) as error:
        raise ValueError(f"{path}: damaged ({error}); run it again") from error


def _keyed(place: str, arrays: dict[str, Any]) -> dict[str, Any]:
    return {f"{place}/{key}": value for key, value in arrays.items()}


def _under(arrays: dict[str, Any], place: str) -> dict[str, Any]:
    """The arrays of one place, those of deeper ones left out."""
    found = {key[len(place) + 1 :]: arrays[key] for key in arrays if key.startswith(f"{place}/")}
    return {key: value for key, value in found.items() if "/" not in key}


def _arrays_of_outcome(outcome: Outcome) -> dict[str, Any]:
    arrays: dict[str, Any] = {
        "t": outcome.t,
        "poses": outcome.poses,
        "seconds": outcome.seconds,
        "frame": np.array(outcome.frame),
        **_arrays_of_grid(outcome.grid),
    }
    if outcome.common is not None:
        arrays |= {f"common_{key}": value for key, value in outcome.common._asdict().items()}
    return arrays


def _outcome(row: Row, arrays: dict[str, Any]) -> Outcome:
    from bench.judge.metrics import Common

    common = None
    if "common_t" in arrays:
        t, estimate, truth = (arrays[f"common_{key}"] for key in ("t", "estimate", "truth"))
        common = Common(t, estimate, truth, int(arrays["common_dropped"]))
    frame = Pose2(*arrays["frame"].tolist())
    series = arrays["t"], arrays["poses"], arrays["seconds"]
    return Outcome(row, *series, _grid(arrays), common, frame)


def _arrays_of_reference(reference: Reference) -> dict[str, Any]:
    arrays = _arrays_of_grid(reference.grid)
    if reference.path is not None:
        arrays["path"] = reference.path
    if reference.start is not None:
        arrays["start"] = np.array(reference.start)
    return arrays


def _reference(entry: Line, arrays: dict[str, Any]) -> Reference:
    start = Pose2(*arrays["start"].tolist()) if "start" in arrays else None
    return Reference(entry, arrays.get("path"), _grid(arrays), start)


def _arrays_of_grid(grid: OccupancyGrid | None) -> dict[str, Any]:
    if grid is None:
        return {}
    return {"grid": grid.p, "grid_place": np.array([grid.resolution, *grid.origin])}


def _grid(arrays: dict[str, Any]) -> OccupancyGrid | None:
    if "grid" not in arrays:
        return None
    resolution, x, y = arrays["grid_place"].tolist()
    return OccupancyGrid(arrays["grid"], resolution, (x, y))
