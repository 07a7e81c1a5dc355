"""slams run: one algorithm over one log, with map, trajectory and summary."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slams import cli
from slams.setup import add_state_options, prepare

if TYPE_CHECKING:
    from slams.params import Params
    from slams.player import Run
    from slams.registry import Entry
    from slams.ros.ros_params import Taken
    from slams.scanlog import ScanLog
    from slams.types import Floats, OccupancyGrid, Slam

PROGRAM = "slams run"
SUMMARY = "summary.json"
RESULTS = ["map.png", "map.pgm + map.yaml", "trajectory.csv", "trajectory.tum", SUMMARY]


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog=PROGRAM,
        description="Replay every scan of a log through one SLAM algorithm, in order.",
        epilog=f"Writes {', '.join(RESULTS)}.",
    )
    cli.add_algorithm_options(p)
    p.add_argument(
        "log",
        nargs="*",
        help="scan log: npz, ROS bag (all files of a split one) or CARMEN log",
    )
    p.add_argument(
        "--out", metavar="DIR", help="folder of the results (default: results/<log>-<algorithm>)"
    )
    cli.add_force_option(p)
    cli.add_selection_options(p)
    p.add_argument(
        "--mcap", action="store_true", help="also write result.mcap for Foxglove, rerun, RViz, evo"
    )
    p.add_argument("-q", "--quiet", action="store_true", help="print no progress and no summary")
    add_state_options(p)
    cli.add_log_options(p)
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    return cli.run_command(PROGRAM, lambda: _command(parser().parse_intermixed_args(argv)))


def _command(arguments: argparse.Namespace) -> int:
    entry, params, ros = cli.refusing(lambda: chosen(arguments))
    if arguments.show_params:
        sys.stdout.write(parameter_table(params))
        return 0
    slam, log, folder, notes = cli.refusing(lambda: prepare(entry, params, arguments, PROGRAM))
    cli.show_notes(PROGRAM, [*log.notes, *notes], arguments.quiet)
    params = getattr(slam, "params", params)
    run, start_up_s = _replayed(slam, entry, params, log, arguments)
    if arguments.save_state:
        from slams.state.store import save_after

        state, last = arguments.save_state, float(log.t[-1])
        cli.refusing(lambda: save_after(slam, state, last, log.ranges[-1]))
    text = cli.refusing(
        lambda: write_results(
            folder, entry, params, log, slam, run, start_up_s, mcap=arguments.mcap, ros=ros
        )
    )
    if not arguments.quiet:
        sys.stdout.write(f"{text}\n{folder}/: {', '.join(files_of_run(folder))}\n")
    return 0


def chosen(arguments: argparse.Namespace) -> tuple[Entry, Params, Taken | None]:
    """The algorithm, its parameters, and what came of ROS files.

    Defaults < preset < sensor < ROS files < YAML file < --set < --seed.
    """
    from slams.registry import find

    entry, ros = find(arguments.algorithm), None
    params = entry.params()
    if arguments.sensor:
        params = params.for_sensor(arguments.sensor)
    if arguments.ros_params:
        from slams.ros import ros_params

        ros = ros_params.take(params, arguments.ros_params, entry.preset)
        params = ros.params
        if not arguments.quiet:
            sys.stderr.write(ros_params.report(ros, entry.label))
    if arguments.params:
        params = params.with_yaml(arguments.params)
    params = params.replace(**dict(cli.assignment(text) for text in arguments.changes))
    if arguments.seed is not None:
        params = params.replace(seed=arguments.seed)
    return entry, params, ros


def parameter_table(params: Params) -> str:
    """All parameters as YAML that `--params` reads back: unit, meaning, source, ROS names."""
    rows, specs = params.table(), params.specs()
    width = max(len(f"{name}: {value}") for name, value, *_ in rows)
    lines = []
    for name, value, unit, meaning, source in rows:
        there = f"; ROS: {', '.join(specs[name].ros)}" if specs[name].ros else ""
        lines.append(f"{f'{name}: {value}':{width}}  # [{unit}] {meaning} ({source}{there})")
    return "\n".join(lines) + "\n"


def write_results(
    folder: Path,
    entry: Entry,
    params: Params,
    log: ScanLog,
    slam: Slam,
    run: Run,
    start_up_s: float,
    mcap: bool = False,
    ros: Taken | None = None,
) -> str:
    """Write all files of a run to `folder`, whole or not at all; returns the summary as text."""
    from slams.summary import as_text, summarize

    summary = summarize(run, log, entry.label, params, start_up_s)
    if ros is not None:
        from slams.ros import ros_params

        summary["ros_params"] = ros_params.record(ros)
    grid = slam.map()

    def _add(partial: Path) -> None:
        if mcap:
            from slams.formats.mcap import write_mcap  # only here, for it loads the bag library

            write_mcap(partial / "result.mcap", log, run.poses, grid)

    write_drive(folder, grid, (run.t, run.poses, run.corrected), summary, _add)
    return as_text(summary)


def write_drive(
    folder: Path,
    grid: OccupancyGrid,
    path: tuple[Floats, Floats, Floats | None],
    summary: dict[str, Any],
    add: Callable[[Path], None] = lambda partial: None,
) -> None:
    """Write map, trajectory and summary of a log or of a robot, whole or not at all.

    Args:
        folder: where to; files of an earlier summary there are removed.
        grid: the map.
        path: stamps (n,) [s], poses (n, 3) as they were known at the time, and poses as closed
            loops left them, or None.
        summary: gets the names of the `files`.
        add: writes more files to the folder that it is given.

    Raises:
        OSError: they cannot be written.
    """
    from slams.formats import files, occupancy, trajectory
    from slams.summary import as_json

    t, poses, corrected = path
    with files.complete_folder(folder, files_of_run(folder)) as partial:
        for name, rows in (("trajectory", poses), ("trajectory_corrected", corrected)):
            if rows is not None:
                trajectory.write_csv(partial / f"{name}.csv", t, rows)
                trajectory.write_tum(partial / f"{name}.tum", t, rows)
        occupancy.write_map(partial, grid)
        shown = poses if corrected is None else corrected
        occupancy.write_image(partial / "map.png", occupancy.picture(grid, shown))
        add(partial)
        summary["files"] = sorted([*(path.name for path in partial.iterdir()), SUMMARY])
        (partial / SUMMARY).write_text(as_json(summary), encoding="utf-8")


def files_of_run(folder: Path) -> list[str]:
    """Names of the files that an earlier run wrote to a folder, by its summary."""
    try:
        names = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError, LookupError, TypeError):
        return []
    return [name for name in names if isinstance(name, str) and Path(name).name == name]


def _replayed(
    slam: Slam, entry: Entry, params: Params, log: ScanLog, arguments: argparse.Namespace
) -> tuple[Run, float]:
    from slams.player import WARM_UP_SCANS, replay, warm_up

    start_up_s = warm_up(entry.cls, params, log.select(WARM_UP_SCANS))
    return replay(slam, cli.progress(log, len(log), entry.label, arguments.quiet)), start_up_s


if __name__ == "__main__":
    sys.exit(main())
