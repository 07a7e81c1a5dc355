"""python -m bench.compare: every algorithm over the same scan logs, in the paper's tables.

M. Kuehn, R. Koch, H. Fees, S. May: Benchmarking the pose accuracy of different SLAM approaches for
rescue robotics [Kuehn].
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slams import cli
from slams.params import LASERS
from slams.registry import names

if TYPE_CHECKING:
    from bench.results import Comparison, Outcome
    from bench.run.cases import Choice
    from slams.scanlog import ScanLog
    from slams.types import Floats

PROGRAM = "bench.compare"
IDEA, ORIGINAL = "paper", "original"  # presets compared beside the defaults
DURATION, QUICK_DURATION = 300.0, 60.0  # s of the simulated log
QUICK_SCANS = 2400


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog=f"python -m {PROGRAM}",
        description="Replay scan logs through SLAM algorithms and compare their pose errors. "
        "Without a log: a simulated rescue maze, UTM-30LX, five minutes.",
        epilog="Writes report.html, results.json, tables as csv, markdown and LaTeX, errors per "
        "update as csv, trajectories, figures as png and pdf.",
    )
    p.add_argument("logs", nargs="*", metavar="LOG", help="scan logs; default: simulate one")
    p.add_argument(
        "--algorithms",
        metavar="NAME",
        nargs="+",
        help=f"name, name@preset or module:Class; default: {' '.join(names())}, and NAME@{IDEA} "
        "of each that has one",
    )
    p.add_argument("--out", metavar="DIR", default="results/compare", help="default: %(default)s")
    size = p.add_mutually_exclusive_group()
    size.add_argument("--quick", action="store_true", help="a minute of the log only")
    size.add_argument(
        "--full", action="store_true", help="the originals as well, the published tables beside"
    )
    p.add_argument("--relations", metavar="FILE", help="Freiburg relations of the one log")
    p.add_argument(
        "--starts",
        type=int,
        default=1,
        metavar="N",
        help="with --relations: also begin at N scans of the log, to tell luck from skill",
    )
    p.add_argument(
        "--trajectory",
        metavar="NAME=WHAT",
        action="append",
        default=[],
        help="another program's run as a row: a TUM or csv file, result.mcap, or a topic or tf "
        "frame of the log's bag; may be given again",
    )
    p.add_argument(
        "--map",
        metavar="NAME=FILE",
        action="append",
        default=[],
        help="the map that goes with it: a map_server yaml",
    )
    p.add_argument("--sensor", metavar="NAME", help=f"what changes for {', '.join(LASERS)}")
    p.add_argument(
        "--ros-params",
        metavar="ALGORITHM=FILE",
        action="append",
        default=[],
        help="launch or parameter file of the original's ROS node; may be given again",
    )
    p.add_argument("--no-odometry", action="store_true", help="hide odometry and gyro")
    p.add_argument("--limit", type=int, metavar="N", help="only N scans")
    p.add_argument("--every", type=int, default=1, metavar="K", help="only every K-th scan")
    p.add_argument("--seed", type=int, metavar="N", help="of the simulation and the algorithms")
    p.add_argument("--duration", type=float, metavar="S", help="of the simulation")
    p.add_argument(
        "--realtime",
        action="store_true",
        help="also replay as a live node sees the log: scans that come too fast are dropped",
    )
    p.add_argument(
        "--slower",
        type=float,
        default=5.0,
        metavar="X",
        help="how many times slower than this machine's the robot's core is (default %(default)g)",
    )
    p.add_argument("--mcap", action="store_true", help="also write NAME.mcap of every run")
    p.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1), metavar="N")
    p.add_argument("-q", "--quiet", action="store_true", help="no progress, no tables")
    cli.add_log_options(p)
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    cli.one_thread()
    words = sys.argv[1:] if argv is None else argv

    def _work() -> int:
        arguments = parser().parse_args(words)
        arguments.words = words
        return _command(arguments)

    return cli.run_command(PROGRAM, _work)


def _command(arguments: argparse.Namespace) -> int:
    from bench.judge.comparison import weighed
    from bench.report import text
    from bench.run import ros_files
    from bench.run.comparing import Wanted, run_all
    from slams.formats import files

    labels = cli.refusing(lambda: _labels(arguments))
    choice, relations, logs = cli.refusing(lambda: _checked(arguments, labels))
    others = cli.refusing(lambda: _others(arguments, labels, logs, choice, relations))
    ros_files.say(choice.ros, arguments.quiet)
    with files.complete_folder(arguments.out) as folder:
        logs = logs or [cli.refusing(lambda: simulated(folder, choice, arguments))]
        wanted = Wanted(relations, arguments.starts)
        found = run_all(labels, logs, choice, wanted, arguments.jobs, arguments.quiet)
        found = [log._replace(outcomes=[*log.outcomes, *others]) for log in found]
        comparison = weighed(found, _facts(choice, arguments))
        _write(folder, comparison, logs, arguments.mcap)
    if not arguments.quiet:
        report = Path(arguments.out) / "report.html"
        more = f"The report: {report}; tables, figures and results.json beside it."
        sys.stdout.write(f"{text.terminal(comparison)}\n{more}\n")
    return cli.FAILED if all(row["failed"] for row in comparison.rows) else 0


def _others(
    arguments: argparse.Namespace,
    labels: list[str],
    logs: list[ScanLog],
    choice: Choice,
    relations: Floats | None,
) -> list[Outcome]:
    """The rows of other programs; their trajectories are of the one log."""
    from bench.run.foreign import foreign_case, read_foreign

    given = arguments.trajectory, arguments.map
    if any(given) and len(logs) != 1:
        raise ValueError(f"--trajectory: got {len(logs)} logs, expected the one it is of")
    if not any(given):
        return []
    found = read_foreign(*given, labels, arguments.logs[0], choice.options)
    return [foreign_case(foreign, logs[0], relations) for foreign in found]


def _facts(choice: Choice, arguments: argparse.Namespace) -> dict[str, Any]:
    """How the comparison was made: command, machine, versions."""
    from bench.run import ros_files, timing
    from slams.summary import versions

    return {
        "command": f"python -m {PROGRAM} {shlex.join(arguments.words)}".strip(),
        "odometry": choice.odometry,
        "slower": choice.slower,
        "ros_params": {label: ros_files.record(taken) for label, taken in choice.ros.items()},
        "versions": versions(),
        "machine": timing.machine() | {"processes": arguments.jobs},
    }


def _write(folder: Path, comparison: Comparison, logs: list[ScanLog], mcap: bool) -> None:
    """The results first, then everything that is drawn from them."""
    from bench import results
    from bench.report import outputs
    from slams.formats.mcap import write_mcap

    results.save(folder, comparison)
    outputs.write(folder, comparison)
    for k, log in enumerate(logs if mcap else []):
        place = outputs.place_of(folder, comparison, k)
        for outcome in comparison.logs[k].outcomes:
            if outcome.grid is not None and len(outcome.t) == len(log):
                name = outputs.file_name(outcome.row["algorithm"])
                write_mcap(place / f"{name}.mcap", log, outcome.poses, outcome.grid)


def _labels(arguments: argparse.Namespace) -> list[str]:
    """The algorithms asked for; else all, their ideas alone, and with --full the originals."""
    from slams.registry import find

    if arguments.algorithms:
        return list(arguments.algorithms)
    presets = [ORIGINAL, IDEA] if arguments.full else [IDEA]
    known = {name: find(name).cls.Params.PRESETS for name in names()}
    others = [f"{name}@{preset}" for preset in presets for name in known if preset in known[name]]
    return others + list(known)


def _checked(
    arguments: argparse.Namespace, labels: list[str]
) -> tuple[Choice, Floats | None, list[ScanLog]]:
    """Everything the user gave, read once before the work starts."""
    from bench.run.cases import read_relations

    _check_options(arguments)
    choice = _choice(arguments, labels)
    logs = [choice.log(path) for path in arguments.logs]
    if arguments.relations is None:
        return choice, None, logs
    if len(arguments.logs) != 1:
        raise ValueError(
            f"--relations: got {len(arguments.logs)} logs, expected the one they are of"
        )
    return choice, read_relations(arguments.relations), logs


def _check_options(arguments: argparse.Namespace) -> None:
    if arguments.starts > 1 and arguments.relations is None:
        raise ValueError("--starts: expected --relations FILE as well, errors are of those")
    for name in ("limit", "every", "jobs", "starts"):
        value = getattr(arguments, name)
        if value is not None and value < 1:
            raise ValueError(f"--{name}: got {value}, expected 1 or more")
    if not 0.0 < arguments.slower < 1e6:
        raise ValueError(f"--slower: got {arguments.slower}, expected a factor above 0")
    out = Path(arguments.out)
    if out.exists() and not out.is_dir():
        raise NotADirectoryError(f"{out}: is a file; expected a folder for the results")


def _choice(arguments: argparse.Namespace, labels: list[str]) -> Choice:
    """What the options say of logs and parameters; every algorithm can be run with it."""
    from bench.run import ros_files
    from bench.run.cases import Choice
    from slams.registry import find

    choice = Choice(
        arguments.limit or (QUICK_SCANS if arguments.quick else None),
        arguments.every,
        not arguments.no_odometry,
        arguments.seed,
        arguments.realtime,
        arguments.slower,
        cli.log_options(arguments),
        arguments.sensor,
    )
    choice = replace(choice, ros=ros_files.taken(arguments.ros_params, labels, choice))
    for label in labels:
        choice.params(find(label))
    return choice


def simulated(folder: Path, choice: Choice, arguments: argparse.Namespace) -> ScanLog:
    """The paper's data set, simulated and kept in `folder`: rescue maze, UTM-30LX, five minutes."""
    from bench.sim.setting import Setting
    from bench.sim.simulation import simulate

    duration = arguments.duration
    if duration is None:
        duration = QUICK_DURATION if arguments.quick else DURATION
    log = simulate(Setting(seed=arguments.seed or 0, duration=duration))
    log.save(folder / f"{log.name}.npz")
    return log.select(choice.limit, choice.every, choice.odometry)


if __name__ == "__main__":
    sys.exit(main())
