"""What all tables have in common: a line per run, marked where it was lost, nothing empty."""

from __future__ import annotations

import pandas as pd

from bench.results import Line, Row

DECIDING_SPANS = ("1 s", "10 s", "update")  # the first that a log has tells runs apart


def label(row: Row) -> str:
    """The algorithm's name in a table; a lost run is marked and stays."""
    return f"{row['algorithm']} (lost)" if (row.get("loss") or {}).get("lost") else row["algorithm"]


def sensors(row: Row) -> str | None:
    """What the poses of a run come from, as it reports it; None where nobody knows."""
    used = row.get("used")
    return None if used is None else " + ".join(used) or "nothing"


def listed(words: list[str], last: str = "and") -> str:
    """As "a, b and c"."""
    return f" {last} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def scaled(value: float | None, scale: float) -> float | None:
    """A value in another unit; nothing stays nothing."""
    return None if value is None else scale * value


def frame_of(lines: dict[str, Line]) -> pd.DataFrame:
    """A line per algorithm; columns and lines with nothing in them are left out."""
    columns = list(dict.fromkeys(key for line in lines.values() for key in line))
    frame = pd.DataFrame.from_dict(lines, orient="index", columns=columns)
    return frame.dropna(axis=1, how="all").dropna(axis=0, how="all")


def spans_of(row: Row) -> dict[str, Line]:
    """The moments of a run's errors over each span; none without a truth."""
    return (row["errors"] or {"spans": {}})["spans"]


def span_of(row: Row, name: str) -> Line | None:
    """The moments of a run's errors over a span, by kind of error."""
    return spans_of(row).get(name)


def second_of(row: Row) -> tuple[str, Line] | None:
    """The span that decides, 1 s where the log has it, and the moments of the errors over it."""
    spans = spans_of(row)
    return next(((name, spans[name]) for name in DECIDING_SPANS if name in spans), None)


def mean_of(found: Line, key: str) -> float | None:
    """The mean among the moments of one kind of error."""
    return found[key]["mean"] if found else None


def deciding_error(row: Row) -> float | None:
    """The error over 1 s (or, in a log without truth, of its relations) [m]."""
    if row["failed"]:
        return None
    found = second_of(row)
    if found is not None:
        return float(found[1]["se2_translation_m"]["mean"])
    known = (row["relations"] or {}).get("all")
    return None if known is None else float(known["translation_m"]["mean"])
