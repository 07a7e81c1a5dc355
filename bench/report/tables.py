"""Every table of the benchmark as a data frame, made from the entries of results.json alone."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

Rows = list[dict[str, Any]]
Line = dict[str, Any]

PUBLISHED = Path(__file__).with_name("published.csv")
BOUND = "Cramer-Rao bound"
# which limit belongs to which of the paper's errors, and by which of ours it is reached or missed
BOUND_KEYS = {
    "translation_m": ("translation_m", "se2_translation_m"),
    "orientation_rad": ("rotation_rad", "orientation_rad"),
}
PAPER = {
    "translation_m": "Table I: relative error of translation per update [m]",
    "orientation_rad": "Table II: relative error of orientation per update [rad]",
}
TITLES = {
    "translation": PAPER["translation_m"],
    "orientation": PAPER["orientation_rad"],
    "spans": "The same over equal times and ways: mean error [mm] and [mrad], SE(2)",
    "components": "The paper's error over equal times and ways: mean [mm] in the common frame",
    "bound": "Multiples of the Cramer-Rao bound of two independent fixes, SE(2)",
    "overview": "Whole run: absolute error, drift, whether it was lost",
    "relations": "Errors of the relations, mean and deviation",
    "parts": "Errors of the relations, those between near stamps and the loops apart",
    "squared": "Squared errors of the relations, mean and deviation",
    "maps": "Maps against the true one",
    "cost": "Cost on one thread",
    "live": "As a live node: one scan at a time, the newest waits, the rest is dropped",
    "published": "Published, per update, on other logs",
}
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
DIFFERS = (
    "The paper's log is not public: another drive, map and simulator (stdr_simulator's ranges come "
    "in steps of its map's cell), each program at its own rate. Only the order can be compared."
)


def label(row: Line) -> str:
    """The algorithm's name in a table; a lost run is marked and stays."""
    return f"{row['algorithm']} (lost)" if (row.get("loss") or {}).get("lost") else row["algorithm"]


def tables(log: Line, rows: Rows) -> dict[str, pd.DataFrame]:
    """All tables of one log that have anything to say, by their key in `TITLES`."""
    makers: dict[str, Callable[[Line, Rows], pd.DataFrame]] = {
        "translation": lambda log, rows: paper_table(log, rows, "translation_m"),
        "orientation": lambda log, rows: paper_table(log, rows, "orientation_rad"),
        "published": published_table,
        "spans": span_table,
        "components": component_table,
        "bound": bound_table,
        "overview": overview_table,
        "relations": relation_table,
        "parts": lambda _, rows: parts_table(rows, "m", "rad"),
        "squared": lambda _, rows: parts_table(rows, "m2", "rad2", ("all", "local", "loop")),
        "maps": map_table,
        "cost": cost_table,
        "live": live_table,
    }
    done = [row for row in rows if not row["failed"]]
    made = {key: maker(log, done) for key, maker in makers.items()}
    return {key: frame for key, frame in made.items() if len(frame) and len(frame.columns)}


def paper_table(log: Line, rows: Rows, key: str) -> pd.DataFrame:
    """[Kuehn] Table I or II: mean, deviation (ddof 0), least and greatest error per update.

    Beside them the 95 % interval of the mean, and below them the physical limit.
    """
    limit, ours = BOUND_KEYS[key]
    bound = _bound(log, "update", limit)
    lines: dict[str, Line] = {}
    for row in rows:
        update = _span(row, "update")
        if update is not None:
            lines[label(row)] = {
                "mean": update[key]["mean"],
                "deviation": update[key]["std"],
                "min": update[key]["min"],
                "max": update[key]["max"],
                "95 % from": update[key]["low"],
                "to": update[key]["high"],
                "x bound": update[ours]["mean"] / bound if bound else None,
            }
    if bound is not None and lines:
        lines[BOUND] = {"mean": bound}
    return _frame(lines)


def span_table(log: Line, rows: Rows) -> pd.DataFrame:
    """Mean SE(2) errors over each span; per-update errors reward those that update often."""
    lines = {label(row): _span_line(row, "se2_translation_m", rotation=True) for row in rows}
    limits = (log.get("bound") or {}).get("spans", {})
    if limits:
        lines[BOUND] = {}
        for span, limit in limits.items():
            lines[BOUND][f"{span} [mm]"] = 1e3 * limit["translation_m"]
            lines[BOUND][f"{span} [mrad]"] = 1e3 * limit["rotation_rad"]
    return _frame(lines)


def component_table(log: Line, rows: Rows) -> pd.DataFrame:
    """The paper's difference of components over each span."""
    return _frame({label(row): _span_line(row, "translation_m", rotation=False) for row in rows})


def bound_table(log: Line, rows: Rows) -> pd.DataFrame:
    """Errors as multiples of what two independent fixes in the known map would have."""
    lines: dict[str, Line] = {}
    for row in rows:
        line: Line = {}
        for span, found in (row["errors"] or {"spans": {}})["spans"].items():
            for key, ours in BOUND_KEYS.values():
                limit = _bound(log, span, key)
                if limit:
                    line[f"{span}, {key.partition('_')[0]}"] = found[ours]["mean"] / limit
        lines[label(row)] = line
    return _frame(lines)


def overview_table(log: Line, rows: Rows) -> pd.DataFrame:
    """ATE, error at the end, drift, and failure as a result."""
    lines: dict[str, Line] = {}
    for row in rows:
        errors, loss = row["errors"] or {}, row["loss"]
        truth = loss.get("truth") or {}
        lines[label(row)] = {
            "ATE [mm]": _scaled(errors.get("ate_m"), 1e3),
            "end [mm]": _scaled(errors.get("end_m"), 1e3),
            "drift [mm/m]": _scaled(errors.get("drift"), 1e3),
            "dropped": errors.get("dropped"),
            "lost at [s]": loss.get(loss["by"], {}).get("at_s") if loss["lost"] else None,
            "after [m]": truth.get("after_m") if loss["lost"] else None,
            "within limits [%]": _scaled(truth.get("completed"), 1e2),
            "says lost": loss["report"]["scans"],
        }
    return _frame(lines)


def relation_table(log: Line, rows: Rows) -> pd.DataFrame:
    """[Kuemmerle09]: absolute errors; the published ones of the log below."""
    lines = {label(row): _relation_line(row, "m", "rad", ("all",)) for row in rows}
    if not any(lines.values()):
        return pd.DataFrame()
    for known in published("relations", log["name"]):
        lines[f"published: {known['program']}"] = {
            "[m]": known["translation_mean"],
            "± [m]": known["translation_std"],
            "[rad]": known["rotation_mean"],
            "± [rad]": known["rotation_std"],
        }
    return _frame(lines)


def parts_table(
    rows: Rows, length: str, turn: str, parts: tuple[str, ...] = ("local", "loop")
) -> pd.DataFrame:
    """[Kuemmerle09]: absolute or squared errors of local relations and loops."""
    return _frame({label(row): _relation_line(row, length, turn, parts) for row in rows})


def map_table(log: Line, rows: Rows) -> pd.DataFrame:
    """Map quality; a figure that means nothing is left out, results.json has the reason."""
    lines: dict[str, Line] = {}
    for row in rows:
        found = row.get("map") or {}
        lines[label(row)] = {
            title: scale * found[name]["value"]
            for name, (title, scale) in MAP_MEASURES.items()
            if name in found and found[name]["meaningful"]
        }
    return _frame(lines)


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
    }
    lines: dict[str, Line] = {}
    for row in rows:
        cost = row["cost"]
        line = lines[label(row)] = {new: cost[key] for key, new in names.items()}
        if cost["slower"] != 1.0:
            slow = f"x real time, core {cost['slower']:g}x slower"
            line[slow] = cost["real_time_factor_slower"]
    return _frame(lines)


def live_table(log: Line, rows: Rows) -> pd.DataFrame:
    """What dropping scans does to the error."""
    lines: dict[str, Line] = {}
    for row in rows:
        if live := row.get("live"):
            offline = _span(row, "1 s") or {}
            online = live["errors"].get("1 s") or {}
            lines[label(row)] = {
                "dropped": live["dropped"],
                "dropped [%]": 1e2 * live["share"],
                "1 s [mm], all scans": _scaled(_mean(offline, "se2_translation_m"), 1e3),
                "1 s [mm], live": _scaled(_mean(online, "se2_translation_m"), 1e3),
                "lost": "yes" if live["loss"]["lost"] else "no",
            }
    return _frame(lines)


def published(kind: str, log: str | None = None) -> Rows:
    """Figures printed in papers or measured from the published programs, numbers as float."""
    with PUBLISHED.open(encoding="utf-8", newline="") as file:
        rows: Rows = list(csv.DictReader(file))
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
    return _frame(lines)


def _relation_line(row: Line, length: str, turn: str, parts: tuple[str, ...]) -> Line:
    found, line = row["relations"] or {}, {}
    for part in parts:
        if part in found:
            own = "" if part == "all" else f"{part} "
            for key, unit in ((f"translation_{length}", length), (f"rotation_{turn}", turn)):
                line[f"{own}[{unit}]"] = found[part][key]["mean"]
                line[f"{own}± [{unit}]"] = found[part][key]["std"]
            line[f"{own}used"] = found[part]["used"]
    return line


def _span_line(row: Line, key: str, rotation: bool) -> Line:
    line: Line = {}
    for span, found in (row["errors"] or {"spans": {}})["spans"].items():
        line[f"{span} [mm]"] = 1e3 * found[key]["mean"]
        if rotation:
            line[f"{span} [mrad]"] = 1e3 * found["orientation_rad"]["mean"]
    return line


def _span(row: Line, name: str) -> Line | None:
    found: Line | None = (row["errors"] or {"spans": {}})["spans"].get(name)
    return found


def _bound(log: Line, span: str, key: str) -> float | None:
    limit = (log.get("bound") or {}).get("spans", {}).get(span)
    return None if limit is None else float(limit[key])


def _mean(found: Line, key: str) -> float | None:
    return found[key]["mean"] if found else None


def _scaled(value: float | None, scale: float) -> float | None:
    return None if value is None else scale * value


def _frame(lines: dict[str, Line]) -> pd.DataFrame:
    """A line per algorithm; columns and lines with nothing in them are left out."""
    columns = list(dict.fromkeys(key for line in lines.values() for key in line))
    frame = pd.DataFrame.from_dict(lines, orient="index", columns=columns)
    return frame.dropna(axis=1, how="all").dropna(axis=0, how="all")
