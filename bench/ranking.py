"""python -m bench.ranking: do the published programs come out in the paper's order?

[Kuehn] found hector before tsd before crsm, in translation and in orientation, on one log. Here the
same programs run on several arenas and drives, with exact ranges and with those of stdr_simulator,
which come in steps of the map's cell.
"""

from __future__ import annotations

import argparse
import os
import sys
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slams import cli

if TYPE_CHECKING:
    import pandas as pd

PROGRAM = "bench.ranking"
FORMAT = "ranking-1"
KINDS = ("exact", "stdr")
MEASURES = {"translation": "translation_m", "orientation": "orientation_rad"}


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(prog=f"python -m {PROGRAM}", description=(__doc__ or "").partition("\n")[0])
    p.add_argument("--arenas", type=int, default=10, metavar="N", help="default: %(default)s")
    p.add_argument(
        "--duration", type=float, default=30.0, metavar="S", help="of each drive (%(default)g)"
    )
    cli.add_output_options(p, "results/ranking")
    processes = min(2, os.cpu_count() or 1)
    p.add_argument("--jobs", type=int, default=processes, metavar="N", help="processes")
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    cli.one_thread()
    return cli.run_command(PROGRAM, lambda: _command(parser().parse_args(argv)))


def _command(arguments: argparse.Namespace) -> int:
    from bench.results import write_figures
    from slams.formats import files

    cli.refusing(lambda: _check(arguments))
    found = _run_all(arguments)
    with files.complete_folder(arguments.out) as folder:
        write_figures(folder / "ranking.json", found)
        (folder / "ranking.md").write_text(as_markdown(found), encoding="utf-8")
    if not arguments.quiet:
        sys.stdout.write(f"{as_text(found)}\n{arguments.out}/: ranking.json, ranking.md\n")
    return 0


def _check(arguments: argparse.Namespace) -> None:
    for name in ("arenas", "jobs"):
        if getattr(arguments, name) < 1:
            raise ValueError(f"--{name}: got {getattr(arguments, name)}, expected 1 or more")
    if not 1.0 <= arguments.duration <= 3600.0:
        raise ValueError(f"--duration: got {arguments.duration}, expected 1 to 3600 s")
    if Path(arguments.out).is_file():
        raise NotADirectoryError(f"{arguments.out}: is a file; expected a folder for the results")


def paper_order() -> list[str]:
    """Labels of our versions of the paper's programs, best first in its Table I."""
    from bench.report.error_tables import published

    rows = [row for row in published("update") if row["ours"]]
    return [row["ours"] for row in sorted(rows, key=lambda row: float(row["translation_mean"]))]


def _run_all(arguments: argparse.Namespace) -> dict[str, Any]:
    from bench.run.pool import finished

    labels = paper_order()
    tasks = {
        (kind, seed): (run_arena, (kind, seed, arguments.duration, labels))
        for seed in range(arguments.arenas)
        for kind in KINDS
    }
    work = cli.progress(
        finished(tasks, arguments.jobs), len(tasks), "ranking", arguments.quiet, unit="arena"
    )
    found = {key: future.result() for key, future in work}
    arenas = [{"ranges": kind, "seed": seed, "runs": found[kind, seed]} for kind, seed in tasks]
    return {
        "format": FORMAT,
        "order": labels,
        "duration_s": arguments.duration,
        "arenas": arenas,
    }


def run_arena(kind: str, seed: int, duration: float, labels: list[str]) -> dict[str, Any]:
    """Mean and greatest error per update of each program in one arena, the laser alone."""
    from bench.judge import loss, metrics
    from bench.sim.setting import Setting
    from bench.sim.simulation import simulate
    from slams.player import replay
    from slams.registry import find

    exact = kind == "exact"
    setting = Setting(seed=seed, duration=duration, noise=0.0 if exact else None, stdr=not exact)
    log = simulate(setting).select(odometry=False)
    runs: dict[str, Any] = {}
    for label in labels:
        entry = find(label)
        run = replay(entry.cls(entry.params()), log)
        truth = log.truth_at(run.t)
        assert truth is not None, "simulated logs have a truth"
        common = metrics.common(run.t, run.poses, truth)
        errors = metrics.span_errors(common, metrics.SPANS[0])
        assert errors is not None, "a log of at least one second has updates"
        runs[label] = {
            "translation_m": float(errors.translation.mean()),
            "orientation_rad": float(errors.orientation.mean()),
            "lost": loss.by_truth(common)["lost"],
        }
    return runs


def counts(found: dict[str, Any], measure: str) -> pd.DataFrame:
    """A line per kind of ranges: mean errors, and in how many arenas the paper's order holds."""
    import pandas as pd

    key, order = MEASURES[measure], found["order"]
    unit = "mm" if key.endswith("_m") else "mrad"
    lines: dict[str, dict[str, Any]] = {}
    for kind in KINDS:
        runs = [arena["runs"] for arena in found["arenas"] if arena["ranges"] == kind]
        means = {label: sum(run[label][key] for run in runs) / len(runs) for label in order}
        line: dict[str, Any] = {f"{label} [{unit}]": 1e3 * means[label] for label in order}
        for a, b in pairwise(order):
            line[f"{_short(a)} before {_short(b)}"] = _count(runs, key, [a, b])
        line["the paper's order"] = _count(runs, key, order)
        line["lost runs"] = sum(run[label]["lost"] for run in runs for label in order)
        lines[f"{kind} ranges, {measure}"] = line
    return pd.DataFrame.from_dict(lines, orient="index")


def as_text(found: dict[str, Any]) -> str:
    """The tables for a terminal."""
    from bench.report.text import text_table

    return "\n\n".join(text_table(counts(found, measure), "log") for measure in MEASURES)


def as_markdown(found: dict[str, Any]) -> str:
    """The tables for the README."""
    from bench.report.text import markdown_table

    made = (markdown_table(counts(found, measure), "log") for measure in MEASURES)
    return "\n\n".join(made) + "\n"


def _short(label: str) -> str:
    return label.partition("@")[0]


def _count(runs: list[dict[str, Any]], key: str, order: list[str]) -> str:
    held = sum(all(run[a][key] < run[b][key] for a, b in pairwise(order)) for run in runs)
    return f"{held} of {len(runs)}"


if __name__ == "__main__":
    sys.exit(main())
