"""All tables of a comparison as data frames, from its results."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from bench.judge.metrics import SPANS
from bench.report import unaided
from bench.report.lines import (
    Columns,
    Table,
    deciding_errors,
    deciding_span,
    frame_of,
    is_lost,
    label,
    line,
    sensors,
    value,
)
from bench.results import Line, Row, Rows
from slams.registry import BASELINES

if TYPE_CHECKING:
    from bench.results import Comparison

Maker = Callable[[Line, Rows], pd.DataFrame]

PUBLISHED_FILE = Path(__file__).with_name("published.csv")
OVER_LOGS_TITLE = "Over all logs: error over 1 s, or of the relations, of the runs not lost"
PUBLISHED_NOTE = (
    "The paper's log is not public. Drive, map, update rates and simulator differ "
    "(stdr_simulator's ranges have steps of a cell): only the order can be compared."
)


def _update(kind: str) -> Columns:
    """[Kuehn] Table I or II: mean, deviation (ddof 0), minimum and maximum error per update."""
    names = {"mean": "mean", "deviation": "std", "min": "min", "max": "max"}
    return {head: (f"errors/spans/update/{kind}/{key}", 1) for head, key in names.items()}


def _relations(part: str, mark: str = "") -> Columns:
    """[Kuemmerle09]: absolute errors of all relations, or of the local ones or the loops."""
    return {
        f"{mark}[m]": (f"relations/{part}/translation_m/mean", 1),
        f"{mark}± [m]": (f"relations/{part}/translation_m/std", 1),
        f"{mark}[rad]": (f"relations/{part}/rotation_rad/mean", 1),
        f"{mark}± [rad]": (f"relations/{part}/rotation_rad/std", 1),
        f"{mark}relations": (f"relations/{part}/used", 1),
    }


SPAN_COLUMNS: Columns = {
    f"{span} [{unit}]": (f"errors/spans/{span}/{key}/mean", 1e3)
    for span in SPANS
    for unit, key in (("mm", "se2_translation_m"), ("mrad", "orientation_rad"))
}
OVERVIEW_COLUMNS: Columns = {
    "end [mm]": ("errors/end_m", 1e3),
    "drift [mm/m]": ("errors/drift", 1e3),
    "dropped": ("errors/dropped", 1),
    "lost after [m]": ("loss/truth/after_m", 1),
    "posed [%]": ("posed", 1e2),
    "refined [%]": ("refined", 1e2),
    "within limits [%]": ("loss/truth/completed", 1e2),
    "says lost": ("loss/report/scans", 1),
}
PRICE_COLUMNS: Columns = {
    "CPU [ms]": ("cost/mean_ms", 1),
    "memory [MB]": ("cost/peak_memory_mb", 1),
    "start-up [s]": ("cost/start_up_s", 1),
}
COST_COLUMNS: Columns = {
    "mean [ms]": ("cost/mean_ms", 1),
    "p50 [ms]": ("cost/p50_ms", 1),
    "p95 [ms]": ("cost/p95_ms", 1),
    "p99 [ms]": ("cost/p99_ms", 1),
    "max [ms]": ("cost/max_ms", 1),
    "x real time": ("cost/real_time_factor", 1),
}
MAP_COLUMNS: Columns = {
    "IoU": ("map/iou", 1),
    "ADNN to truth [mm]": ("map/adnn_to_truth", 1e3),
    "from truth [mm]": ("map/adnn_from_truth", 1e3),
    "walls [mm]": ("map/wall_thickness", 1e3),
    "true walls [mm]": ("map/true_wall_thickness", 1e3),
    "coverage [%]": ("map/coverage", 1e2),
}
START_COLUMNS: Columns = {
    "starts": ("starts/n", 1),
    "mean [m]": ("starts/mean", 1),
    "median [m]": ("starts/median", 1),
    "worst [m]": ("starts/worst", 1),
}


def main_table(_: Line, rows: Rows) -> pd.DataFrame:
    """The main table: error, lost runs, cost; without ground truth the other measures."""
    without = {} if any(row["errors"] for row in rows) else unaided.measures(rows)
    lines: dict[str, Line] = {}
    span = deciding_span(rows)
    for row in rows:
        errors: Columns = {
            f"{span} [mm]": (f"errors/spans/{span}/se2_translation_m/mean", 1e3),
            "ATE [mm]": ("errors/ate_m", 1e3),
            "relations [mm]": ("relations/all/translation_m/mean", 1e3),
        }
        found = line(row, errors) | without.get(row["algorithm"], {}) | {"lost": _lost(row)}
        lines[label(row)] = found | line(row, PRICE_COLUMNS) | {"used": sensors(row)}
    return frame_of(lines)


def _lost(row: Row) -> str:
    """Whether and when a run was lost."""
    at = value(row, f"loss/{row['loss']['by']}/at_s")
    return "no" if not row["loss"]["lost"] else "yes" if at is None else f"after {at:.0f} s"


def unaided_table(_: Line, rows: Rows) -> pd.DataFrame:
    """The measures without ground truth, to compare them with the errors."""
    if not any(row["errors"] for row in rows):
        return pd.DataFrame()  # the main table contains them
    found = unaided.measures(rows)
    return frame_of({label(row): found[row["algorithm"]] for row in rows})


def starts_table(_: Line, rows: Rows) -> pd.DataFrame:
    """Errors of the relations for runs that start at other scans of the log."""
    lines: dict[str, Line] = {}
    for row in rows:
        if found := row.get("starts"):
            above = {f"above {found['limit_m']:g} m": f"{found['above']} of {found['n']}"}
            lines[label(row)] = line(row, START_COLUMNS) | above
    return frame_of(lines)


def relation_table(log: Line, rows: Rows) -> pd.DataFrame:
    """[Kuemmerle09]: absolute errors of the relations, with the published errors of the log."""
    found = frame_of({label(row): line(row, _relations("all")) for row in rows})
    known = {"[m]": "translation_mean", "± [m]": "translation_std"}
    known |= {"[rad]": "rotation_mean", "± [rad]": "rotation_std"}
    printed = {
        f"published: {one['program']}": {head: one[key] for head, key in known.items()}
        for one in published("relations", log["name"])
    }
    return pd.concat([found, frame_of(printed)]) if len(found) and printed else found


def published(kind: str, log: str | None = None) -> list[Line]:
    """Figures from papers, or measured with the published programs."""
    known = pd.read_csv(PUBLISHED_FILE)
    chosen = known[(known["kind"] == kind) & ((known["log"] == log) | (log is None))]
    return [{str(key): one for key, one in row.items()} for row in chosen.to_dict("records")]


def published_table(_: Line, rows: Rows) -> pd.DataFrame:
    """[Kuehn] Tables I and II as printed, and measurements of the programs on another log.

    Empty unless our versions of these programs ran.
    """
    known = published("update")
    if not {row["ours"] for row in known} & {row["algorithm"] for row in rows}:
        return pd.DataFrame()
    columns = {
        "translation mean [m]": "translation_mean",
        "dev [m]": "translation_std",
        "max [m]": "translation_max",
        "orientation mean [rad]": "rotation_mean",
        "dev [rad]": "rotation_std",
        "max [rad]": "rotation_max",
    }
    return frame_of(
        {
            f"{row['program']}, {row['log']}": {head: row[key] for head, key in columns.items()}
            for row in known
        }
    )


def logs_table(comparison: Comparison) -> pd.DataFrame:
    """A line per algorithm over all logs: lost runs, rank, mean and worst log.

    The error is that over 1 s, or of the relations in a log without ground truth. Failed and lost
    runs rank last and do not enter the mean. Without any error the rank is that of
    `unaided.mean_ranks`.
    """
    runs = comparison.by_algorithm()
    lost = {name: [is_lost(row) for row in rows] for name, rows in runs.items()}
    table = pd.DataFrame(
        {"logs": len(comparison.logs), "lost or failed": [sum(of) for of in lost.values()]},
        index=[*runs],
    )
    every = [deciding_errors(log.rows) for log in comparison.logs]
    errors = pd.DataFrame(every, columns=[*runs], dtype=float).mask(pd.DataFrame(lost))
    if errors.isna().all(axis=None):
        own_names = {name for name in runs if name.partition("@")[0] not in BASELINES}
        ranks, _ = unaided.mean_ranks(comparison, own_names)
        return table.assign(**{"mean rank": pd.Series(ranks, dtype=float)}).dropna(
            axis=1, how="all"
        )
    ranked = errors.fillna(math.inf)
    worst = ranked.to_numpy().argmax(axis=0)
    table["mean rank"] = ranked.rank(axis=1).mean()
    table["mean [mm]"] = 1e3 * errors.mean()
    table["worst [mm]"] = 1e3 * errors.max(skipna=False)
    table["worst log"] = [comparison.logs[k].entry["name"] for k in worst]
    return table.dropna(axis=1, how="all")


def _by(columns: Columns) -> Maker:
    """A maker of the table with these columns."""
    return lambda _, rows: frame_of({label(row): line(row, columns) for row in rows})


# title and maker of each table, by the name of its file
TABLES: dict[str, tuple[str, Maker]] = {
    "main": ("Error, cost and whether the run was lost", main_table),
    "translation": (
        "Table I: relative error of translation per update [m]",
        _by(_update("translation_m")),
    ),
    "orientation": (
        "Table II: relative error of orientation per update [rad]",
        _by(_update("orientation_rad")),
    ),
    "published": ("Published, per update, on other logs", published_table),
    "spans": (
        "The same over equal times and distances: mean error [mm] and [mrad], SE(2)",
        _by(SPAN_COLUMNS),
    ),
    "overview": ("Whole run: drift, point of loss, source of the poses", _by(OVERVIEW_COLUMNS)),
    "relations": ("Errors of the relations, mean and deviation", relation_table),
    "starts": ("The same from other start scans", starts_table),
    "parts": (
        "Errors of the relations, local ones and loops separately",
        _by(_relations("local", "local ") | _relations("loop", "loop ")),
    ),
    "unaided": ("Measures without ground truth, for comparison; less is better", unaided_table),
    "maps": ("Maps compared with the true one", _by(MAP_COLUMNS)),
    "cost": ("Cost on one thread", _by(COST_COLUMNS)),
}


def tables(log: Line, rows: Rows) -> dict[str, Table]:
    """All tables of one log that are not empty, by their names."""
    done = [row for row in rows if not row["failed"]]
    made = {key: Table(title, maker(log, done)) for key, (title, maker) in TABLES.items()}
    made["published"] = made["published"]._replace(note=PUBLISHED_NOTE)
    return {key: one for key, one in made.items() if one.frame.size}
