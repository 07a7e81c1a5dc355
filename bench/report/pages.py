"""The generated parts of README and docs, from the kept results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd

from bench.judge.answers import analysis
from bench.report import sweep_tables, tables
from bench.report.lines import Table
from bench.report.sweep_tables import MODES
from bench.report.text import head, markdown_table, titled
from bench.results.sweep import Sweep
from slams.registry import BUILT_IN, DESCRIPTIONS, names

N_FRONT_QUESTIONS = 2  # on the front page: which program to use, which idea is best

Kept = dict[str, Any]


def adopt(path: Path, found: Sweep) -> None:
    """Keep the tables of a sweep that the pages show, without its thousands of trials."""
    analyzed = analysis(found)
    known = {
        "record": found.record | {"command": found.record["command"].partition(" --out")[0]},
        "head": sweep_tables.head(analyzed, found.facts),
        "choices": [_plain(one) for one in sweep_tables.choices(analyzed)],
        "tables": {
            name: _plain(one) for name, one in sweep_tables.tables(analyzed, found.facts).items()
        },
    }
    path.write_text(json.dumps(known, separators=(",", ":")) + "\n", encoding="utf-8")


def _plain(one: Table) -> Kept:
    return one._asdict() | {"frame": one.frame.to_dict("split")}


def _table(kept: Kept) -> Table:
    return Table(kept["title"], pd.DataFrame(**kept["frame"], dtype=object), kept["corner"])


def front_table(found: Kept, swept: Kept) -> str:
    """The algorithms of the sweep: idea, error on the default log, levels held, cost."""
    log, machine = found["logs"][0], found["machine"]["cpu"]
    runs = tables.main_table(log, found["rows"]).to_dict("index")
    held = _table(swept["tables"]["rows"]).frame["levels held [%]"].to_dict()
    rows = dict.fromkeys(str(name).rpartition(", ")[0] for name in held)
    lines = {
        _linked(name): {
            "idea": DESCRIPTIONS.get(name),
            "error over 1 s [mm]": runs.get(name, {}).get("1 s [mm]"),
            **{f"levels held, {m} [%]": _short(held.get(f"{name}, {m}")) for m in MODES.values()},
            "per scan [ms]": runs.get(name, {}).get("CPU [ms]"),
        }
        for name in rows
        if "@" not in name
    }
    made = markdown_table(pd.DataFrame.from_dict(lines, orient="index"))
    made = made.replace(" ---: |", " --- |", 1)  # ideas are words
    return (
        f"{made}\n\nError and time: `{found['command']}`, {head(log)}, on {machine}. "
        f"Levels held: `{swept['record']['command']}`, {swept['head']}.\n"
    )


def _short(share: float | None) -> str | None:
    return None if share is None else f"{share:.1f}"


def _linked(name: str) -> str:
    """A name, linked to its package's README if it is one of ours."""
    folder = BUILT_IN.get(name.partition("@")[0], "").partition(".")[0]
    page = Path(folder) / "README.md"
    root = Path(__file__).resolve().parents[2]
    return f"[{name}]({page.as_posix()})" if folder and (root / page).is_file() else name


def choice(swept: Kept) -> str:
    """The answers by situation, a table for each of the front page's questions."""
    return _shown(swept["choices"][:N_FRONT_QUESTIONS])


def field(swept: Kept, *kinds: str) -> str:
    """The tables of a sweep whose names begin with one of `kinds`."""
    return _shown([one for name, one in swept["tables"].items() if name.startswith(kinds)])


def sweep_part(swept: Kept) -> str:
    """Command, row figures, critical levels, and the answers not on the front page."""
    command, cpu = swept["record"]["command"], swept["record"]["machine"]["cpu"]
    others = swept["choices"][N_FRONT_QUESTIONS:]
    parts = [f"`{command}`, on {cpu}: {swept['head']}.", field(swept, "rows", "critical")]
    return "\n\n".join([*parts, _shown(others)] if others else parts)


def _shown(kept: list[Kept]) -> str:
    return "\n\n".join(titled(_table(one)) for one in kept) + "\n"


def relations_table(known: Kept) -> str:
    """Errors of the relations on real logs, a column for each log, with published errors."""
    columns: dict[str, dict[str, str]] = {}
    for key, runs in known.items():
        log, _, odometry = key.partition(", ")
        used = max(int(run["relations"]["used"]) for run in runs.values())
        cells = {label: _relation_cell(run) for label, run in runs.items()}
        for row in tables.published("relations", log) if odometry == "with odometry" else []:
            text = f"{row['translation_mean']:.4f} ± {row['translation_std']:.4f}"
            cells[f"published: {row['program']}"] = text
        columns[f"{key} ({used} relations)"] = cells
    ours = {name: k for k, name in enumerate(names())}
    labels = dict.fromkeys(label for cells in columns.values() for label in cells)
    order = sorted(labels, key=lambda label: ours.get(label, len(ours)))
    return markdown_table(pd.DataFrame(columns, index=order), "") + "\n"


def _relation_cell(run: Kept) -> str:
    if "all" not in run["relations"]:
        return "-"
    error = run["relations"]["all"]["translation_m"]
    lost = " (lost)" if run["loss"]["lost"] else ""
    return f"{error['mean']:.4f} ± {error['std']:.4f}{lost}{_start_words(run.get('starts'))}"


def _start_words(starts: Kept | None) -> str:
    """Over several start scans: mean and worst error, number of runs above the limit."""
    if not starts:
        return ""
    mean, worst = (
        "-" if starts[key] is None else f"{starts[key]:.4f}" for key in ("mean", "worst")
    )
    above = f"{starts['above']} above {starts['limit_m']:g}"
    return f"; {starts['n']} starts: mean {mean}, worst {worst}, {above}"


def public_table(found: Kept) -> str:
    """Size of the public logs, and the cost of each algorithm."""
    lines = {
        log["name"]: {
            "scans x beams": f"{log['scans']} x {log['beams']}",
            "lasts [s]": f"{log['duration_s']:.0f}",
            **{f"{label} [ms]": f"{cost:.1f}" for label, cost in log["cpu_ms"].items()},
        }
        for log in found["logs"]
    }
    made = markdown_table(pd.DataFrame.from_dict(lines, orient="index"), "log")
    return f"`{found['command']}`, CPU time of a scan on {found['cpu']}:\n\n{made}\n"
