"""slams compare: every algorithm over the same scan logs, in the paper's tables.

M. Kuehn, R. Koch, H. Fees, S. May: Benchmarking the pose accuracy of different SLAM approaches for
rescue robotics [Kuehn].
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.run.compare_options import QUICK_DURATION, checked, labels_of
from bench.run.compare_options import parser as parser
from slams import cli

if TYPE_CHECKING:
    from bench.results import Comparison, Outcome
    from bench.run.cases import Choice
    from slams.scanlog import ScanLog

SIMULATED_DURATION = 300.0  # s of the simulated log


def _command(arguments: argparse.Namespace) -> int:
    from bench.judge.comparison import evaluated
    from bench.report import outputs, text
    from bench.run import folder as folders
    from bench.run.comparing import compared
    from slams.formats import files
    from slams.ros import ros_params

    labels = cli.refusing(lambda: labels_of(arguments))
    choice, logs = cli.refusing(lambda: checked(arguments, labels))
    others = cli.refusing(lambda: _others(arguments, labels, logs, choice))
    out = cli.refusing(lambda: folders.claimed(arguments.out, arguments.logs, arguments.force))
    for label, taken in choice.ros.items() if not arguments.quiet else ():
        sys.stderr.write(ros_params.report(taken, label))
    with files.complete_folder(out) as folder:
        logs = logs or [cli.refusing(lambda: simulated(folder, choice, arguments))]
        found = compared(labels, logs, choice, arguments.jobs, arguments.quiet)
        found = [log._replace(outcomes=[*log.outcomes, *others]) for log in found]
        comparison = evaluated(found, _facts(choice, arguments))
        _write(folder, comparison)
        inputs = [text.partition("=")[2] for text in (*arguments.trajectory, *arguments.map)]
        inputs += filter(None, (*arguments.logs, arguments.truth, arguments.relations))
        folders.cleared(out, outputs.OUTPUT_FILES, inputs)
    if not arguments.quiet:
        report = out / "report.html"
        more = f"The report: {report}; tables, figures and results.json beside it."
        sys.stdout.write(f"{text.terminal(comparison)}\n{more}\n")
    return cli.EXIT_FAILED if all(row["failed"] for row in comparison.rows) else 0


def _others(
    arguments: argparse.Namespace, labels: list[str], logs: list[ScanLog], choice: Choice
) -> list[Outcome]:
    """The rows of other programs, for a single log."""
    from bench.run.comparing import with_consistency
    from bench.run.foreign import foreign_case, read_foreign

    given = arguments.trajectory, arguments.map
    if any(given) and len(logs) != 1:
        raise ValueError(f"--trajectory: got {len(logs)} logs, expected the log of the trajectory")
    if not any(given):
        return []
    found = read_foreign(*given, labels, arguments.logs[0], choice.options)
    log = logs[0]
    return [
        with_consistency(
            foreign_case(one, log, choice.relations), log, one.track.known_poses_at(log.t)
        )
        for one in found
    ]


def _facts(choice: Choice, arguments: argparse.Namespace) -> dict[str, Any]:
    """The record of the comparison: command, machine, versions."""
    from bench.run import timing
    from slams.ros import ros_params

    ros = {label: ros_params.record(taken) for label, taken in choice.ros.items()}
    made = timing.record(arguments, processes=arguments.jobs)
    return made | {"odometry": choice.odometry, "ros_params": ros}


def _write(folder: Path, comparison: Comparison) -> None:
    """Write the results, then tables, figures and pages."""
    from bench import results
    from bench.report import outputs

    results.write_figures(folder / results.RESULTS_FILE, comparison.as_dict())
    outputs.write(folder, comparison)


def simulated(folder: Path, choice: Choice, arguments: argparse.Namespace) -> ScanLog:
    """The default log, simulated and saved in `folder`: rescue maze, UTM-30LX, five minutes."""
    from bench.sim.setting import Setting
    from bench.sim.simulation import simulate

    duration = arguments.duration
    if duration is None:
        duration = QUICK_DURATION if arguments.quick else SIMULATED_DURATION
    log = simulate(Setting(seed=choice.seed, duration=duration))
    log.save(folder / f"{log.name}.npz")
    return choice.part(log)


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
