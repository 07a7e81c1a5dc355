"""How results were made: command, machine, versions, the log and every parameter."""

from __future__ import annotations

import json
from typing import Any

import pandas as pd

from bench.report.html.markup import Markup, element, together
from bench.report.html.page import table
from bench.report.lines import Table, label
from bench.results import Line, Row, Rows


def facts(results: Line, entry: Line | None = None) -> Markup:
    """What can be said in a word or two each; of one log its entry and the notes on it, too."""
    entry = entry or {}
    notes = [element("li", note) for note in entry.get("notes") or []]
    return together(
        element("p", element("code", results["command"])),
        element("ul", *notes, class_="notes") if notes else None,
        _pairs(_choices(results, entry)),
        _folded("the log's own record", _pairs(entry["meta"])) if entry.get("meta") else None,
    )


def parameters(rows: Rows) -> Markup:
    """Parameters and own report of each run, folded."""
    return together(*(_run(row) for row in rows if not row["failed"]))


def _choices(results: Line, entry: Line) -> dict[str, Any]:
    odometry = "given" if results.get("odometry") else "hidden"
    known = {
        "odometry": odometry if entry.get("odometry") else "none in the log",
        "gyro": "yes" if entry.get("gyro") else "no",
        "stamps that jump back": entry.get("stamps_back", 0),
        "longest gap of the truth [s]": entry.get("truth_gap_s"),
    }
    machine, versions = results["machine"], results["versions"]
    return {
        **(known if entry else {}),  # of one log
        "machine": ", ".join(f"{key} {_text(value)}" for key, value in machine.items()),
        "versions": ", ".join(f"{key} {value}" for key, value in versions.items()),
    }


def _run(row: Row) -> Markup:
    values = {name: _text(value) for name, value in row["parameters"].items()}
    frame = pd.DataFrame({"value": values})
    return _folded(
        f"{label(row)}: parameters and own report",
        table(Table(f"parameters of {row['algorithm']}", frame, "parameter")),
        _pairs(row.get("report") or {}),
    )


def _folded(title: str, *children: Markup) -> Markup:
    return element("details", element("summary", title), *children)


def _pairs(values: dict[str, Any]) -> Markup:
    """A list of names and what they are."""
    rows = [
        together(element("dt", str(name)), element("dd", _text(value)))
        for name, value in values.items()
        if value is not None
    ]
    return element("dl", *rows)


def _text(value: Any) -> str:
    if isinstance(value, dict | list | tuple | bool):
        return json.dumps(value, sort_keys=True, default=str)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
