"""Tables as text for a terminal, as markdown and as csv."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from bench.judge.metrics import SpanErrors
from bench.report import tables, words
from bench.report.lines import Table, cell
from bench.results import Line, Rows

if TYPE_CHECKING:
    from bench.results import Comparison


def cells(frame: pd.DataFrame, corner: str, bold: str = "") -> list[list[str]]:
    """Header and body of a table as text.

    `corner` is the header of the first column, `bold` replaces the marks of bold text.
    """
    head = [corner, *map(str, frame.columns)]
    body = [
        [str(name), *(cell(str(c), v) for c, v in zip(frame.columns, line, strict=True))]
        for name, line in zip(frame.index, frame.to_numpy(), strict=True)
    ]
    return [head, *([text.replace("**", bold) for text in line] for line in body)]


def text_table(frame: pd.DataFrame, corner: str = "algorithm") -> str:
    """A frame as text in aligned columns."""
    (_, *head), *body = cells(frame, corner)
    names, values = [line[0] for line in body], [line[1:] for line in body]
    return pd.DataFrame(values, names, pd.Index(head, name=corner)).to_string()


def markdown_table(frame: pd.DataFrame, corner: str = "algorithm") -> str:
    """A frame as a markdown table."""
    lines = cells(frame, corner, "**")
    rule = ["---", *["---:"] * (len(lines[0]) - 1)]
    return "\n".join("| " + " | ".join(line) + " |" for line in (lines[0], rule, *lines[1:]))


def titled(one: Table) -> str:
    """Title, markdown table and note."""
    parts = [f"**{one.title}**", markdown_table(one.frame, one.corner), one.note]
    return "\n\n".join(part for part in parts if part)


def head(log: Line) -> str:
    """The log in one line."""
    return f"{log['name']}: {log['scans']} scans of {log['beams']} beams, {log['duration_s']:.0f} s"


def terminal(comparison: Comparison) -> str:
    """The answer, then one table for each log."""
    parts = ["\n".join(words.answer(comparison))]
    if len(comparison.logs) > 1:
        parts += [tables.OVER_LOGS_TITLE, text_table(tables.logs_table(comparison))]
    parts += [as_text(log.entry, log.rows) for log in comparison.logs]
    return "\n\n".join(parts)


def as_text(log: Line, rows: Rows) -> str:
    """The comparison on one log, for a terminal."""
    made = tables.tables(log, rows)
    parts = [head(log), *(f"note: {note}" for note in log.get("notes", []))]
    for key in ("main", "starts"):
        if key in made:
            parts += [*([made[key].title] if key != "main" else []), text_table(made[key].frame)]
    return "\n\n".join([*parts, *words.failures(rows)])


def as_markdown(log: Line, rows: Rows) -> str:
    """The whole comparison on one log, for a README."""
    parts = [head(log), *(f"Note: {note}." for note in log.get("notes", []))]
    parts += map(titled, tables.tables(log, rows).values())
    if log.get("verdicts"):
        parts.append("\n".join(f"- {verdict['sentence']}" for verdict in log["verdicts"]))
    return "\n\n".join([*parts, *words.failures(rows)]) + "\n"


def write_csv(folder: Path, made: Mapping[str, Table]) -> None:
    """Every table as csv with all digits."""
    for key, one in made.items():
        one.frame.to_csv(folder / f"table-{key}.csv", index_label=one.corner)


def write_errors(path: Path, errors: SpanErrors) -> None:
    """The errors of each update as csv."""
    columns: Sequence[str] = ("t_s", "translation_m", "orientation_rad", "se2_translation_m")
    frame = pd.DataFrame(dict(zip(columns, errors, strict=True)))
    frame.to_csv(path, index=False, float_format="%.9f")
