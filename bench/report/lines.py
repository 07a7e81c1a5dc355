"""Helpers of all tables: columns as paths into result rows, and values as text."""

from __future__ import annotations

from typing import Any, NamedTuple

import pandas as pd

from bench.results import Line, Row, Rows

# the first of all runs of a log compares them; in words
DECIDING_SPANS = {"1 s": "over 1 s", "10 s": "over 10 s", "update": "per update"}
# columns of a table: header, path of the value in a row, factor to the unit of the header
Columns = dict[str, tuple[str, float]]

# decimals of a column, by the unit in its header
DECIMALS = {
    "after [m]": 1,
    "[m]": 4,
    "[rad]": 4,
    "walls [mm]": 0,
    "[mm]": 2,
    "[mrad]": 3,
    "[ms]": 3,
    "[MB]": 0,
    "[s]": 1,
    "[%]": 2,
    "real time": 0,
    "walls [x]": 3,
}
SHARE_COLUMNS = ("IoU",)
FIVE_DECIMAL_COLUMNS = ("mean", "deviation", "min", "max")


class Table(NamedTuple):
    """A table with its title, the header of its first column, and a note."""

    title: str
    frame: pd.DataFrame
    corner: str = "algorithm"
    note: str = ""


def value(row: Row | Line, path: str) -> Any:
    """The value of a row at keys "a/b/c"; None where one of them is missing."""
    found: Any = row
    for key in path.split("/"):
        found = found.get(key) if isinstance(found, dict) else None
    return found


def line(row: Row, columns: Columns) -> Line:
    """A run's values in a table."""
    return {head: scaled(value(row, path), factor) for head, (path, factor) in columns.items()}


def frame_of(lines: dict[str, Line]) -> pd.DataFrame:
    """A frame of lines by algorithm, without empty columns and lines."""
    columns = list(dict.fromkeys(key for line in lines.values() for key in line))
    frame = pd.DataFrame.from_dict(lines, orient="index", columns=columns)
    return frame.dropna(axis=1, how="all").dropna(axis=0, how="all")


def label(row: Row) -> str:
    """The algorithm's name in a table; lost runs are marked."""
    return f"{row['algorithm']} (lost)" if value(row, "loss/lost") else row["algorithm"]


def is_lost(row: Row) -> bool:
    """Whether a run failed or was lost."""
    return bool(row["failed"] or row["loss"]["lost"])


def sensors(row: Row) -> str | None:
    """The sensors behind the poses of a run; None if unknown."""
    used = row.get("used")
    return None if used is None else " + ".join(used) or "nothing"


def listed(words: list[str], last: str = "and") -> str:
    """Join words as "a, b and c"."""
    return f" {last} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def scaled(value: Any, scale: float) -> Any:
    """A value in another unit; None stays None."""
    return None if value is None else scale * value


def deciding_span(rows: Rows) -> str | None:
    """The span that compares the runs of a log, 1 s if all have it; None without ground truth."""
    known = [spans for row in rows if (spans := value(row, "errors/spans"))]
    return next((name for name in DECIDING_SPANS if known and all(name in s for s in known)), None)


def deciding_errors(rows: Rows) -> dict[str, float | None]:
    """Error [m] of each row of a log over the same span, or of the relations without truth."""
    span = deciding_span(rows)
    path = f"errors/spans/{span}/se2_translation_m" if span else "relations/all/translation_m"
    return {row["algorithm"]: value(row, f"{path}/mean") for row in rows}


def cell(column: str, value: Any) -> str:
    """A value as text in the format of its column; None is a dash."""
    if value is None or value != value:
        return "-"
    if isinstance(value, str):
        return value
    if column in FIVE_DECIMAL_COLUMNS:
        return f"{value:.5f}"
    if column in SHARE_COLUMNS:
        return f"{value:.3f}"
    if float(value).is_integer() and "[" not in column:
        return f"{value:.0f}"
    places = next((d for unit, d in DECIMALS.items() if unit in column), 2)
    return f"{value:.{places}f}"
