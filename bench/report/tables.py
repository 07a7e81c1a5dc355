"""Every table of the benchmark as a data frame, made from the results alone."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from bench.report import error_tables, run_tables
from bench.report.lines import label, sensors
from bench.results import Line, Rows

PAPER = {
    "translation_m": "Table I: relative error of translation per update [m]",
    "orientation_rad": "Table II: relative error of orientation per update [rad]",
}
TITLES = {
    "translation": PAPER["translation_m"],
    "orientation": PAPER["orientation_rad"],
    "glance": "At a glance",
    "spans": "The same over equal times and ways: mean error [mm] and [mrad], SE(2)",
    "components": "The paper's error over equal times and ways: mean [mm] in the common frame",
    "bound": "Multiples of the Cramer-Rao bound of two independent fixes, SE(2)",
    "overview": "Whole run: absolute error, drift, whether it was lost",
    "relations": "Errors of the relations, mean and deviation",
    "starts": "The same from other start scans: how much of it was luck",
    "parts": "Errors of the relations, those between near stamps and the loops apart",
    "squared": "Squared errors of the relations, mean and deviation",
    "maps": "Maps against the true one",
    "cost": "Cost on one thread",
    "live": "As a live node: one scan at a time, the newest waits, the rest is dropped",
    "published": "Published, per update, on other logs",
}
OVER_LOGS = "Over all logs: error over 1 s (without truth: of the relations) of the runs not lost"
DIFFERS = (
    "The paper's log is not public: another drive, map and simulator (stdr_simulator's ranges come "
    "in steps of its map's cell), each program at its own rate. Only the order can be compared."
)


Maker = Callable[[Line, Rows], pd.DataFrame]
MAKERS: dict[str, Maker] = {
    "translation": lambda log, rows: error_tables.paper_table(log, rows, "translation_m"),
    "orientation": lambda log, rows: error_tables.paper_table(log, rows, "orientation_rad"),
    "glance": run_tables.glance_table,
    "published": error_tables.published_table,
    "spans": error_tables.span_table,
    "components": error_tables.component_table,
    "bound": error_tables.bound_table,
    "overview": run_tables.overview_table,
    "relations": error_tables.relation_table,
    "starts": run_tables.starts_table,
    "parts": lambda _, rows: error_tables.parts_table(rows, "m", "rad"),
    "squared": lambda _, rows: error_tables.parts_table(
        rows, "m2", "rad2", ("all", "local", "loop")
    ),
    "maps": run_tables.map_table,
    "cost": run_tables.cost_table,
    "live": run_tables.live_table,
}


def tables(log: Line, rows: Rows) -> dict[str, pd.DataFrame]:
    """All tables of one log that have anything to say, by their key in `TITLES`.

    The first column tells what sensors each row used: with others it is another question.
    """
    done = [row for row in rows if not row["failed"]]
    made = {key: maker(log, done) for key, maker in MAKERS.items()}
    used = {label(row): sensors(row) for row in done}
    return {
        key: _with_sensors(frame, used)
        for key, frame in made.items()
        if len(frame) and len(frame.columns)
    }


def _with_sensors(frame: pd.DataFrame, used: dict[str, str | None]) -> pd.DataFrame:
    """The table with what each of its runs used in front; lines that are no runs have none."""
    if any(used.get(name) for name in frame.index):
        frame.insert(0, "used", [used.get(name) for name in frame.index])
    return frame
