"""python -m bench.soak: what hours of work do to an algorithm: time per scan, memory, error.

Half a million scans at rest, and three kilometers through a large office floor.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slams import cli
from slams.registry import BASELINES, names

if TYPE_CHECKING:
    from bench.run.store import Store
    from slams.scanlog import ScanLog

PROGRAM = "bench.soak"
FORMAT = "soak-1"
SCANS, LENGTH, SIZE = 500_000, 3000.0, 180.0  # at rest; [m] of the way; [m] of the floor
SENSOR, SPEED = "rplidar-a1", 1.0  # 360 beams, 5.5 Hz; [m/s]


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog=f"python -m {PROGRAM}",
        description="Run algorithms for long: many scans at rest, and a long way through a large "
        "office floor; time per scan and memory at the beginning and at the end.",
        epilog="Writes soak.json and soak.md, and runs/, from which it goes on if ended. With all "
        "defaults at most 20 minutes on two cores.",
    )
    p.add_argument("--algorithms", metavar="NAME", nargs="+", help="default: all but baselines")
    p.add_argument(
        "--rest", type=int, default=SCANS, metavar="N", help="scans at rest (%(default)s); 0: none"
    )
    p.add_argument(
        "--length",
        type=float,
        default=LENGTH,
        metavar="M",
        help="of the way (%(default)g); 0: none",
    )
    p.add_argument(
        "--size", type=float, default=SIZE, metavar="M", help="of the floor (%(default)g)"
    )
    p.add_argument("--log", metavar="LOG", help="a long log with a truth, instead of simulating")
    p.add_argument("--out", metavar="DIR", help="default: results/soak, -LOG behind")
    p.add_argument("--force", action="store_true", help="replace the results of another log")
    p.add_argument("-q", "--quiet", action="store_true", help="no progress, no tables")
    p.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (%(default)s)")
    cli.add_log_options(p)
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    cli.one_thread()
    return cli.run_command(PROGRAM, lambda: _command(parser().parse_args(argv)))


def _command(arguments: argparse.Namespace) -> int:
    from bench.report.soak_tables import as_markdown, as_text
    from bench.results import write_figures
    from bench.run.folder import default
    from bench.run.store import Store
    from slams.formats import files

    if arguments.out is None:
        arguments.out = str(default("soak", [arguments.log] if arguments.log else []))
    labels, log = cli.refusing(lambda: _checked(arguments))
    store = cli.refusing(lambda: Store(Path(arguments.out) / "runs"))
    found = _run_all(labels, log, store, arguments)
    with files.complete_folder(arguments.out) as folder:
        write_figures(folder / "soak.json", found)
        (folder / "soak.md").write_text(as_markdown(found), encoding="utf-8")
    if not arguments.quiet:
        sys.stdout.write(f"{as_text(found)}\n{arguments.out}/: soak.json, soak.md\n")
    return cli.FAILED if found["failed"] else 0


def _checked(arguments: argparse.Namespace) -> tuple[list[str], ScanLog | None]:
    """The algorithms, and the log of the long way where one is given."""
    from slams import load
    from slams.formats import files
    from slams.registry import find

    limits = {"rest": (0, 10**8), "length": (0.0, 5000.0), "jobs": (1, 64)}
    for name, (low, high) in limits.items():
        value = getattr(arguments, name)
        if not low <= value <= high:
            raise ValueError(f"--{name}: got {value:g}, expected {low:g} to {high:g}")
    labels = arguments.algorithms or [name for name in names() if name not in BASELINES]
    for label in labels:
        find(label)
    files.check_folder(arguments.out)
    if not arguments.log:
        log = _simulated(arguments) if arguments.length else None
    else:
        log = load(arguments.log, cli.log_options(arguments)).of_one_laser()
        if log.truth is None:
            raise ValueError(f"{arguments.log}: has no truth; expected one (--truth FILE)")
    _check_other_log(arguments, log)
    return labels, log


def _check_other_log(arguments: argparse.Namespace, log: ScanLog | None) -> None:
    """Results of one log go on where they were; those of another are not overwritten."""
    from bench.results import read_figures

    path = Path(arguments.out) / "soak.json"
    if arguments.force or not path.exists():
        return
    known, name = read_figures(path, FORMAT)["log"], None if log is None else log.name
    if known is not None and name is not None and known != name:
        raise FileExistsError(
            f"{arguments.out}: has results of {known}; expected another --out, or --force"
        )


def _simulated(arguments: argparse.Namespace) -> ScanLog:
    from bench.sim.setting import Setting
    from bench.sim.simulation import simulate

    return simulate(
        Setting("office", size=arguments.size, length=arguments.length, sensor=SENSOR, v=SPEED)
    )


def _run_all(
    labels: list[str], log: ScanLog | None, store: Store, arguments: argparse.Namespace
) -> dict[str, Any]:
    """Every run in a process of its own, as its memory is; those in the store are done already."""
    from bench.run import soaking, timing
    from bench.run.local import LocalWorkers
    from bench.run.work import run_all
    from slams.summary import versions

    machine = timing.machine() | {"processes": arguments.jobs}
    tasks = soaking.tasks(labels, log, arguments.rest, machine)
    keys = {task: key for key, task in tasks.items()}
    store.tell_kept(PROGRAM, {task.key for task in keys}, arguments.quiet)
    work = run_all(keys, store, LocalWorkers(arguments.jobs, fresh=True))
    shown = cli.progress(work, len(tasks), "soaking", arguments.quiet, unit="run")
    found = {keys[task]: {"algorithm": keys[task][1]} | row for task, row in shown}
    return {
        "format": FORMAT,
        "way": [found["way", label] for label in labels if ("way", label) in found],
        "rest": [found["rest", label] for label in labels if ("rest", label) in found],
        "failed": sum("failed" in row for row in found.values()),
        "log": None if log is None else log.name,
        "machine": machine,
        "versions": versions(),
    }


if __name__ == "__main__":
    sys.exit(main())
