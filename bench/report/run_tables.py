"""Tables of runs: at a glance, the whole run, maps, cost, as a live node, start luck."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

import pandas as pd

from bench.report.lines import frame_of, label, mean_of, scaled, span_of
from bench.results import Line, Row, Rows

if TYPE_CHECKING:
    from bench.results import Comparison

# name in results.json: heading, scale
MAP_MEASURES = {
    "iou": ("IoU", 1.0),
    "adnn_to_truth": ("ADNN to truth [mm]", 1e3),
    "adnn_from_truth": ("from truth [mm]", 1e3),
    "hausdorff_95": ("Hausdorff 95 % [mm]", 1e3),
    "hausdorff": ("Hausdorff [mm]", 1e3),
    "ssim": ("SSIM", 1.0),
    "ssim_walls": ("SSIM at walls", 1.0),
    "wall_thickness": ("walls [mm]", 1e3),
    "true_wall_thickness": ("true walls [mm]", 1e3),
    "coverage": ("coverage [%]", 1e2),
}


def glance_table(log: Line, rows: Rows) -> pd.DataFrame:
    """The run on one screen: whose steps, error, bound, lost or not, cost."""
    limit = (log.get("bound") or {}).get("spans", {}).get("1 s")
    lines: dict[str, Line] = {}
    for row in rows:
        errors, loss, cost = row["errors"], row["loss"], row["cost"] or {}
        second = span_of(row, "1 s") or {}
        mean = mean_of(second, "se2_translation_m")
        relations = (row["relations"] or {}).get("all")
        lines[label(row)] = {
            "posed [%]": scaled(row["posed"], 1e2),
            "1 s [mm]": scaled(mean, 1e3),
            "1 s [mrad]": scaled(mean_of(second, "orientation_rad"), 1e3),
            "x bound": mean / limit["translation_m"] if mean and limit else None,
            "relations [mm]": scaled(relations["translation_m"]["mean"], 1e3)
            if relations
            else None,
            "ATE [mm]": scaled(errors["ate_m"] if errors else None, 1e3),
            "lost": "yes" if loss["lost"] else "no",
            "within limits [%]": scaled((loss.get("truth") or {}).get("completed"), 1e2),
            "CPU [ms]": cost.get("mean_ms"),
        }
    return frame_of(lines)


def overview_table(log: Line, rows: Rows) -> pd.DataFrame:
    """ATE, error at the end, drift, and failure as a result."""
    lines: dict[str, Line] = {}
    for row in rows:
        errors, loss = cast("Line", row["errors"] or {}), row["loss"]
        truth = loss.get("truth") or {}
        lines[label(row)] = {
            "ATE [mm]": scaled(errors.get("ate_m"), 1e3),
            "end [mm]": scaled(errors.get("end_m"), 1e3),
            "drift [mm/m]": scaled(errors.get("drift"), 1e3),
            "dropped": errors.get("dropped"),
            "lost at [s]": loss.get(loss["by"], {}).get("at_s") if loss["lost"] else None,
            "after [m]": truth.get("after_m") if loss["lost"] else None,
            "within limits [%]": scaled(truth.get("completed"), 1e2),
            "says lost": loss["report"]["scans"],
        }
    return frame_of(lines)


def map_table(log: Line, rows: Rows) -> pd.DataFrame:
    """Map quality; a figure that means nothing is left out, results.json has the reason.

    Below what cells and noise alone leave: a plain mapper at true poses, the true map in cells.
    """
    lines = {label(row): _map_line(row.get("map") or {}) for row in rows}
    if not any(lines.values()):
        return pd.DataFrame()
    floor = {name: _map_line(found) for name, found in (log.get("map_floor") or {}).items()}
    return frame_of(lines | floor)


def _map_line(found: Line) -> Line:
    return {
        title: scale * found[name]["value"]
        for name, (title, scale) in MAP_MEASURES.items()
        if name in found and found[name]["meaningful"]
    }


def cost_table(log: Line, rows: Rows) -> pd.DataFrame:
    """CPU time of a scan, times real time, memory; compilation apart."""
    names = {
        "mean_ms": "mean [ms]",
        "p50_ms": "p50 [ms]",
        "p95_ms": "p95 [ms]",
        "p99_ms": "p99 [ms]",
        "max_ms": "max [ms]",
        "real_time_factor": "x real time",
        "peak_memory_mb": "memory [MB]",
        "compile_s": "load + compile [s]",
        "iterate_ms": "not counted: reading a scan [ms]",
        "live_push_ms": "LiveSlam more [ms]",
        "map_ms": "drawing the map [ms]",
    }
    lines: dict[str, Line] = {}
    for row in rows:
        cost = row["cost"]
        if cost is None:
            continue
        line = lines[label(row)] = {new: cost[key] for key, new in names.items()}
        if cost["slower"] != 1.0:
            slow = f"x real time, core {cost['slower']:g}x slower"
            line[slow] = cost["real_time_factor_slower"]
    return frame_of(lines)


def live_table(log: Line, rows: Rows) -> pd.DataFrame:
    """What dropping scans does to the error."""
    lines: dict[str, Line] = {}
    for row in rows:
        if live := row.get("live"):
            offline = span_of(row, "1 s") or {}
            online = live["errors"].get("1 s") or {}
            lines[label(row)] = {
                "dropped": live["dropped"],
                "dropped [%]": 1e2 * live["share"],
                "1 s [mm], all scans": scaled(mean_of(offline, "se2_translation_m"), 1e3),
                "1 s [mm], live": scaled(mean_of(online, "se2_translation_m"), 1e3),
                "lost": "yes" if live["loss"]["lost"] else "no",
            }
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
    that failed or was lost ranks behind all others, and has no part in the mean.
    """
    names = list(dict.fromkeys(row["algorithm"] for row in comparison.rows))
    errors = [{row["algorithm"]: _kept_error(row) for row in log.rows} for log in comparison.logs]
    lines: dict[str, Line] = {}
    for name in names:
        own = [found.get(name) for found in errors]
        kept = [error for error in own if error is not None]
        worst = max(range(len(own)), key=lambda k, own=own: _behind(own[k]))  # type: ignore[misc]
        lines[name] = {
            "logs": len(own),
            "lost or failed": len(own) - len(kept),
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
    second = span_of(row, "1 s")
    if second is not None:
        return mean_of(second, "se2_translation_m")
    known = (row["relations"] or {}).get("all")
    return None if known is None else float(known["translation_m"]["mean"])


def _behind(error: float | None) -> float:
    return math.inf if error is None else error


def _rank(name: str, errors: dict[str, float | None]) -> float:
    """1 for the best; those alike share the mean of their ranks."""
    own = _behind(errors.get(name))
    others = [_behind(error) for error in errors.values()]
    better = sum(error < own for error in others)
    return 1.0 + better + 0.5 * (sum(error == own for error in others) - 1)
