"""Tables of errors: the paper's, over equal times and ways, of relations."""

from __future__ import annotations

import csv
from pathlib import Path

import pandas as pd

from bench.report.lines import frame_of, label, span_of, spans_of
from bench.results import Line, Row, Rows

PUBLISHED = Path(__file__).with_name("published.csv")


def paper_table(rows: Rows, key: str) -> pd.DataFrame:
    """[Kuehn] Table I or II: mean, deviation (ddof 0), least and greatest error per update."""
    lines: dict[str, Line] = {}
    for row in rows:
        update = span_of(row, "update")
        if update is not None:
            found = update[key]
            names = {"mean": "mean", "deviation": "std", "min": "min", "max": "max"}
            lines[label(row)] = {name: found[ours] for name, ours in names.items()}
    return frame_of(lines)


def span_table(_: Line, rows: Rows) -> pd.DataFrame:
    """Mean SE(2) errors over each span."""
    return frame_of({label(row): _span_line(row) for row in rows})


def relation_table(log: Line, rows: Rows) -> pd.DataFrame:
    """[Kuemmerle09]: absolute errors; the published ones of the log below."""
    lines = {label(row): _relation_line(row, ("all",)) for row in rows}
    if not any(lines.values()):
        return pd.DataFrame()
    for known in published("relations", log["name"]):
        lines[f"published: {known['program']}"] = {
            "[m]": known["translation_mean"],
            "± [m]": known["translation_std"],
            "[rad]": known["rotation_mean"],
            "± [rad]": known["rotation_std"],
        }
    return frame_of(lines)


def parts_table(_: Line, rows: Rows) -> pd.DataFrame:
    """[Kuemmerle09]: absolute errors of local relations and of loops."""
    return frame_of({label(row): _relation_line(row, ("local", "loop")) for row in rows})


def published(kind: str, log: str | None = None) -> list[Line]:
    """Figures printed in papers or measured from the published programs, numbers as float."""
    with PUBLISHED.open(encoding="utf-8", newline="") as file:
        rows: list[Line] = list(csv.DictReader(file))
    texts = ("program", "log", "kind", "ours", "source")
    return [
        {k: v if k in texts else (float(v) if v else None) for k, v in row.items()}
        for row in rows
        if row["kind"] == kind and log in (None, row["log"])
    ]


def published_table(_: Line, rows: Rows) -> pd.DataFrame:
    """[Kuehn] Tables I and II as printed, and what was measured of the programs on another log.

    Beside runs of our versions of those programs only.
    """
    known = published("update")
    if not {row["ours"] for row in known} & {row["algorithm"] for row in rows}:
        return pd.DataFrame()
    lines = {
        f"{row['program']}, {row['log']}": {
            "translation mean [m]": row["translation_mean"],
            "dev [m]": row["translation_std"],
            "max [m]": row["translation_max"],
            "orientation mean [rad]": row["rotation_mean"],
            "dev [rad]": row["rotation_std"],
            "max [rad]": row["rotation_max"],
        }
        for row in known
    }
    return frame_of(lines)


def _relation_line(row: Row, parts: tuple[str, ...]) -> Line:
    found, line = row["relations"] or {}, {}
    for part in parts:
        if part in found:
            own = "" if part == "all" else f"{part} "
            for key, unit in (("translation_m", "m"), ("rotation_rad", "rad")):
                line[f"{own}[{unit}]"] = found[part][key]["mean"]
                line[f"{own}± [{unit}]"] = found[part][key]["std"]
            line[f"{own}relations"] = found[part]["used"]
    return line


def _span_line(row: Row) -> Line:
    line: Line = {}
    for span, found in spans_of(row).items():
        line[f"{span} [mm]"] = 1e3 * found["se2_translation_m"]["mean"]
        line[f"{span} [mrad]"] = 1e3 * found["orientation_rad"]["mean"]
    return line
