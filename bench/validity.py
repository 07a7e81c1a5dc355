"""python -m bench.validity: do the measures without a truth rank runs as the truth does?

Simulated drives under degraded conditions, each through all algorithms of a comparison; then the
rank correlation of each measure with the true errors, over the runs of each drive.
"""

from __future__ import annotations

import argparse
import os
import sys
from typing import TYPE_CHECKING, Any

from slams import cli

if TYPE_CHECKING:
    import pandas as pd

    from bench.results import LogResult, Rows

PROGRAM = "bench.validity"
FORMAT = "validity-1"
FIGURES = "validity.json"
# arena and condition of each drive; hard enough that the algorithms differ
DRIVES = (
    ("office", "beams=45"),
    ("rescue", "noise=0.05"),
    ("office", "range=4"),
    ("hall", "people=20"),
    ("rescue", "poor_lidar=1"),
    ("hall", "beams=45"),
    ("office", "speed=4"),
    ("rescue", "short=50"),
    ("hall", "noise=0.05"),
    ("office", "clean"),
)
FIRST_SEED, DURATION, EVERY = 20, 120.0, 4  # no seed of the sweep; [s]; every 4th of 40 scans a s


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(prog=f"python -m {PROGRAM}", description=(__doc__ or "").partition("\n")[0])
    p.add_argument(
        "--drives", type=int, default=len(DRIVES), metavar="N", help="only N (%(default)s)"
    )
    cli.add_output_options(p, "results/validity")
    p.add_argument(
        "--jobs",
        type=int,
        default=min(2, os.cpu_count() or 1),
        metavar="N",
        help="processes at a time (%(default)s)",
    )
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    cli.one_thread()
    return cli.run_command(PROGRAM, lambda: _command(parser().parse_args(argv)))


def _command(arguments: argparse.Namespace) -> int:
    from bench.report.text import text_table
    from bench.results import write_figures
    from slams.formats import files

    cli.refusing(lambda: _check(arguments))
    found = {"format": FORMAT, "runs": _run_all(arguments)}
    with files.complete_folder(arguments.out) as folder:
        write_figures(folder / FIGURES, found)
    if not arguments.quiet:
        sys.stdout.write(f"{text_table(table(found), 'measure')}\n{arguments.out}/{FIGURES}\n")
    return 0


def _check(arguments: argparse.Namespace) -> None:
    for name, most in (("drives", len(DRIVES)), ("jobs", 64)):
        value = getattr(arguments, name)
        if not 1 <= value <= most:
            raise ValueError(f"--{name}: got {value}, expected 1 to {most}")


def _run_all(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """The measures and the errors of every run."""
    from bench.judge.comparison import weighed
    from bench.run.cases import Choice
    from bench.run.compare_options import labels_of
    from bench.run.compare_options import parser as compare_parser
    from bench.run.comparing import Wanted, Work, compared
    from bench.sim.degrade import degrade, parse
    from bench.sim.setting import Setting
    from bench.sim.simulation import simulate

    logs = []
    for k, (arena, condition) in enumerate(DRIVES[: arguments.drives]):
        entry, level = parse(condition)
        seed = FIRST_SEED + k
        log = simulate(Setting(arena=arena, seed=seed, duration=DURATION))
        logs.append(degrade(log, entry.name, level, seed).select(every=EVERY))
    labels = labels_of(compare_parser().parse_args([]))
    done = compared(labels, logs, Choice(), Wanted(), Work(arguments.jobs, arguments.quiet))
    conditions = [f"{arena}, {condition}" for arena, condition in DRIVES]
    every = zip(conditions, weighed(done, {}).logs, strict=False)
    return [line for condition, log in every for line in _lines(condition, log)]


def _lines(condition: str, log: LogResult) -> list[dict[str, Any]]:
    from bench.report import unaided
    from bench.report.lines import deciding_error

    rows: Rows = [row for row in log.rows if not row["failed"] and row["errors"]]
    found = unaided.measures(rows)
    return [
        {
            "drive": condition,
            "algorithm": row["algorithm"],
            "ate_m": row["errors"]["ate_m"] if row["errors"] else None,
            "second_m": deciding_error(row),
            "measures": found[row["algorithm"]],
        }
        for row in rows
    ]


def table(found: dict[str, Any]) -> pd.DataFrame:
    """Of each measure Spearman's rank correlation with the errors, mean over the drives."""
    import pandas as pd

    from bench.report.unaided import MEASURES

    lines = {}
    for measure in MEASURES:
        runs = [run for run in found["runs"] if run["measures"][measure] is not None]
        lines[measure] = {
            "runs": len(runs),
            "with ATE": _correlation(runs, measure, "ate_m"),
            "with error over 1 s": _correlation(runs, measure, "second_m"),
        }
    return pd.DataFrame.from_dict(lines, orient="index")


def _correlation(runs: list[dict[str, Any]], measure: str, error: str) -> float | None:
    """Mean over the drives with at least four runs that differ."""
    import numpy as np
    from scipy.stats import spearmanr

    drives: dict[str, list[tuple[float, float]]] = {}
    for run in runs:
        drives.setdefault(run["drive"], []).append((run["measures"][measure], run[error]))
    columns = [np.array(pairs).T for pairs in drives.values() if len(pairs) > 3]
    found = [float(spearmanr(*pair)[0]) for pair in columns if np.ptp(pair[0]) > 0.0]
    return float(np.mean(found)) if found else None


if __name__ == "__main__":
    sys.exit(main())
