"""slams info LOG: topics, frames, lasers, rates, gaps and assumptions about a log."""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from slams import cli
from slams.formats.options import DamagedError, SourceOptions
from slams.formats.packed import text_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from slams.formats.bag import Topic
    from slams.formats.frames import Transforms
    from slams.scanlog import ScanLog, TimeSeries
    from slams.types import Floats, Laser

MIN_GAP_PERIODS = 3.0  # periods between two messages; more is a gap of two missing messages


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams info",
        description="Print what a recorded log contains, what the commands will assume where it "
        "is ambiguous, and which commands can use it.",
    )
    cli.add_log(p)
    return p


def _command(arguments: argparse.Namespace) -> int:
    paths, options = [Path(name) for name in arguments.log], cli.log_options(arguments)
    for line in cli.refusing(lambda: list(report(paths, options))):
        sys.stdout.write(f"{line}\n")
    return 0


def report(paths: list[Path], options: SourceOptions) -> Iterator[str]:
    """The lines about the log in the files `paths`.

    Raises:
        OSError: a file cannot be opened.
        ValueError: the log is damaged or no log; one sentence.
    """
    from slams.formats.carmen import laser_messages
    from slams.formats.kind import BAG_KINDS, kind_of
    from slams.formats.recording import Recording, read
    from slams.formats.source import load
    from slams.ros.messages import SCAN_TYPES

    kinds = [kind_of(path) for path in paths]
    if not all(kind in BAG_KINDS for kind in kinds):
        if kinds == ["carmen"]:
            for name, lines in laser_messages(text_of(paths[0])).items():
                yield f"  {name}  {lines} lines"
        yield from _of_log(load(paths, options))
        return
    topics, transforms = read(paths, options, Recording.contents)
    yield from _of_bag(paths[0], topics, transforms)
    found = [topic.name for topic in topics if topic.msgtype in SCAN_TYPES]
    lasers = found if found and not options.scan_topic else [options.scan_topic]
    for laser in lasers:
        try:
            yield from _of_log(load(paths, replace(options, scan_topic=laser)))
        except DamagedError:
            raise
        except ValueError as error:  # the log is ambiguous, or it has no scans
            yield f"{laser or 'the log'} cannot be used: {error}"
    if len(lasers) > 1:
        yield f"{len(lasers)} lasers: --scan-topic picks one, or several (given for each)"


def _of_bag(path: Path, topics: list[Topic], transforms: Transforms) -> Iterator[str]:
    """Topics with their types, and the tree of frames."""
    yield f"{path.name}: {sum(topic.messages for topic in topics)} messages"
    width = max((len(topic.name) for topic in topics), default=0)
    for topic in topics:
        yield f"  {topic.name:{width}}  {topic.messages:6}  {topic.msgtype}"
    for edge, samples in transforms.samples.items():
        moves = "fixed" if transforms.is_fixed(edge) else f"moves, {len(samples)} stamps"
        yield f"  frame {edge[1]} in {edge[0]}: {moves}"


def _of_log(log: ScanLog) -> Iterator[str]:
    """The scans and signals of a log, the assumptions, and the commands that can use it."""
    yield from described(log).split("\n")
    source = log.meta.get("source")
    if isinstance(source, dict) and {"scans", "laser_frame", "base_frame"} <= source.keys():
        yield f"frames: scans {source['scans']} in {source['laser_frame']}"
        yield f"frames: poses are of {source['base_frame']}"
    yield from _timing(log)
    yield from (f"assumed: {note}" for note in log.notes)
    if len(log.lasers) > 1:
        yield "usable by: slams run, convert"
    elif log.truth:
        yield "usable by: slams run, play, convert, compare, sweep"
    else:
        yield (
            "usable by: slams run, play, convert, compare (pose errors with --relations or "
            "--truth), sweep with --truth"
        )


def described(log: ScanLog) -> str:
    """The contents of a log in a few lines."""
    source = log.meta.get("source")
    lines = [
        f"{log.name}: {len(log)} scans of {log.laser.n_beams} beams, {_rate(log.t)}, "
        f"{float(log.t.max() - log.t.min()):.1f} s",
        *map(_laser, log.lasers),
    ]
    for name, series in _signals(log).items():
        origin = source.get(name) if isinstance(source, dict) else None  # free text
        named = f" from {origin}" if origin else ""
        lines.append(f"{name.replace('_', ' ')}: {len(series.t)} stamps, {_rate(series.t)}{named}")
    return "\n".join(lines)


def _laser(laser: Laser) -> str:
    """Field of view, range limits and mount of a laser."""
    fov = math.degrees(abs(laser.angle_increment) * (laser.n_beams - 1))
    height = "" if laser.above_floor is None else f", {laser.above_floor:.3f} m above the floor"
    return (
        f"laser: {fov:.0f} degrees, {laser.range_min:.2f} to {laser.range_max:.2f} m, mounted at "
        f"({laser.mount.x:.3f}, {laser.mount.y:.3f}) m, {laser.mount.theta:.4f} rad{height}"
    )


def _signals(log: ScanLog) -> dict[str, TimeSeries]:
    signals = {
        "odometry": log.odom,
        "yaw_rate": log.yaw_rate,
        "attitude": log.attitude,
        "truth": log.truth,
    }
    return {name: series for name, series in signals.items() if series is not None}


def _rate(t: Floats) -> str:
    """The median rate of stamps (n,)."""
    import numpy as np

    period = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    return f"{1.0 / period:.1f} Hz" if period > 0.0 else "one stamp"


def _timing(log: ScanLog) -> Iterator[str]:
    """Time of a sweep, gaps of scans and signals, stamps that jump back, empty scans."""
    import numpy as np

    sweep = log.laser.time_increment * log.laser.n_beams
    deskewed = (
        f"swept in {1e3 * sweep:.0f} ms, which is deskewed"
        if sweep
        else "taken as instantaneous, no time between beams is known"
    )
    yield f"each scan: {deskewed}"
    stamps_of = {"scans": log.t} | {key: series.t for key, series in _signals(log).items()}
    for name, t in stamps_of.items():
        stamps = np.unique(t)
        steps = np.diff(stamps)
        gaps = int((steps > MIN_GAP_PERIODS * np.median(steps)).sum()) if len(steps) else 0
        if gaps:
            longest = int(steps.argmax())
            yield (
                f"gaps of the {name.replace('_', ' ')}: {gaps}, the longest {steps[longest]:.2f} s "
                f"after {stamps[longest] - stamps[0]:.1f} s"
            )
    if log.stamp_jumps:
        yield f"{log.stamp_jumps} stamps jump back; scans are used in the order of the log"
    empty = int((~np.isfinite(log.ranges).any(axis=1)).sum())
    if empty:
        yield f"{empty} scans have no return at all"


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
