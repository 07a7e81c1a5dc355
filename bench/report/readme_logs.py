"""The README's tables of real logs, from the results that are kept."""

from __future__ import annotations

from typing import Any

from bench.report.tables import published
from slams.registry import names


def relations_table(known: dict[str, Any]) -> str:
    """Errors of the relations on real logs, a column for each log, the published ones below."""
    lines: dict[str, dict[str, str]] = {}
    for key, runs in known.items():
        for label, run in runs.items():
            lines.setdefault(label, {})[key] = _relation_cell(run)
        with_odometry = key.endswith("with odometry")
        for row in published("relations", key.partition(",")[0]) if with_odometry else []:
            cell = f"{row['translation_mean']:.4f} ± {row['translation_std']:.4f}"
            lines.setdefault(f"published: {row['program']}", {})[key] = cell
    used = {
        key: max(int(run["relations"]["used"]) for run in own.values())
        for key, own in known.items()
    }
    heads = [f"{key} ({used[key]} relations)" for key in known]
    text = [f"| | {' | '.join(heads)} |", "|---|" + "---:|" * len(heads)]
    ours = {name: k for k, name in enumerate(names())}
    for label, cells in sorted(lines.items(), key=lambda line: ours.get(line[0], len(ours))):
        text.append(f"| {label} | {' | '.join(cells.get(key, '-') for key in known)} |")
    return "\n".join(text) + "\n"


def _relation_cell(run: dict[str, Any]) -> str:
    if "all" not in run["relations"]:
        return "-"
    error = run["relations"]["all"]["translation_m"]
    lost = " (lost)" if run["loss"]["lost"] else ""
    return f"{error['mean']:.4f} ± {error['std']:.4f}{lost}{_luck(run.get('starts'))}"


def _luck(starts: dict[str, Any] | None) -> str:
    """Over several start scans: mean, worst, how many above the limit; a lost run has no error."""
    if not starts:
        return ""
    mean, worst = (
        "-" if starts[key] is None else f"{starts[key]:.4f}" for key in ("mean", "worst")
    )
    above = f"{starts['above']} above {starts['limit_m']:g}"
    return f"; {starts['n']} starts: mean {mean}, worst {worst}, {above}"


def public_table(found: dict[str, Any]) -> str:
    """Size of the public logs, and what each algorithm costs on them."""
    labels = list(dict.fromkeys(label for log in found["logs"] for label in log["cpu_ms"]))
    heads = ["log", "scans x beams", "lasts [s]", *(f"{label} [ms]" for label in labels)]
    text = [f"| {' | '.join(heads)} |", "| --- |" + " ---: |" * (len(heads) - 1)]
    for log in found["logs"]:
        cells = [log["name"], f"{log['scans']} x {log['beams']}", f"{log['duration_s']:.0f}"]
        costs = (log["cpu_ms"].get(label) for label in labels)
        cells += ["-" if cost is None else f"{cost:.1f}" for cost in costs]
        text.append(f"| {' | '.join(cells)} |")
    head = f"`{found['command']}`, CPU time of a scan on {found['cpu']}:"
    return f"{head}\n\n" + "\n".join(text) + "\n"
