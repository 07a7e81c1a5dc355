"""Options of slams compare. Imports stay fast for --help."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from bench.run import options, single
from slams import cli
from slams.params import LASER_MODELS
from slams.registry import names

if TYPE_CHECKING:
    from bench.run.cases import Choice
    from slams.formats.options import SourceOptions
    from slams.ros.ros_params import Taken
    from slams.scanlog import ScanLog

IDEA_PRESET, ORIGINAL_PRESET = "paper", "original"  # compared beside the defaults
QUICK_DURATION = 60.0  # s


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams compare",
        description="Replay scan logs through SLAM algorithms and compare their pose errors. "
        "Without a log it simulates one: a rescue maze, UTM-30LX, five minutes.",
        epilog="Writes report.html, results.json, tables as csv and markdown, errors per update as "
        "csv, trajectories, figures as png and pdf.",
    )
    p.add_argument("logs", nargs="*", metavar="LOG", help="scan logs (default: simulate one)")
    p.add_argument(
        "--algorithms",
        metavar="NAME",
        nargs="+",
        help=f"{single.LABEL_WORDS} as a row of its own "
        f"(default: {' '.join(names())}, and NAME@{IDEA_PRESET} of each that has one)",
    )
    p.add_argument(
        "--out",
        metavar="DIR",
        help="folder of the results (default: results/compare-LOG, without a log results/compare; "
        "-2, -3, ... is appended where that folder exists)",
    )
    p.add_argument("--force", action="store_true", help="replace the results in the folder")
    size = p.add_mutually_exclusive_group()
    size.add_argument("--quick", action="store_true", help="use one minute of the log only")
    size.add_argument(
        "--full",
        action="store_true",
        help="also run the published programs (NAME@original) and print the published tables",
    )
    p.add_argument(
        "--relations",
        metavar="FILE",
        help="true relations of one log, as published for the Freiburg logs",
    )
    p.add_argument(
        "--starts",
        type=cli.count,
        default=1,
        metavar="N",
        help="with --relations: run from N start scans, as a single start can be chance",
    )
    p.add_argument(
        "--trajectory",
        metavar="NAME=WHAT",
        action="append",
        default=[],
        help="add another program's run as a row: WHAT is a TUM file, a result.mcap, or a "
        "topic or tf frame of the log's bag; may be given again",
    )
    p.add_argument(
        "--map",
        metavar="NAME=FILE",
        action="append",
        default=[],
        help="map of that program, a map_server yaml",
    )
    p.add_argument(
        "--sensor", metavar="NAME", help=f"parameters for this laser: {', '.join(LASER_MODELS)}"
    )
    p.add_argument(
        "--ros-params",
        metavar="ALGORITHM=FILE",
        action="append",
        default=[],
        help="launch or parameter file of the original's ROS node; may be given again",
    )
    single.add_options(p)
    cli.add_selection_options(p)
    p.add_argument(
        "--seed",
        metavar="N",
        action="append",
        default=[],
        help="seed of the simulation and of all algorithms; ALGORITHM:N of one; may be given again",
    )
    p.add_argument("--duration", type=float, metavar="S", help="length of the simulated log [s]")
    options.add_jobs(p)
    p.add_argument("-q", "--quiet", action="store_true", help="print no progress and no tables")
    cli.add_log_options(p)
    return p


def labels_of(arguments: argparse.Namespace) -> list[str]:
    """The selected algorithms; else all, with their ideas, and with --full the originals."""
    if arguments.algorithms:
        return list(arguments.algorithms)
    presets = (ORIGINAL_PRESET, IDEA_PRESET, "") if arguments.full else (IDEA_PRESET, "")
    return single.with_presets(names(), presets)


def checked(arguments: argparse.Namespace, labels: list[str]) -> tuple[Choice, list[ScanLog]]:
    """The choice and the logs, read and checked before the runs start."""
    from bench.run.cases import read_relations

    _check_options(arguments)
    choice = _choice(arguments, labels)
    logs = [choice.log(path) for path in arguments.logs]
    if arguments.relations is None:
        return choice, logs
    if len(arguments.logs) != 1:
        raise ValueError(
            f"--relations: got {len(arguments.logs)} logs, expected the one they are of"
        )
    return replace(choice, relations=read_relations(arguments.relations)), logs


def _check_options(arguments: argparse.Namespace) -> None:
    if arguments.starts > 1 and arguments.relations is None:
        raise ValueError("--starts: expected --relations FILE as well")
    if arguments.logs and arguments.duration is not None:
        raise ValueError("--duration: only for a simulated log; got a log as well")
    check_log_options(arguments.logs, cli.log_options(arguments))


def check_log_options(logs: Sequence[str], options: SourceOptions) -> None:
    """Refuse options for reading logs without a log.

    Raises:
        ValueError: an option for logs is given, but no log.
    """
    given = [name for name, value in vars(options).items() if value != getattr(type(options), name)]
    if given and not logs:
        option = given[0].replace("_", "-")
        raise ValueError(f"--{option}: got no log, expected the log to read")


def _choice(arguments: argparse.Namespace, labels: list[str]) -> Choice:
    """The choice of logs and parameters from the options, for all algorithms."""
    from bench.run.cases import Choice

    common, named = single.seeds(arguments.seed)
    given = single.singles(labels, arguments.params, [*arguments.changes, *named], common)
    ros = _ros(arguments.ros_params, labels, arguments.sensor)
    for label, taken in ros.items():
        given[label].base = taken.params
    params = {label: single.params_of(label, arguments.sensor, given) for label in labels}
    return Choice(
        arguments.limit,
        arguments.every,
        not arguments.no_odometry,
        int(common.get("seed", 0)),
        cli.log_options(arguments),
        params,
        ros,
        starts=arguments.starts,
        duration=QUICK_DURATION if arguments.quick else None,
    )


def _ros(given: list[str], labels: list[str], sensor: str | None) -> dict[str, Taken]:
    """The parameters from files of ROS nodes, by algorithm."""
    from slams.registry import find
    from slams.ros import ros_params

    files: dict[str, list[str]] = {}
    for text in given:
        label, path = single.named("--ros-params", text, "ALGORITHM=FILE")
        if label not in labels:
            raise ValueError(
                f"--ros-params: got {label!r}, expected one that is compared: {', '.join(labels)}"
            )
        files.setdefault(label, []).append(path)
    return {
        label: ros_params.take(
            single.params_of(label, sensor), paths, find(single.algorithm_of(label)).preset
        )
        for label, paths in files.items()
    }
