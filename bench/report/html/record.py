"""The record of results: command, machine, versions, log and parameters."""

from __future__ import annotations

import json
from typing import Any

from bench.report.html.markup import Markup, element, together
from bench.report.lines import label
from bench.results import Line, Rows


def facts(results: Line, entry: Line | None = None) -> Markup:
    """Command, machine and versions; for one log also its notes and figures."""
    entry = entry or {}
    notes = [element("li", note) for note in entry.get("notes") or []]
    known = {key: results[key] for key in ("machine", "versions")}
    of_log = {key: entry[key] for key in ("odometry", "gyro", "stamps_back") if key in entry}
    return together(
        element("p", element("code", results["command"])),
        element("ul", *notes) if notes else None,
        _values({"odometry given": results["odometry"]} | of_log | known if entry else known),
        _folded("the log's own record", entry["meta"]) if entry.get("meta") else None,
    )


def parameters(rows: Rows) -> Markup:
    """Parameters and report of each run, folded."""
    runs = [row for row in rows if not row["failed"]]
    keys = ("parameters", "report")
    return together(
        *(
            _folded(f"{label(row)}: parameters and report", {k: row.get(k) for k in keys})
            for row in runs
        )
    )


def _folded(title: str, values: Any) -> Markup:
    return element("details", element("summary", title), _values(values))


def _values(values: Any) -> Markup:
    return element("pre", json.dumps(values, indent=1, default=str))
