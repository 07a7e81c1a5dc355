"""slams sweep: robustness of the algorithms over arenas, degradations and seeds."""

from __future__ import annotations

import argparse
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.run import options, single
from bench.run.options import within
from bench.sim.setting import ARENAS
from slams import cli
from slams.registry import BASELINES, names

if TYPE_CHECKING:
    from bench.judge.answers import Analysis
    from bench.results.sweep import Sweep
    from bench.run.plan import Case, Plan
    from bench.run.store import Store

# of a sweep by default; bench.sim.degrade has all
DEFAULT_DEGRADATIONS = (
    *("clean", "rate", "beams", "fov", "range", "noise", "short", "people", "glass", "blind"),
    *("speed", "slip", "jump", "poor_lidar"),
)
QUICK_DEGRADATIONS = ("clean", "beams", "people")
ROW_PRESETS = ("", "paper", "original")  # of each algorithm: default, idea, published program
N_DRIVES, N_QUICK_DRIVES = 10, 5  # in each arena
DRIVE_DURATION, SCAN_RATE = 20.0, 10.0  # s of each simulated drive, Hz
# files of sweeps and ablations
OUTPUT_FILES = (
    *("sweep.json", "costs.json", "report.html", "table-*.csv", "survival.csv"),
    *("fig_sweep.png", "fig_survival-*.png", "ablation.md", "ablation.csv"),
)


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams sweep",
        description="Degrade logs level by level until each run is lost, and print which algorithm "
        "to take. Without a log it simulates ten drives in each arena and takes hours; with "
        "--quick it takes some minutes.",
        epilog="Writes report.html, sweep.json, tables as csv. Finished runs are kept "
        "in OUT/runs: an interrupted sweep continues from them.",
    )
    p.add_argument("logs", nargs="*", metavar="LOG", help="logs with a truth (default: simulate)")
    p.add_argument(
        "--algorithms",
        metavar="NAME",
        nargs="+",
        help=f"{single.LABEL_WORDS} as a row of its own "
        "(default: all but the baselines, and without --quick their presets @paper and @original)",
    )
    single.add_options(p)
    add_drive_options(p)
    p.add_argument(
        "--sensor",
        metavar="NAME",
        default="utm30lx",
        help="laser of the simulated drives (default: %(default)s)",
    )
    p.add_argument(
        "--odometry",
        choices=("both", "with", "without"),
        default="both",
        help="run with wheels and gyro, without them, or both (default: %(default)s)",
    )
    p.add_argument("--quick", action="store_true", help="fewer degradations, drives and rows")
    options.add_output(p, "sweep-LOG, without a log results/sweep")
    options.add_jobs(p)
    cli.add_log_options(p)
    return p


def add_drive_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of drives and degradations."""
    parser.add_argument(
        "--degradations",
        metavar="NAME[=LEVEL]",
        nargs="+",
        help="degradations at all levels, or at one (noise=0.05); all: every degradation; list: "
        "print them with their levels",
    )
    parser.add_argument(
        "--arenas", metavar="NAME", nargs="+", help=f"arenas, of {', '.join(ARENAS)}"
    )
    parser.add_argument(
        "--seeds", type=within(int, 1, 1000), metavar="N", help="number of drives in each arena"
    )
    parser.add_argument(
        "--seed",
        type=within(int, 0, 10**9),
        metavar="N",
        default=0,
        help="seed of the first drive; the others count up from it (default: %(default)s)",
    )
    parser.add_argument(
        "--duration",
        type=within(float, 2.0, 14400.0),
        metavar="S",
        help=f"length of each simulated drive [s] (default: {DRIVE_DURATION:g})",
    )
    parser.add_argument(
        "--rate",
        type=within(float, 0.0, 1000.0),
        metavar="HZ",
        default=SCAN_RATE,
        help="scans per second at most, 0 for all (default: %(default)g)",
    )


def listed() -> str:
    """Every degradation with its unit, meaning and levels."""
    from bench.sim.degrade import CATALOG

    lines = []
    for entry in CATALOG.values():
        levels = ", ".join(f"{level:g}" for level in entry.levels)
        lines.append(f"{entry.name} [{entry.unit}]: {entry.meaning}\n    {levels}\n")
    return "".join(lines)


def _command(arguments: argparse.Namespace) -> int:
    from bench.report import sweep_tables
    from bench.results import sweep as results
    from bench.run import folder as folders
    from slams.formats import files

    if arguments.degradations == ["list"]:
        sys.stdout.write(listed())
        return 0
    place = Path(arguments.out or folders.named_after("sweep", arguments.logs))
    found = swept(arguments, place)
    with files.complete_folder(place) as folder:
        results.save(folder, found)
        analyzed = write(folder, found)
        folders.cleared(place, OUTPUT_FILES)
    if not arguments.quiet:
        screen = sweep_tables.terminal(analyzed, found.facts)
        sys.stdout.write(f"{screen}\n\n{place}/: report.html, sweep.json, tables\n")
    return cli.EXIT_FAILED if all(trial["failed"] for trial in found.trials) else 0


def write(folder: Path, found: Sweep) -> Analysis:
    """Write all files except the results; returns the analysis."""
    from bench.judge.answers import analysis
    from bench.report import sweep_figure, sweep_tables
    from bench.report.html import sweep_page
    from bench.report.text import write_csv

    analyzed = analysis(found)
    write_csv(folder, sweep_tables.tables(analyzed, found.facts))
    sweep_tables.curve_table(analyzed).to_csv(folder / "survival.csv", index=False)
    sweep_figure.draw(found, analyzed, folder / "fig_sweep.png")
    sweep_figure.draw_survival(analyzed, found.facts["units"], folder)
    sweep_page.write(folder, found, analyzed)
    return analyzed


def swept(arguments: argparse.Namespace, place: Path) -> Sweep:
    """All trials of a command, computed now or kept from before in the folder `place`."""
    from bench.run import timing
    from bench.run.store import Store

    plan = cli.refusing(lambda: _plan(arguments))
    cli.refusing(lambda: _check_place(place, plan, arguments.force))
    store = cli.refusing(lambda: Store(place / "runs"))
    cases = plan.cases(place / "logs")
    done = _do(cases, store, arguments)
    return plan.gathered(cases, done, store, timing.record(arguments))


def _check_place(folder: Path, plan: Plan, force: bool) -> None:
    """Refuse a folder that cannot be written, has files but no runs, or another sweep's results."""
    from bench.results import sweep as results
    from bench.run.store import plain
    from slams.formats.files import check_folder

    check_folder(folder)
    if folder.is_dir() and any(folder.iterdir()) and not (folder / "runs").is_dir():
        raise FileExistsError(f"{folder}: has files that are not of a sweep; expected a new folder")
    if (folder / results.TRIALS_FILE).exists() and not force:
        with suppress(OSError, ValueError):
            if results.read(folder).facts == plain(plan.facts()):
                return
        raise FileExistsError(f"{folder}: has other results; expected another --out, or --force")


def _plan(arguments: argparse.Namespace) -> Plan:
    """The plan of a command, read and checked before the work starts."""
    from bench.run import plan

    for name in ("arenas", "duration"):
        if arguments.logs and getattr(arguments, name) is not None:
            raise ValueError(f"--{name}: only for simulated drives; got {arguments.logs[0]}")
    quick = arguments.quick
    chosen = arguments.degradations or list(QUICK_DEGRADATIONS if quick else DEFAULT_DEGRADATIONS)
    seeds = arguments.seeds or (N_QUICK_DRIVES if quick else N_DRIVES)
    arenas = list(dict.fromkeys(arguments.arenas or ARENAS))
    duration = arguments.duration or DRIVE_DURATION
    simulated = plan.Drives(arenas, seeds, duration, arguments.sensor, arguments.seed)
    known = [name for name in names() if name not in BASELINES]
    presets = ROW_PRESETS[: 1 if quick else 3]
    algorithms = list(dict.fromkeys(arguments.algorithms or single.with_presets(known, presets)))
    return plan.Plan(
        algorithms=algorithms,
        conditions=plan.conditions_of(chosen),
        logs=plan.logs_of(arguments.logs, simulated, cli.log_options(arguments)),
        odometry={"both": (False, True), "with": (True,), "without": (False,)}[arguments.odometry],
        rate=arguments.rate or None,
        sensor=None if arguments.sensor == "utm30lx" else arguments.sensor,
        single=single.singles(algorithms, arguments.params, arguments.changes),
    )


def _do(cases: list[Case], store: Store, arguments: argparse.Namespace) -> dict[str, Any]:
    """Run the climbs without kept results; their results by key."""
    from bench.run import work

    todo = [case for case in cases if store.read(case.task.key) is None]
    tasks = {case.task.key: case.task for case in todo}
    if not arguments.quiet:
        sys.stderr.write(
            f"{arguments.program}: {len(cases)} runs, {len(cases) - len(todo)} kept from before, "
            f"{len(tasks)} to do\n"
        )
    done = work.run_all(tasks, store, arguments.jobs)
    return dict(cli.progress(done, len(tasks), "sweeping", arguments.quiet, unit="climb"))


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
