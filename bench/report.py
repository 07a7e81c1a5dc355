"""Tables of results as text for a terminal, markdown for the README, csv for everything else."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from bench.metrics import UpdateErrors

Rows = list[dict[str, Any]]

HEADERS = {
    "translation_m": "Table I: relative error of translation per update [m]",
    "orientation_rad": "Table II: relative error of orientation per update [rad]",
    "se2_translation_m": "SE(2) relative error of translation per update [m] (body frame)",
    "se2_rotation_rad": "SE(2) relative error of rotation per update [rad] (body frame)",
}


def paper_table(rows: Rows, key: str) -> pd.DataFrame:
    """[Kuehn] Table I or II: mean, deviation (ddof 0), least and greatest error per update."""
    columns = {"mean": "mean", "std": "deviation", "min": "min", "max": "max"}
    values = {
        row["algorithm"]: {new: row["per_update"][key][old] for old, new in columns.items()}
        for row in rows
        if row.get("per_update")
    }
    return pd.DataFrame.from_dict(values, orient="index", columns=list(columns.values()))


def overview_table(rows: Rows) -> pd.DataFrame:
    """One line per algorithm: errors over 1 s and 10 s, ATE, relations, cost."""
    values = {row["algorithm"]: _overview(row) for row in rows if not row["failed"]}
    frame = pd.DataFrame.from_dict(values, orient="index")
    return frame.dropna(axis=1, how="all")


def _overview(row: dict[str, Any]) -> dict[str, float | None]:
    errors = row["errors"] or {}
    line: dict[str, float | None] = {}
    for key, name in (("per_1_s", "1 s"), ("per_10_s", "10 s")):
        over = errors.get(key)
        line[f"{name} [mm]"] = over and 1e3 * over["translation_m"]["mean"]
        line[f"{name} [mrad]"] = over and 1e3 * over["rotation_rad"]["mean"]
    line["ATE [mm]"] = errors["ate_m"] * 1e3 if "ate_m" in errors else None
    relations = row.get("relations") or {}
    if "translation_m" in relations:
        line["relations [m]"] = relations["translation_m"]["mean"]
        line["relations [rad]"] = relations["rotation_rad"]["mean"]
        line["used"] = relations["used"]
    line["CPU ms/scan"] = row["cpu_ms_per_scan"]
    line["x real time"] = row["real_time_factor"]
    line["compile s"] = row["compile_s"]
    return line


FORMATS = {"ATE [mm]": "{:.1f}", "CPU ms/scan": "{:.3f}", "x real time": "{:.0f}", "used": "{:.0f}"}


def _cell(column: str, value: Any) -> str:
    if value is None or value != value:
        return "-"
    if column in ("mean", "deviation", "min", "max") or column.startswith("relations"):
        return f"{value:.5f}"
    return FORMATS.get(column, "{:.2f}").format(value)


def text_table(frame: pd.DataFrame) -> str:
    """A frame in aligned columns."""
    lines = _cells(frame)
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    return "\n".join(
        "  ".join(
            c.ljust(w) if k == 0 else c.rjust(w)
            for k, (c, w) in enumerate(zip(line, widths, strict=True))
        )
        for line in lines
    )


def markdown_table(frame: pd.DataFrame) -> str:
    """A frame as a markdown table."""
    lines = _cells(frame)
    rule = ["---", *["---:"] * (len(lines[0]) - 1)]
    return "\n".join("| " + " | ".join(line) + " |" for line in (lines[0], rule, *lines[1:]))


def _cells(frame: pd.DataFrame) -> list[list[str]]:
    head = ["algorithm", *map(str, frame.columns)]
    body = [
        [str(name), *(_cell(str(c), v) for c, v in zip(frame.columns, line, strict=True))]
        for name, line in zip(frame.index, frame.to_numpy(), strict=True)
    ]
    return [head, *body]


def as_text(log: dict[str, Any], rows: Rows) -> str:
    """The whole comparison on one log, for a terminal."""
    parts = [
        f"{log['name']}: {log['scans']} scans of {log['beams']} beams, {log['duration_s']:.0f} s"
    ]
    if any(row.get("per_update") for row in rows):
        for key in ("translation_m", "orientation_rad"):
            parts += [HEADERS[key], text_table(paper_table(rows, key))]
        parts.append("Relative SE(2) errors over a time (mean), absolute error, cost")
    overview = overview_table(rows)
    if len(overview):
        parts.append(text_table(overview))
    parts += [f"{row['algorithm']} failed: {row['failed']}" for row in rows if row["failed"]]
    return "\n\n".join(parts)


def as_markdown(log: dict[str, Any], rows: Rows) -> str:
    """The whole comparison on one log, for a README."""
    parts = []
    if any(row.get("per_update") for row in rows):
        for key in HEADERS:
            parts += [f"**{HEADERS[key]}**", markdown_table(paper_table(rows, key))]
    parts += ["**Errors over a time, absolute error, cost**", markdown_table(overview_table(rows))]
    return "\n\n".join(parts) + "\n"


def write_csv(folder: Path, rows: Rows) -> None:
    """The paper's two tables, and all rows of the overview, as csv."""
    for name, key in (
        ("table1_translation", "translation_m"),
        ("table2_orientation", "orientation_rad"),
    ):
        table = paper_table(rows, key)
        if len(table):
            table.to_csv(folder / f"{name}.csv", index_label="algorithm")
    overview_table(rows).to_csv(folder / "overview.csv", index_label="algorithm")


def write_errors(path: Path, errors: UpdateErrors) -> None:
    """The errors of each update as csv."""
    columns: Sequence[str] = (
        "t_s",
        "translation_m",
        "orientation_rad",
        "se2_translation_m",
        "se2_rotation_rad",
    )
    frame = pd.DataFrame(dict(zip(columns, errors[:5], strict=True)))
    frame.to_csv(path, index=False, float_format="%.9f")
