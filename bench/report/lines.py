"""What all tables have in common: values of rows by their place and as text, nothing empty."""

from __future__ import annotations

from typing import Any, NamedTuple

import pandas as pd

from bench.results import Line, Row

DECIDING_SPANS = ("1 s", "10 s", "update")  # the first that a log has tells runs apart
# a table's columns: header, the way to its value in a row, a factor to the unit of the header
Columns = dict[str, tuple[str, float]]

# digits that a column shows behind the point, by its unit
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
MAP_SHARES = ("IoU",)
FIVE = ("mean", "deviation", "min", "max")


class Table(NamedTuple):
    """A table with its title, what stands over the names of its lines, and what to know of it."""

    title: str
    frame: pd.DataFrame
    corner: str = "algorithm"
    note: str = ""


def value(row: Row | Line, way: str) -> Any:
    """What stands in a row under keys, "a/b/c"; None where one of them is missing."""
    found: Any = row
    for key in way.split("/"):
        found = found.get(key) if isinstance(found, dict) else None
    return found


def line(row: Row, columns: Columns) -> Line:
    """A run's values in a table."""
    return {head: scaled(value(row, way), factor) for head, (way, factor) in columns.items()}


def frame_of(lines: dict[str, Line]) -> pd.DataFrame:
    """A line per algorithm; columns and lines with nothing in them are left out."""
    columns = list(dict.fromkeys(key for line in lines.values() for key in line))
    frame = pd.DataFrame.from_dict(lines, orient="index", columns=columns)
    return frame.dropna(axis=1, how="all").dropna(axis=0, how="all")


def label(row: Row) -> str:
    """The algorithm's name in a table; a lost run is marked and stays."""
    return f"{row['algorithm']} (lost)" if value(row, "loss/lost") else row["algorithm"]


def is_lost(row: Row) -> bool:
    """Whether a run failed or lost its way."""
    return bool(row["failed"] or row["loss"]["lost"])


def sensors(row: Row) -> str | None:
    """What the poses of a run come from, as it reports it; None where nobody knows."""
    used = row.get("used")
    return None if used is None else " + ".join(used) or "nothing"


def listed(words: list[str], last: str = "and") -> str:
    """As "a, b and c"."""
    return f" {last} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def scaled(value: Any, scale: float) -> Any:
    """A value in another unit; nothing stays nothing."""
    return None if value is None else scale * value


def deciding_span(row: Row) -> str | None:
    """The span that decides, 1 s where the log has it; none without a truth."""
    spans = value(row, "errors/spans") or {}
    return next((name for name in DECIDING_SPANS if name in spans), None)


def deciding_error(row: Row) -> float | None:
    """The error over 1 s (or, in a log without truth, of its relations) [m]."""
    span = deciding_span(row)
    way = f"errors/spans/{span}/se2_translation_m" if span else "relations/all/translation_m"
    found = value(row, f"{way}/mean")
    return None if found is None else float(found)


def cell(column: str, value: Any) -> str:
    """A value as its column shows it; nothing as a dash."""
    if value is None or value != value:
        return "-"
    if isinstance(value, str):
        return value
    if column in FIVE:
        return f"{value:.5f}"
    if column in MAP_SHARES:
        return f"{value:.3f}"
    if float(value).is_integer() and "[" not in column:
        return f"{value:.0f}"
    places = next((d for unit, d in DECIMALS.items() if unit in column), 2)
    return f"{value:.{places}f}"
