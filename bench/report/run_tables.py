"""Tables of runs: the one that decides, the whole run, maps, cost, start luck."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

import pandas as pd

from bench.report import unaided
from bench.report.lines import deciding_error, frame_of, label, mean_of, scaled, second_of, sensors
from bench.results import Line, Row, Rows
from slams.registry import BASELINES

if TYPE_CHECKING:
    from bench.results import Comparison

# name in results.json: heading, scale
MAP_MEASURES = {
    "iou": ("IoU", 1.0),
    "adnn_to_truth": ("ADNN to truth [mm]", 1e3),
    "adnn_from_truth": ("from truth [mm]", 1e3),
    "wall_thickness": ("walls [mm]", 1e3),
    "true_wall_thickness": ("true walls [mm]", 1e3),
    "coverage": ("coverage [%]", 1e2),
}


def main_table(log: Line, rows: Rows) -> pd.DataFrame:
    """The one table: error, whether the run was lost, cost; without a truth what stands for it."""
    without = unaided.measures(rows) if not any(row["errors"] for row in rows) else {}
    lines: dict[str, Line] = {}
    for row in rows:
        errors, cost = row["errors"], row["cost"] or {}
        found = second_of(row)
        relations = (row["relations"] or {}).get("all")
        error = f"{found[0] if found else '1 s'} [mm]"
        lines[label(row)] = {
            error: scaled(mean_of(found[1] if found else {}, "se2_translation_m"), 1e3),
            "ATE [mm]": scaled(errors["ate_m"] if errors else None, 1e3),
            "relations [mm]": scaled(mean_of(relations or {}, "translation_m"), 1e3),
            **without.get(row["algorithm"], {}),
            "lost": _lost(row),
            "CPU [ms]": cost.get("mean_ms"),
            "memory [MB]": cost.get("peak_memory_mb"),
            "start-up [s]": cost.get("start_up_s"),
            "used": sensors(row),
        }
    return frame_of(lines)


def _lost(row: Row) -> str:
    """Whether a run was lost, and when."""
    loss = row["loss"]
    at = (loss.get(loss["by"]) or {}).get("at_s")
    return "no" if not loss["lost"] else "yes" if at is None else f"after {at:.0f} s"


def unaided_table(_: Line, rows: Rows) -> pd.DataFrame:
    """The measures that need no truth, where there is one: they can be held against it."""
    if not any(row["errors"] for row in rows):
        return pd.DataFrame()  # they stand in the one table
    found = unaided.measures(rows)
    return frame_of({label(row): found[row["algorithm"]] for row in rows})


def overview_table(log: Line, rows: Rows) -> pd.DataFrame:
    """Error at the end, drift, shares of the scans by what the pose came from."""
    lines: dict[str, Line] = {}
    for row in rows:
        errors, loss = cast("Line", row["errors"] or {}), row["loss"]
        truth = loss.get("truth") or {}
        lines[label(row)] = {
            "end [mm]": scaled(errors.get("end_m"), 1e3),
            "drift [mm/m]": scaled(errors.get("drift"), 1e3),
            "dropped": errors.get("dropped"),
            "lost after [m]": truth.get("after_m") if loss["lost"] else None,
            "posed [%]": scaled(row.get("posed"), 1e2),
            "refined [%]": scaled(row.get("refined"), 1e2),
            "within limits [%]": scaled(truth.get("completed"), 1e2),
            "says lost": loss["report"]["scans"],
        }
    return frame_of(lines)


def map_table(log: Line, rows: Rows) -> pd.DataFrame:
    """Map quality; a figure that means nothing is left out."""
    lines = {label(row): _map_line(row.get("map") or {}) for row in rows}
    return frame_of(lines) if any(lines.values()) else pd.DataFrame()


def _map_line(found: Line) -> Line:
    return {
        title: scale * found[name]["value"]
        for name, (title, scale) in MAP_MEASURES.items()
        if name in found and found[name]["meaningful"]
    }


def cost_table(log: Line, rows: Rows) -> pd.DataFrame:
    """CPU time of a scan, and how many times faster than the log the run was."""
    names = {
        "mean_ms": "mean [ms]",
        "p50_ms": "p50 [ms]",
        "p95_ms": "p95 [ms]",
        "p99_ms": "p99 [ms]",
        "max_ms": "max [ms]",
        "real_time_factor": "x real time",
    }
    lines: dict[str, Line] = {}
    for row in rows:
        cost = row["cost"]
        if cost is None:
            continue
        lines[label(row)] = {new: cost[key] for key, new in names.items()}
    return frame_of(lines)


def starts_table(_: Line, rows: Rows) -> pd.DataFrame:
    """Errors of the relations when the run begins at other scans of the log."""
    lines: dict[str, Line] = {}
    for row in rows:
        if found := row.get("starts"):
            lines[label(row)] = {
                "starts": found["n"],
                "mean [m]": found["mean"],
                "median [m]": found["median"],
                "worst [m]": found["worst"],
                f"above {found['limit_m']:g} m": f"{found['above']} of {found['n']}",
            }
    return frame_of(lines)


def logs_table(comparison: Comparison) -> pd.DataFrame:
    """A line per algorithm over all logs: lost runs, rank, mean and worst log.

    The error that counts is that over a second, or of the relations in a log without truth. A run
    that failed or was lost ranks behind all others, and has no part in the mean. Without either
    the rank is that of `unaided.mean_ranks`.
    """
    names = list(dict.fromkeys(row["algorithm"] for row in comparison.rows))
    errors = [{row["algorithm"]: _kept_error(row) for row in log.rows} for log in comparison.logs]
    own_names = {name for name in names if name.partition("@")[0] not in BASELINES}
    without, _ = unaided.mean_ranks(comparison, own_names)
    lines: dict[str, Line] = {}
    for name in names:
        own = [found.get(name) for found in errors]
        kept = [error for error in own if error is not None]
        worst = max(range(len(own)), key=lambda k, own=own: _behind(own[k]))  # type: ignore[misc]
        rows = [row for row in comparison.rows if row["algorithm"] == name]
        lines[name] = {
            "logs": len(own),
            "lost or failed": sum(bool(row["failed"] or row["loss"]["lost"]) for row in rows),
        }
        if not any(error is not None for found in errors for error in found.values()):
            lines[name]["mean rank"] = without.get(name)
            continue
        lines[name] |= {
            "mean rank": sum(_rank(name, found) for found in errors) / len(errors),
            "mean [mm]": scaled(sum(kept) / len(kept), 1e3) if kept else None,
            "worst [mm]": scaled(own[worst], 1e3),
            "worst log": comparison.logs[worst].entry["name"],
        }
    return frame_of(lines)


def _kept_error(row: Row) -> float | None:
    """The error that counts [m]; None of a run that failed or was lost."""
    if row["failed"] or row["loss"]["lost"]:
        return None
    return deciding_error(row)


def _behind(error: float | None) -> float:
    return math.inf if error is None else error


def _rank(name: str, errors: dict[str, float | None]) -> float:
    """1 for the best; those alike share the mean of their ranks."""
    own = _behind(errors.get(name))
    others = [_behind(error) for error in errors.values()]
    better = sum(error < own for error in others)
    return 1.0 + better + 0.5 * (sum(error == own for error in others) - 1)
