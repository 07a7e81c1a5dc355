"""The committed analysis of a sweep, and its parts of the README and docs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bench.judge.answers import Analysis, Cell, analysis
from bench.judge.statistics import Share
from bench.judge.survival import Critical, Figures
from bench.report import sweep_tables
from bench.report.text import markdown_table
from bench.results.sweep import Sweep


def adopt(path: Path, found: Sweep) -> None:
    """Keep what the pages show of a sweep: its analysis, not its thousands of trials."""
    logs = [{"name": log["name"], "place": log["place"]} for log in found.facts["logs"]]
    known = {
        "facts": found.facts | {"logs": logs},
        "record": found.record | {"command": found.record["command"].partition(" --out")[0]},
        **_plain(analysis(found)),
    }
    path.write_text(json.dumps(known, separators=(",", ":")) + "\n", encoding="utf-8")


def committed(path: Path) -> tuple[Analysis, dict[str, Any]]:
    """What `adopt` kept: the analysis; facts and record of the sweep."""
    known = json.loads(path.read_text(encoding="utf-8"))
    found = Analysis(
        [(name, odometry, _figures(of)) for name, odometry, of in known["rows"]],
        [_cell(of) for of in known["cells"]],
        [_cell(of) for of in known["situations"]],
    )
    return found, {"facts": known["facts"], "record": known["record"]}


def _plain(found: Analysis) -> dict[str, Any]:
    return {
        "rows": [[name, odometry, of._asdict()] for name, odometry, of in found.rows],
        "cells": [cell._asdict() for cell in found.cells],
        "situations": [cell._asdict() for cell in found.situations],
    }


def _figures(of: dict[str, Any]) -> Figures:
    shares = ("clean", "worse_than_wheels", "right_again", "said_in_time")
    made = {key: Share(*of[key]) for key in shares}
    return Figures(**of | made | {"levels": tuple(of["levels"])})


def _cell(of: dict[str, Any]) -> Cell:
    curves = {row: [Share(*one) for one in shares] for row, shares in of["curves"].items()}
    critical = {row: Critical(*values) for row, values in of["critical"].items()}
    beaten = {row: tuple(why) for row, why in of["beaten"].items()}
    return Cell(**of | {"curves": curves, "critical": critical, "beaten": beaten})


def choice(path: Path) -> str:
    """Which one to take: the answers by situation, a table for each question."""
    return "\n\n".join(_shown(sweep_tables.choices(committed(path)[0]))) + "\n"


def part(path: Path) -> str:
    """All rows together, and the critical levels with the answers."""
    found, known = committed(path)
    command, cpu = known["record"]["command"], known["record"]["machine"]["cpu"]
    head = f"`{command}`, on {cpu}: {sweep_tables.head(found, known['facts'])}."
    return "\n\n".join([head, *_tables(path, ("rows", "critical"))]) + "\n"


def field_part(path: Path) -> str:
    """Whether lost runs said so."""
    return "\n\n".join(_tables(path, ("alarms",))) + "\n"


def _tables(path: Path, kinds: tuple[str, ...]) -> list[str]:
    found, known = committed(path)
    made = sweep_tables.tables(found, known["facts"]).items()
    return _shown([one for name, one in made if name.startswith(kinds)])


def _shown(tables: list[sweep_tables.Table]) -> list[str]:
    return [f"**{one.title}**\n\n{markdown_table(one.frame, one.corner)}" for one in tables]
