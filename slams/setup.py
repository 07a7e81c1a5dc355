"""How a run is set up: the algorithm, new or with a saved state, its scans, its folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from slams import cli

if TYPE_CHECKING:
    import argparse

    from slams.params import Params
    from slams.registry import Entry
    from slams.scanlog import ScanLog
    from slams.types import Pose2, Slam


def add_state_options(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of saved states and of fixed maps."""
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


def prepare(
    entry: Entry, params: Params, arguments: argparse.Namespace, program: str
) -> tuple[Slam, ScanLog, Path, list[str]]:
    """The algorithm before its first scan, its scans, the folder of results, notes for the user.

    What cannot be read or written is refused before the run.

    Raises:
        LookupError, OSError, TypeError, ValueError: one sentence about what the user gave.
    """
    from slams.formats.source import load

    if not arguments.log:
        raise ValueError(f"no log given; expected {program} {arguments.algorithm} scans.npz")
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
    """Where the results go, named after the log's file; nothing is overwritten unasked.

    A state that is resumed and saved under one name is one that grows: that is asked for.
    """
    from slams.formats.files import check_folder, check_new
    from slams.formats.packed import name_of

    name = f"{name_of(Path(arguments.log[0]))}-{label.replace(':', '.')}"
    folder = Path(arguments.out or f"results/{name}")
    check_folder(folder)
    check_new(folder, arguments.force)
    save = arguments.save_state
    if save and save != arguments.resume_state and Path(save).is_file():
        check_new(save, arguments.force)
    return folder


def _slam_and_rest(
    entry: Entry, params: Params, log: ScanLog, arguments: argparse.Namespace
) -> tuple[Slam, ScanLog, list[str]]:
    """The algorithm, and the scans of the log that its state has not got."""
    if arguments.localize or arguments.start:
        return _localizing(entry, params, log, arguments)
    if not arguments.resume_state:
        return entry.cls(params), log, []
    from slams.state import store

    state = store.resume(arguments.resume_state, entry, params)
    rest, known = store.rest_of(log, state.beside, arguments.every)
    notes = [f"goes on at scan {known} of {len(log)}"] if known else []
    return state.slam, rest, notes


def _localizing(
    entry: Entry, params: Params, log: ScanLog, arguments: argparse.Namespace
) -> tuple[Slam, ScanLog, list[str]]:
    """The algorithm in a fixed map, and the log from the scan whose pose is known."""
    from slams.localize import source

    start, notes = given_start(arguments), list[str]()
    ready = source.prepare(entry, params, source.open_map(arguments.localize, notes))
    seen = log if not arguments.no_odometry else log.select(odometry=False)
    if start is not None:
        found = source.start_at(ready.map_index, seen, start)
    else:
        found = source.find_start(ready.map_index, seen)
    return ready.at(found.pose), log.rows(slice(found.scan, None)), [*notes, found.note]
