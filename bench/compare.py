"""python -m bench.compare: every algorithm over the same scan logs, in the paper's tables.

M. Kuehn, R. Koch, H. Fees, S. May: Benchmarking the pose accuracy of different SLAM approaches for
rescue robotics [Kuehn].
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from slams import cli
from slams.registry import names

if TYPE_CHECKING:
    from bench.cases import Choice, Outcome
    from slams.types import Floats

PROGRAM = "bench.compare"
FORMAT = "results-1"


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog=f"python -m {PROGRAM}",
        description="Replay scan logs through SLAM algorithms and compare their pose errors. "
        "Without a log: a simulated rescue maze, UTM-30LX, five minutes.",
        epilog="Writes results.json, tables as csv and markdown, errors per update as csv, "
        "histograms and maps as png.",
    )
    p.add_argument("logs", nargs="*", metavar="LOG.npz", help="scan logs; default: simulate one")
    p.add_argument(
        "--algorithms",
        metavar="NAME",
        nargs="+",
        default=names(),
        help=f"name, name@preset or module:Class; default: {' '.join(names())}",
    )
    p.add_argument("--out", metavar="DIR", default="results/compare", help="default: %(default)s")
    p.add_argument("--relations", metavar="FILE", help="Freiburg relations of the one log")
    p.add_argument("--no-odometry", action="store_true", help="hide odometry and gyro")
    p.add_argument("--limit", type=int, metavar="N", help="only N scans")
    p.add_argument("--every", type=int, default=1, metavar="K", help="only every K-th scan")
    p.add_argument("--seed", type=int, metavar="N", help="of the simulation and the algorithms")
    p.add_argument("--duration", type=float, default=300.0, metavar="S", help="of the simulation")
    p.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1), metavar="N")
    p.add_argument("-q", "--quiet", action="store_true", help="no progress, no tables")
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    cli.one_thread()
    return cli.run_command(PROGRAM, lambda: _command(parser().parse_args(argv)))


class Job(NamedTuple):
    """One algorithm on one log."""

    label: str
    path: str


def _command(arguments: argparse.Namespace) -> int:
    from slams.formats import files

    choice, relations = cli.refusing(lambda: _checked(arguments))
    logs = [Path(path) for path in arguments.logs]
    with files.complete_folder(arguments.out) as folder:
        if not logs:
            logs = [cli.refusing(lambda: simulated(folder, arguments))]
        outcomes = _run_all(arguments, logs, choice, relations)
        text = write(folder, outcomes, [choice.log(path) for path in logs], arguments)
    if not arguments.quiet:
        sys.stdout.write(text + f"\n{arguments.out}/: results.json, tables and figures\n")
    return cli.FAILED if all(o.row["failed"] for o in outcomes) else 0


def _checked(arguments: argparse.Namespace) -> tuple[Choice, Floats | None]:
    """Everything the user gave, read once before the work starts."""
    from bench.cases import Choice, read_relations
    from slams.registry import find

    for name in ("limit", "every", "jobs"):
        value = getattr(arguments, name)
        if value is not None and value < 1:
            raise ValueError(f"--{name}: got {value}, expected 1 or more")
    out = Path(arguments.out)
    if out.exists() and not out.is_dir():
        raise NotADirectoryError(f"{out}: is a file; expected a folder for the results")
    for label in arguments.algorithms:
        find(label).params()
    choice = Choice(arguments.limit, arguments.every, not arguments.no_odometry, arguments.seed)
    for path in arguments.logs:
        choice.log(path)
    if arguments.relations is None:
        return choice, None
    if len(arguments.logs) != 1:
        raise ValueError(
            f"--relations: got {len(arguments.logs)} logs, expected the one they are of"
        )
    return choice, read_relations(arguments.relations)


def simulated(folder: Path, arguments: argparse.Namespace) -> Path:
    """The paper's data set, simulated into `folder`: rescue maze, UTM-30LX, five minutes."""
    from bench.setting import Setting
    from bench.simulation import simulate

    log = simulate(Setting(seed=arguments.seed or 0, duration=arguments.duration))
    path = folder / f"{log.name}.npz"
    log.save(path)
    return path


def _run_all(
    arguments: argparse.Namespace, logs: list[Path], choice: Choice, relations: Floats | None
) -> list[Outcome]:
    """All cases in processes of their own, in the order asked for."""
    jobs = [Job(label, str(path)) for path in logs for label in arguments.algorithms]
    done: dict[Job, Outcome] = {}
    for job, outcome in cli.progress(
        _outcomes(jobs, arguments.jobs, choice, relations),
        total=len(jobs),
        what="comparing",
        quiet=arguments.quiet,
        unit="run",
    ):
        done[job] = outcome
    return [done[job] for job in jobs]


def _outcomes(
    jobs: list[Job], workers: int, choice: Choice, relations: Floats | None
) -> Iterator[tuple[Job, Outcome]]:
    """Cases as they end. Spawned, not forked: threads of libraries do not survive a fork."""
    import multiprocessing

    from bench.cases import run_case

    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(jobs)), mp_context=context) as pool:
        # the last first: the baselines are slow, and a long case must not begin at the end
        futures = {
            pool.submit(run_case, job.label, job.path, choice, relations): job
            for job in reversed(jobs)
        }
        for future in as_completed(futures):
            yield futures[future], future.result()


def write(
    folder: Path, outcomes: list[Outcome], logs: list[Any], arguments: argparse.Namespace
) -> str:
    """Write results.json, tables, errors and figures; returns the tables as text."""
    from bench import cases, report

    results = {
        "format": FORMAT,
        "odometry": not arguments.no_odometry,
        "logs": [_log_entry(log) for log in logs],
        "rows": [outcome.row for outcome in outcomes],
    }
    cases.write_results(folder / "results.json", results)
    texts = []
    per_log = len(outcomes) // len(logs)
    for k, log in enumerate(logs):
        part = outcomes[k * per_log : (k + 1) * per_log]
        place = folder if len(logs) == 1 else folder / f"{k + 1}-{log.name}"
        place.mkdir(exist_ok=True)
        rows = [outcome.row for outcome in part]
        report.write_csv(place, rows)
        (place / "tables.md").write_text(
            report.as_markdown(_log_entry(log), rows), encoding="utf-8"
        )
        _write_runs(place, part)
        _draw(place, part, log)
        texts.append(report.as_text(_log_entry(log), rows))
    return "\n\n".join(texts)


def _log_entry(log: Any) -> dict[str, Any]:
    return {
        "name": log.name,
        "scans": len(log),
        "beams": log.laser.n_beams,
        "duration_s": float(log.t.max() - log.t.min()),
        "meta": log.meta,
    }


def _write_runs(folder: Path, outcomes: list[Outcome]) -> None:
    """Errors per update and trajectory of each run."""
    from bench import report
    from slams.formats import trajectory

    for outcome in outcomes:
        name = file_name(outcome.row["algorithm"])
        if outcome.errors is not None:
            report.write_errors(folder / f"errors-{name}.csv", outcome.errors)
        if len(outcome.t):
            trajectory.write_tum(folder / f"trajectory-{name}.tum", outcome.t, outcome.poses)


def _draw(folder: Path, outcomes: list[Outcome], log: Any) -> None:
    """The paper's figures, as far as the log has a truth and the runs did not fail."""
    from bench import figures
    from slams import metrics

    errors = {o.row["algorithm"]: o.errors for o in outcomes if o.errors is not None}
    if errors:
        translation = {name: e.translation for name, e in errors.items()}
        orientation = {name: e.orientation for name, e in errors.items()}
        figures.histograms(translation, "translation", folder / "fig2_translation.png")
        figures.histograms(orientation, "orientation", folder / "fig3_orientation.png")
    grids = {o.row["algorithm"]: o.grid for o in outcomes if o.grid is not None}
    if grids:
        paths = {o.row["algorithm"]: o.poses for o in outcomes}
        truth = log.truth_at(log.t)
        if truth is not None:
            covered = truth[~(truth != truth).any(axis=1)]
            truth = metrics.from_first(covered) if len(covered) else None
        figures.maps(grids, paths, truth, folder / "fig4_maps.png")


def file_name(label: str) -> str:
    """A label as part of a file's name."""
    return label.replace(":", ".").replace("@", "-")


if __name__ == "__main__":
    sys.exit(main())
