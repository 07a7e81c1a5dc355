"""python -m slams.live: an algorithm on a robot, scans in, map and transforms out, by ROS 2."""

from __future__ import annotations

import argparse
import gc
import signal
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from slams import cli
from slams.live.network import add_network_options, wire_of
from slams.live.options import NodeOptions, Topics
from slams.run import chosen, parameter_table
from slams.setup import add_state_options, given_start

if TYPE_CHECKING:
    from slams.live.node import Node
    from slams.live.recorder import Recorder
    from slams.live.slam import LiveSlam
    from slams.live.status import Terminal
    from slams.live.wire import Wire
    from slams.params import Params
    from slams.registry import Entry
    from slams.types import Pose2

PROGRAM = "slams.live"


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog=f"python -m {PROGRAM}",
        description="One SLAM algorithm on a robot: scans, odometry, gyro and tf come by ROS 2, "
        "map, transform, pose and state go out. No ROS needed. Ctrl-C ends it and writes the map.",
    )
    cli.add_algorithm_options(p)
    p.add_argument("--out", metavar="DIR", help="default: results/live-<algorithm>")
    p.add_argument("--record", metavar="FILE.mcap", help="keep all that comes in and goes out")
    p.add_argument(
        "--laser",
        metavar="MODEL:PORT",
        help="a laser at a serial port instead of --scan-topic, as rplidar:/dev/ttyUSB0 "
        "(extra serial)",
    )
    p.add_argument(
        "--laser-turns", choices=("cw", "ccw"), default="cw", help="which way its angles grow: cw"
    )
    p.add_argument("-q", "--quiet", action="store_true", help="no notes, no status line")
    add_state_options(p)
    _add_topics(p)
    _add_frames(p)
    add_network_options(p)
    return p


def _add_topics(p: argparse.ArgumentParser) -> None:
    group, usual = p.add_argument_group("topics"), Topics()
    group.add_argument("--scan-topic", metavar="TOPIC", default=usual.scan, help=usual.scan)
    group.add_argument(
        "--odom",
        metavar="TOPIC",
        default="auto",
        help="odometry: auto (tf where it has that frame, else /odom), tf, a topic or none",
    )
    group.add_argument("--imu", metavar="TOPIC", default=usual.imu, help=f"{usual.imu}; or none")
    for name in ("map", "pose", "state"):
        topic = getattr(usual, name)
        group.add_argument(f"--{name}-topic", metavar="TOPIC", default=topic, help=topic)


def _add_frames(p: argparse.ArgumentParser) -> None:
    group, usual = p.add_argument_group("frames and times"), NodeOptions()
    group.add_argument("--map-frame", metavar="FRAME", default=usual.map_frame, help="map")
    group.add_argument("--odom-frame", metavar="FRAME", default=usual.odom_frame, help="odom")
    group.add_argument(
        "--base-frame", metavar="FRAME", help="what the odometry is of, else base_link"
    )
    group.add_argument(
        "--queue", type=int, metavar="N", default=usual.queue, help="scans that wait"
    )
    times = {
        "map_every": "time between two maps [s], 0 for none but the last",
        "wait": "for odometry and gyro to catch up with a scan [s]",
        "patience": "for the first scan and for the frames asked for [s]",
        "tf_ahead": "how far ahead of its scan a transform is stamped [s]",
    }
    for name, text in times.items():
        value = getattr(usual, name)
        flag = f"--{name.replace('_', '-')}"
        group.add_argument(flag, type=float, metavar="S", default=value, help=f"{text}: {value:g}")


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    cli.one_thread()
    return cli.run_command(PROGRAM, lambda: _command(parser().parse_args(argv)))


def _command(arguments: argparse.Namespace) -> int:
    entry, params, _ = cli.refusing(lambda: chosen(arguments))
    if arguments.show_params:
        sys.stdout.write(parameter_table(params))
        return 0
    from slams.formats.files import check_folder
    from slams.live.results import RESULTS, delays, write_results
    from slams.live.status import Terminal

    options = cli.refusing(lambda: node_options(arguments))
    folder = Path(arguments.out or f"results/live-{entry.label.replace(':', '.')}")
    cli.refusing(lambda: check_folder(folder))
    terminal = Terminal(PROGRAM, arguments.quiet)
    start = cli.refusing(lambda: given_start(arguments))
    ending = _ending()
    wire = cli.refusing(lambda: _wire(arguments, terminal))
    live = cli.refusing(lambda: _begun(entry, params, arguments, start))
    node = _drive(live, wire, options, terminal, arguments.record, ending)
    if not node.drive.t:
        raise RuntimeError(_nothing(node))
    if arguments.save_state:
        beside = {"gyro": node.senses.gyro_kept}
        cli.refusing(lambda: live.save(arguments.save_state, **beside))
    cli.refusing(lambda: write_results(folder, entry.label, live.params, node))
    if not arguments.quiet:
        spent = ", ".join(f"{name} {value} ms" for name, value in delays(node.drive).items())
        sys.stdout.write(
            f"{len(node.drive.t)} scans, {node.inbox.dropped} left out; "
            f"from scan to pose: {spent}\n"
            f"{folder}/: {', '.join(RESULTS)}\n"
        )
    return 0


def _begun(
    entry: Entry, params: Params, arguments: argparse.Namespace, start: Pose2 | None
) -> LiveSlam:
    """The algorithm, new, from a state, or in a map that stays; compiled."""
    from slams.live.slam import LiveSlam

    saved, place = arguments.resume_state, arguments.localize
    live = LiveSlam(entry.label, state=saved, map=place, map_start=start, **params.as_dict())
    if arguments.save_state:
        live.check_saving(arguments.save_state)
    return live


def _nothing(node: Node) -> str:
    """Why there is no pose."""
    sought = node.drive.counts["sought"]
    if not sought:
        return "ended before the first scan; nothing is written"
    return (
        f"its place in the map is not sure after {sought} scans ({node.live.doubt}); expected "
        "a drive that leaves alike places, or --start; nothing is written"
    )


def node_options(arguments: argparse.Namespace) -> NodeOptions:
    """What the command line says of topics, frames and times.

    Raises:
        ValueError: a number is out of its bounds.
    """
    usual, odom = Topics(), arguments.odom
    named = odom not in ("auto", "tf", "none")
    silent = arguments.imu == "none"
    topics = Topics(
        scan=_absolute(arguments.scan_topic),
        odom=_absolute(odom) if named else usual.odom,
        imu=usual.imu if silent else _absolute(arguments.imu),
        map=_absolute(arguments.map_topic),
        pose=_absolute(arguments.pose_topic),
        state=_absolute(arguments.state_topic),
    )
    return NodeOptions(
        topics=topics,
        map_frame=arguments.map_frame,
        odom_frame=arguments.odom_frame,
        base_frame=arguments.base_frame,
        odometry="topic" if named else odom,
        imu=not silent,
        queue=arguments.queue,
        patience=arguments.patience,
        wait=arguments.wait,
        map_every=arguments.map_every,
        tf_ahead=arguments.tf_ahead,
    )


def _absolute(topic: str) -> str:
    return topic if topic.startswith("/") else f"/{topic}"


def _wire(arguments: argparse.Namespace, terminal: Terminal) -> Wire:
    """The network; with a laser at a port of this machine, that laser's scans are on it."""
    if arguments.laser is None:
        return wire_of(arguments, "slams")
    from slams.live.serial_laser import LaserWire, laser_of

    laser = laser_of(arguments.laser, arguments.laser_turns == "cw")
    return LaserWire(laser, wire_of(arguments, "slams"), terminal.say)


def _ending() -> threading.Event:
    """What Ctrl-C and SIGTERM set; a second Ctrl-C does not wait for the results."""
    ending = threading.Event()

    def end(*_: object) -> None:
        """Let the node end."""
        ending.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    return ending


def _drive(
    live: LiveSlam,
    wire: Wire,
    options: NodeOptions,
    terminal: Terminal,
    record: str | None,
    ending: threading.Event,
) -> Node:
    """Take scans until the end."""
    from slams.live.node import Node

    node = cli.refusing(lambda: Node(live, wire, options, terminal.say))
    gc.collect()
    gc.freeze()  # spare the scans the search for garbage among all that was loaded
    try:
        node.recorder = cli.refusing(lambda: _recorder(record, options.topics))
        cli.refusing(lambda: node.start(ending))
        node.run(ending, lambda: terminal.status(node))
    finally:
        terminal.end()
        node.close()
        if node.recorder is not None:
            cli.refusing(node.recorder.close if node.drive.t else node.recorder.abandon)
    return node


def _recorder(record: str | None, topics: Topics) -> Recorder | None:
    if record is None:
        return None
    from slams.live.recorder import Recorder

    return Recorder(record, topics)


if __name__ == "__main__":
    sys.exit(main())
