"""Every table of the benchmark as a data frame, made from the results alone."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from bench.report import error_tables, run_tables
from bench.results import Line, Rows

PAPER = {
    "translation_m": "Table I: relative error of translation per update [m]",
    "orientation_rad": "Table II: relative error of orientation per update [rad]",
}
TITLES = {
    "main": "Error, cost and whether the run was lost",
    "translation": PAPER["translation_m"],
    "orientation": PAPER["orientation_rad"],
    "spans": "The same over equal times and ways: mean error [mm] and [mrad], SE(2)",
    "overview": "Whole run: drift, where it was lost, where its poses come from",
    "relations": "Errors of the relations, mean and deviation",
    "starts": "The same from other start scans: how much of it was luck",
    "parts": "Errors of the relations, those between near stamps and the loops apart",
    "unaided": "Measures that need no truth, to hold against it; less is better",
    "maps": "Maps against the true one",
    "cost": "Cost on one thread",
    "published": "Published, per update, on other logs",
}
OVER_LOGS = "Over all logs: error over 1 s, or of the relations, of the runs not lost"
DIFFERS = (
    "The paper's log is not public: another drive, map and simulator (stdr_simulator's ranges come "
    "in steps of its map's cell), each program at its own rate. Only the order can be compared."
)


Maker = Callable[[Line, Rows], pd.DataFrame]
MAKERS: dict[str, Maker] = {
    "main": run_tables.main_table,
    "translation": lambda _, rows: error_tables.paper_table(rows, "translation_m"),
    "orientation": lambda _, rows: error_tables.paper_table(rows, "orientation_rad"),
    "published": error_tables.published_table,
    "spans": error_tables.span_table,
    "overview": run_tables.overview_table,
    "relations": error_tables.relation_table,
    "starts": run_tables.starts_table,
    "parts": error_tables.parts_table,
    "unaided": run_tables.unaided_table,
    "maps": run_tables.map_table,
    "cost": run_tables.cost_table,
}


def tables(log: Line, rows: Rows) -> dict[str, pd.DataFrame]:
    """All tables of one log that have anything to say, by their key in `TITLES`."""
    done = [row for row in rows if not row["failed"]]
    made = {key: maker(log, done) for key, maker in MAKERS.items()}
    return {key: frame for key, frame in made.items() if len(frame) and len(frame.columns)}
