"""slams run: run one algorithm over a log; writes map, trajectory and summary."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slams import cli
from slams.formats import files
from slams.formats.packed import name_of
from slams.params import Params
from slams.registry import Entry, find, label_of

if TYPE_CHECKING:
    from slams.ros.ros_params import Taken
    from slams.scanlog import ScanLog
    from slams.types import Floats, OccupancyGrid, Pose2, Slam

SUMMARY_FILE = "summary.json"
RESULT_FILES = ["map.png", "map.pgm + map.yaml", "trajectory.csv", "trajectory.tum", SUMMARY_FILE]


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams run",
        description="Replay every scan of a log through one SLAM algorithm, in order.",
        epilog=f"Writes {', '.join(RESULT_FILES)}.",
    )
    cli.add_algorithm_options(p)
    p.add_argument(
        "--out", metavar="DIR", help="folder of the results (default: results/<log>-<algorithm>)"
    )
    p.add_argument("--force", action="store_true", help="replace files that exist")
    cli.add_selection_options(p)
    p.add_argument(
        "--mcap", action="store_true", help="also write result.mcap for Foxglove, rerun, RViz, evo"
    )
    p.add_argument("-q", "--quiet", action="store_true", help="print no progress and no summary")
    add_state_options(p)
    cli.add_log(p, "*")
    return p


def add_state_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of saved states and of fixed maps."""
    group = parser.add_argument_group("states and maps")
    group.add_argument(
        "--save-state", metavar="FILE", help="save the algorithm's state to FILE at the end"
    )
    group.add_argument("--resume-state", metavar="FILE", help="continue from a saved state")
    group.add_argument(
        "--localize",
        "--map",
        metavar="MAP",
        help="localize in MAP, a saved state or a map.yaml, and leave it unchanged",
    )
    group.add_argument(
        "--start",
        metavar="X,Y,THETA",
        help="first pose in MAP [m, rad], as --start=-1,2,0.5 (default: global localization)",
    )


def given_start(arguments: argparse.Namespace) -> Pose2 | None:
    """The pose of `--start`, or None.

    Raises:
        ValueError: the options of states and maps contradict each other.
    """
    from slams.localize.source import pose_of

    if arguments.start and not arguments.localize:
        raise ValueError("--start: got a pose without a map; expected --localize MAP, too")
    for name in ("resume_state", "save_state"):
        if arguments.localize and getattr(arguments, name):
            option = f"--{name.replace('_', '-')}"
            raise ValueError(f"--localize leaves the map unchanged: got {option}, too")
    return None if arguments.start is None else pose_of(arguments.start)


def _command(arguments: argparse.Namespace) -> int:
    entry, params, ros = cli.refusing(lambda: chosen(arguments))
    if arguments.show_params:
        sys.stdout.write(parameter_table(params))
        return 0
    from slams.player import WARM_UP_SCANS, replay, warm_up
    from slams.summary import as_text, summarize

    slam, log, folder, notes = cli.refusing(lambda: _prepared(entry, params, arguments))
    cli.show_notes(arguments, [*log.notes, *notes])
    params = getattr(slam, "params", params)
    start_up_s = warm_up(entry.cls, params, log.select(WARM_UP_SCANS))
    run = replay(slam, cli.progress(log, len(log), entry.label, arguments.quiet))
    summary = summarize(run, log, entry.label, params, start_up_s)
    if ros is not None:
        from slams.ros import ros_params

        summary["ros_params"] = ros_params.record(ros)
    path, bag = (run.t, run.poses, run.corrected), log if arguments.mcap else None
    outputs: list[Callable[[], None]] = []
    outputs.append(lambda: write_drive(folder, slam.map(), path, summary, bag))
    if arguments.save_state:
        from slams.state.store import save_after

        state, last = arguments.save_state, float(log.t[-1])
        outputs.append(lambda: save_after(slam, state, last, log.ranges[-1]))
    cli.refusing_each(outputs)
    if not arguments.quiet:
        written = ", ".join(files_of_run(folder))
        sys.stdout.write(f"{as_text(summary)}\n{folder}/: {written}\n")
    return 0


def chosen(arguments: argparse.Namespace) -> tuple[Entry, Params, Taken | None]:
    """The algorithm, its parameters, and what was read from ROS files.

    Later sources override: defaults, preset, sensor, ROS files, YAML file, --set, --seed.
    """
    entry, ros = find(arguments.algorithm), None
    params = entry.params()
    if arguments.sensor:
        before, params = params, params.for_sensor(arguments.sensor)
        if params == before and not arguments.quiet:
            sys.stderr.write(f"note: --sensor {arguments.sensor} sets nothing for {entry.label}\n")
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


def are_given(arguments: argparse.Namespace) -> bool:
    """Whether the user gave parameters, be it with their default values."""
    options = (arguments.sensor, arguments.ros_params, arguments.params, arguments.changes)
    return any(options) or arguments.seed is not None


def parameter_table(params: Params) -> str:
    """All parameters as YAML for `--params`, with unit, meaning, source and ROS names."""
    rows, specs = params.table(), params.specs()
    width = max(len(f"{name}: {value}") for name, value, *_ in rows)
    lines = []
    for name, value, unit, meaning, source in rows:
        ros = f"; ROS: {', '.join(specs[name].ros)}" if specs[name].ros else ""
        lines.append(f"{f'{name}: {value}':{width}}  # [{unit}] {meaning} ({source}{ros})")
    return "\n".join(lines) + "\n"


def write_drive(
    folder: Path,
    grid: OccupancyGrid,
    path: tuple[Floats, Floats, Floats | None],
    summary: dict[str, Any],
    mcap: ScanLog | None = None,
) -> None:
    """Write map, trajectory and summary of a log or of a robot, all of them or none.

    Args:
        folder: the target; files that an earlier summary lists are removed.
        grid: the map.
        path: stamps (n,) [s], poses (n, 3) after each update, and poses (n, 3) corrected by loops,
            or None.
        summary: the names of the written files are added to it as `files`.
        mcap: the log, if `result.mcap` is to be written, too.

    Raises:
        OSError: a file cannot be written.
    """
    from slams.formats import occupancy, trajectory
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
        if mcap is not None:
            from slams.formats.mcap import write_mcap  # it loads the bag library

            write_mcap(partial / "result.mcap", mcap, shown, grid)
        summary["files"] = sorted([*(path.name for path in partial.iterdir()), SUMMARY_FILE])
        (partial / SUMMARY_FILE).write_text(as_json(summary), encoding="utf-8")


def files_of_run(folder: Path) -> list[str]:
    """Names of the files in a folder that the summary of an earlier run lists."""
    try:
        names = json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError, LookupError, TypeError):
        return []
    return [name for name in names if isinstance(name, str) and Path(name).name == name]


def _prepared(
    entry: Entry, params: Params, arguments: argparse.Namespace
) -> tuple[Slam, ScanLog, Path, list[str]]:
    """The algorithm before its first scan, its scans, the folder of results, notes for the user.

    Files that cannot be read or written are refused before the run.

    Raises:
        LookupError, OSError, TypeError, ValueError: one sentence about the user's input.
    """
    from slams.formats.source import load

    if not arguments.log:
        usage = f"{arguments.program} {arguments.algorithm} scans.npz"
        raise ValueError(f"no log given; expected {usage}")
    options = cli.log_options(arguments)
    folder = _folder(entry.label, arguments)
    whole = load(arguments.log, options)
    slam, log, notes = _slam_and_rest(entry, params, whole, arguments)
    if arguments.save_state:
        from slams.state import store

        store.check_target(arguments.save_state, slam)
    log = log.select(arguments.limit, arguments.every, not arguments.no_odometry)
    return slam, log, folder, notes


def _folder(label: str, arguments: argparse.Namespace) -> Path:
    """The folder of the results, named after the log."""
    name = f"{name_of(Path(arguments.log[0]))}-{label.replace(':', '.')}"
    folder, save = Path(arguments.out or f"results/{name}"), arguments.save_state
    if save and any(Path(save).resolve() == Path(one).resolve() for one in arguments.log):
        raise ValueError(f"--save-state: got {save}, the log itself; choose another name")
    check_results(folder, arguments)
    return folder


def check_results(folder: Path, arguments: argparse.Namespace) -> None:
    """Check that results and state can be written, and replace files only if `--force` is set.

    An exception is a state that is resumed from and saved to the same file.
    """
    files.check_folder(folder)
    files.check_new(folder, arguments.force)
    save = arguments.save_state
    if save and save != arguments.resume_state and Path(save).is_file():
        files.check_new(save, arguments.force)


def _slam_and_rest(
    entry: Entry, params: Params, log: ScanLog, arguments: argparse.Namespace
) -> tuple[Slam, ScanLog, list[str]]:
    """The algorithm, the scans of the log that its state does not contain, and notes."""
    if arguments.localize or arguments.start:
        return _localizing(entry, params, log, arguments)
    if not arguments.resume_state:
        return entry.cls(params), log, []
    from slams.state import store

    path = arguments.resume_state
    state = store.read_state(path, entry.label)
    store.check_params(path, state.slam, params, are_given(arguments))
    rest, first = store.rest_of(log, state.beside, arguments.every)
    notes = [f"continues at scan {first} of {len(log)}"] if first else []
    return state.slam, rest, notes


def _localizing(
    entry: Entry, params: Params, log: ScanLog, arguments: argparse.Namespace
) -> tuple[Slam, ScanLog, list[str]]:
    """The algorithm in a fixed map, the log from the first localized scan on, and notes."""
    from slams.localize import source

    start, notes = given_start(arguments), list[str]()
    opened = source.open_map(arguments.localize, notes, label_of(entry.cls))
    ready = source.prepare(entry, params, opened, are_given(arguments))
    used = log if not arguments.no_odometry else log.select(odometry=False)
    if start is not None:
        found = source.start_at(ready.map_index, used, start)
    else:
        found = source.find_start(ready.map_index, used)
    return ready.at(found.pose), log.rows(slice(found.scan, None)), [*notes, found.note]


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
