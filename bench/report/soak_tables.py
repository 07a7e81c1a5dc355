"""Tables of bench.soak: each algorithm at rest and over a long way."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bench.report.text import markdown_table, text_table
from slams.summary import UNMAPPED

if TYPE_CHECKING:
    import pandas as pd

# figure -> column
REST = {
    "scans": "scans",
    "first_ms": "first tenth [ms]",
    "last_ms": "last tenth [ms]",
    "longest_ms": "longest [ms]",
    "first_mb": "first tenth [MB]",
    "last_mb": "last tenth [MB]",
    "off_m": "off [m]",
}
WAY = {
    "way_m": "way [m]",
    "scans": "scans",
    "early_ms": "at 500 m [ms]",
    "late_ms": "at the end [ms]",
    "p99_ms": "99 % [ms]",
    "longest_ms": "longest [ms]",
    "memory_mb": "memory [MB]",
    "seen_m2": "seen [m2]",
    "map_ms": "map [ms]",
    "ate_m": "ATE [m]",
}


def as_text(found: dict[str, Any]) -> str:
    """The tables for a terminal."""
    parts = [f"{title}\n\n{text_table(table, 'algorithm')}" for title, table in _tables(found)]
    return "\n\n".join([*parts, *_notes(found)])


def as_markdown(found: dict[str, Any]) -> str:
    """The tables for the docs."""
    parts = [f"{title}\n\n{markdown_table(table, 'algorithm')}" for title, table in _tables(found)]
    return "\n\n".join([*parts, *_notes(found)]) + "\n"


def _tables(found: dict[str, Any]) -> list[tuple[str, pd.DataFrame]]:
    titles = {
        "rest": ("At rest: CPU time of a scan, memory beyond that at the start", REST),
        "way": (f"A long way ({found['log']}): CPU time of a scan, memory, error", WAY),
    }
    return [(title, _table(found[key], columns)) for key, (title, columns) in titles.items()]


def _table(rows: list[dict[str, Any]], columns: dict[str, str]) -> pd.DataFrame:
    import pandas as pd

    whole = [row for row in rows if "failed" not in row]
    lines = {
        row["algorithm"]: {column: _rounded(row[key]) for key, column in columns.items()}
        for row in whole
    }
    return pd.DataFrame.from_dict(lines, orient="index", columns=list(columns.values()))


def _rounded(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def _notes(found: dict[str, Any]) -> list[str]:
    """What failed, and what did not enter the maps."""
    notes = []
    for row in (*found["rest"], *found["way"]):
        label = row["algorithm"]
        if "failed" in row:
            notes.append(f"{label} failed: {row['failed']}")
            continue
        report = row["report"]
        notes += [f"{label}: {report[k]} {words}" for k, words in UNMAPPED.items() if report.get(k)]
    return notes
