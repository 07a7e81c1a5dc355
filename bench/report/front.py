"""The front page's table, from a comparison and a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from bench.judge.answers import Analysis
from bench.judge.survival import Figures
from bench.report import sweep_tables, tables
from bench.report.sweep_tables import MODES
from bench.report.text import head, markdown_table
from slams.registry import BUILT_IN, IDEAS


def table(found: dict[str, Any], weighed: Analysis, known: dict[str, Any]) -> str:
    """The algorithms of the sweep: idea, error on the clean log, levels held, cost; and of what."""
    log, machine = found["logs"][0], found["machine"]["cpu"]
    main = tables.main_table(log, found["rows"]).to_dict("index")
    rows: dict[str, dict[bool, Figures]] = {}
    for name, odometry, figures in weighed.rows:
        if "@" not in name:
            rows.setdefault(name, {})[odometry] = figures
    lines = {_linked(name): _line(name, main, of) for name, of in rows.items()}
    made = markdown_table(pd.DataFrame.from_dict(lines, orient="index"))
    made = made.replace(" ---: |", " --- |", 1)  # ideas are words
    return (
        f"{made}\n\nError and time: `{found['command']}`, {head(log)}, on {machine}. "
        f"Levels held: `{known['record']['command']}`, "
        f"{sweep_tables.head(weighed, known['facts'])}.\n"
    )


def _line(name: str, main: dict[Any, Any], figures: dict[bool, Figures]) -> dict[str, object]:
    run = main.get(name, {})
    held = {mode: of.levels for mode, of in figures.items() if of.levels[1]}
    shown = {mode: f"{100.0 * k / n:.1f}" for mode, (k, n) in held.items()}
    return {
        "idea": IDEAS.get(name),
        "error over 1 s [mm]": run.get("1 s [mm]"),
        **{f"levels held, {words} [%]": shown.get(mode) for mode, words in MODES.items()},
        "per scan [ms]": run.get("CPU [ms]"),
    }


def _linked(name: str) -> str:
    """A name with the way to its package's README, where the name is one of ours."""
    folder = BUILT_IN.get(name.partition("@")[0], "").partition(".")[0]
    page = Path(folder) / "README.md"
    root = Path(__file__).resolve().parents[2]
    return f"[{name}]({page.as_posix()})" if folder and (root / page).is_file() else name
