"""How a run begins: the algorithm, new or with a saved state, the scans for it, the folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from slams import cli

if TYPE_CHECKING:
    import argparse

    from slams.params import Params
    from slams.registry import Entry
    from slams.scanlog import ScanLog
    from slams.types import Pose2, Slam


class Beginning(NamedTuple):
    """The algorithm before its first scan, its scans, where the results go, what to tell."""

    slam: Slam
    log: ScanLog
    folder: Path
    notes: list[str]


def add_state_options(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of states and of maps that stay as they are."""
    group = parser.add_argument_group("states and maps")
    group.add_argument("--save-state", metavar="FILE", help="also keep what the algorithm knows")
    group.add_argument("--resume-state", metavar="FILE", help="go on from a saved state")
    group.add_argument(
        "--localize",
        "--map",
        metavar="MAP",
        help="a state or map.yaml to stay as it is; as in ROS also called --map",
    )
    group.add_argument(
        "--start",
        metavar="X,Y,THETA",
        help="where in MAP [m, rad], as --start=-1,2,0.5; else it is found",
    )


def given_start(arguments: argparse.Namespace) -> Pose2 | None:
    """The pose of `--start`, once the options of states and maps fit together.

    Raises:
        ValueError: they do not.
    """
    from slams.localize.source import pose_of

    if arguments.start and not arguments.localize:
        raise ValueError("--start: got a place without a map; expected --localize MAP, too")
    for name in ("resume_state", "save_state"):
        if arguments.localize and getattr(arguments, name):
            option = f"--{name.replace('_', '-')}"
            raise ValueError(f"--localize leaves the map as it is: got {option}, too")
    return None if arguments.start is None else pose_of(arguments.start)


def begin(entry: Entry, params: Params, arguments: argparse.Namespace, program: str) -> Beginning:
    """All that a run needs; what cannot be read or written is told before it.

    Raises:
        LookupError, OSError, TypeError, ValueError: one sentence about what the user gave.
    """
    from slams.formats.files import check_folder

    whole = _log(arguments, program)
    folder = Path(arguments.out or f"results/{whole.name}-{entry.label.replace(':', '.')}")
    check_folder(folder)
    slam, log, notes = _slam_and_rest(entry, params, whole, arguments)
    if arguments.save_state:
        from slams.state import session

        session.check_target(arguments.save_state, slam)
    log = log.select(arguments.limit, arguments.every, not arguments.no_odometry)
    return Beginning(slam, log, folder, notes)


def _slam_and_rest(
    entry: Entry, params: Params, log: ScanLog, arguments: argparse.Namespace
) -> tuple[Slam, ScanLog, list[str]]:
    """The algorithm, and what of the log it has not seen."""
    if arguments.localize or arguments.start:
        return _localizing(entry, params, log, arguments)
    if not arguments.resume_state:
        return entry.cls(params), log, []
    from slams.state import session

    state = session.resume(arguments.resume_state, entry, params)
    rest, known = session.rest_of(log, state.beside, arguments.every)
    notes = [f"goes on at scan {known} of {len(log)}"] if known else []
    return state.slam, rest, notes


def _localizing(
    entry: Entry, params: Params, log: ScanLog, arguments: argparse.Namespace
) -> tuple[Slam, ScanLog, list[str]]:
    """The algorithm in a map that stays, and the log from where its place is sure."""
    from slams.localize import source

    start, notes = given_start(arguments), list[str]()
    ready = source.prepare(entry, params, source.open_map(arguments.localize, notes))
    seen = log if not arguments.no_odometry else log.select(odometry=False)
    if start is not None:
        found = source.start_at(ready.map_index, seen, start)
    else:
        found = source.find_start(ready.map_index, seen)
    return ready.at(found.pose), log.from_scan(found.scan), [*notes, found.note]


def _log(arguments: argparse.Namespace, program: str) -> ScanLog:
    from slams.formats.source import load

    if not arguments.log:
        raise ValueError(f"no log given; expected {program} {arguments.algorithm} scans.npz")
    for name in ("limit", "every", "video_every"):
        value = getattr(arguments, name)
        if value is not None and value < 1:
            raise ValueError(f"--{name.replace('_', '-')}: got {value}, expected 1 or more")
    return load(arguments.log, cli.log_options(arguments))
