"""slams live: an algorithm on a robot, scans in, map and transforms out, by ROS 2."""

from __future__ import annotations

import argparse
import gc
import signal
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from slams import cli
from slams.live.options import NodeOptions, Topics, add_network_options, transport_of
from slams.run import chosen, files_of_run, parameter_table
from slams.setup import add_state_options, given_start

if TYPE_CHECKING:
    from slams.live.diagnostics import Terminal
    from slams.live.node import Node
    from slams.live.slam import LiveSlam
    from slams.live.transport import Transport

PROGRAM = "slams live"


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog=PROGRAM,
        description="Run one SLAM algorithm on a robot: it subscribes scans, odometry, gyro and tf "
        "by ROS 2 and publishes map, transform, pose and state. No ROS needed. Ctrl-C ends it and "
        "writes the results.",
    )
    cli.add_algorithm_options(p)
    p.add_argument(
        "--out", metavar="DIR", help="folder of the results (default: results/live-<algorithm>)"
    )
    p.add_argument("--record", metavar="FILE.mcap", help="record all messages in and out to a bag")
    p.add_argument("-q", "--quiet", action="store_true", help="print no notes and no status line")
    add_state_options(p)
    _add_topics(p)
    _add_frames(p)
    add_network_options(p)
    return p


def _add_topics(p: argparse.ArgumentParser) -> None:
    group, usual = p.add_argument_group("topics"), Topics()
    odometry = "odometry: auto (tf if it has the odometry's frame, else /odom), tf, a topic or none"
    scans = "subscribed scans (default: /scan); given several times: lasers used together"
    group.add_argument("--scan-topic", metavar="TOPIC", action="append", help=scans)
    path = f"path, published after a closed loop (default: {usual.path})"
    for flag, default, text in (
        ("--odom", "auto", odometry),
        ("--imu", usual.imu, f"subscribed gyro and attitude, or none (default: {usual.imu})"),
        ("--map-topic", usual.map, f"published map (default: {usual.map})"),
        ("--path-topic", usual.path, path),
        ("--pose-topic", usual.pose, f"published pose (default: {usual.pose})"),
        ("--state-topic", usual.state, f"published state (default: {usual.state})"),
    ):
        group.add_argument(flag, metavar="TOPIC", default=default, help=text)


def _add_frames(p: argparse.ArgumentParser) -> None:
    group, usual = p.add_argument_group("frames and times"), NodeOptions()
    frames = {
        "map_frame": "frame of map and poses",
        "odom_frame": "frame of the odometry",
        "base_frame": "frame of the robot, whose poses are published (default: that of the "
        "odometry, else base_link)",
    }
    times = {
        "map_every": "time between two published maps [s], 0 for none",
        "wait": "how long a scan waits for odometry and gyro at most [s]",
        "tf_ahead": "how far ahead of its scan a transform is stamped [s]",
    }
    for name, text in (frames | times).items():
        value, flag = getattr(usual, name), f"--{name.replace('_', '-')}"
        kind, unit = (float, "S") if name in times else (str, "FRAME")
        shown = text if value is None else f"{text} (default: {value})"
        group.add_argument(flag, type=kind, metavar=unit, default=value, help=shown)
    group.add_argument(
        "--queue",
        type=int,
        metavar="N",
        default=usual.queue,
        help="how many scans wait at most; older ones are left out (default: %(default)s)",
    )


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
    from slams.live.diagnostics import Terminal
    from slams.live.results import delays, write_results
    from slams.live.slam import LiveSlam

    def begun() -> LiveSlam:
        """The algorithm, new, from a state, or in a map that stays; compiled."""
        saved, given, values = arguments.resume_state, arguments.localize, params.as_dict()
        live = LiveSlam(entry.label, state=saved, map=given, map_start=start, **values)
        if arguments.save_state:
            live.check_saving(arguments.save_state)
        return live

    options = cli.refusing(lambda: node_options(arguments))
    folder = Path(arguments.out or f"results/live-{entry.label.replace(':', '.')}")
    cli.refusing(lambda: check_folder(folder))
    terminal = Terminal(PROGRAM, arguments.quiet)
    start = cli.refusing(lambda: given_start(arguments))
    ending = _ending()
    transport = cli.refusing(lambda: transport_of(arguments))
    live = cli.refusing(begun)
    node = _drive(live, transport, options, terminal, arguments.record, ending)
    if not node.drive.t:
        raise RuntimeError(_why_nothing(node))
    if arguments.save_state:
        cli.refusing(lambda: live.save(arguments.save_state))
    cli.refusing(lambda: write_results(folder, entry.label, live.params, node))
    if not arguments.quiet:
        dropped = node.scans.counts["dropped"]
        spent = ", ".join(f"{name} {value} ms" for name, value in delays(node.drive).items())
        sys.stdout.write(
            f"{len(node.drive.t)} scans, {dropped} left out; "
            f"from scan to pose: {spent}\n{folder}/: {', '.join(files_of_run(folder))}\n"
        )
    return 0


def _why_nothing(node: Node) -> str:
    """Why there is no pose."""
    sought = node.drive.counts["sought"]
    if not sought:
        return "ended before the first scan; nothing is written"
    return (
        f"its place in the map is not sure after {sought} scans ({node.live.candidates}); expected "
        "a drive that leaves alike places, or --start; nothing is written"
    )


def node_options(arguments: argparse.Namespace) -> NodeOptions:
    """The options of topics, frames and times.

    Raises:
        ValueError: a number is out of its bounds, or means nothing.
    """
    usual, odom = Topics(), arguments.odom
    if arguments.localize and arguments.map_every != NodeOptions.map_every:
        raise ValueError("--map-every: got --localize, too, whose map is published once")
    named, imu = odom not in ("auto", "tf", "none"), arguments.imu != "none"
    topics = Topics(
        scans=tuple(map(_absolute, arguments.scan_topic or usual.scans)),
        odom=_absolute(odom) if named else usual.odom,
        imu=_absolute(arguments.imu) if imu else usual.imu,
        map=_absolute(arguments.map_topic),
        path=_absolute(arguments.path_topic),
        pose=_absolute(arguments.pose_topic),
        state=_absolute(arguments.state_topic),
    )
    same = ("map_frame", "odom_frame", "base_frame", "queue", "wait", "map_every", "tf_ahead")
    values = {name: getattr(arguments, name) for name in same}
    return NodeOptions(topics, odometry="topic" if named else odom, imu=imu, **values)


def _absolute(topic: str) -> str:
    return topic if topic.startswith("/") else f"/{topic}"


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
    transport: Transport,
    options: NodeOptions,
    terminal: Terminal,
    record: str | None,
    ending: threading.Event,
) -> Node:
    """Take scans until the end."""
    from slams.live.node import Node
    from slams.live.recorder import Recorder

    node = cli.refusing(lambda: Node(live, transport, options, terminal.say))
    gc.collect()
    gc.freeze()  # no search for garbage among all that was loaded while a scan waits
    try:
        if record is not None:
            node.recorder = cli.refusing(lambda: Recorder(record, options.topics))
        node.start(ending)
        node.run(ending, lambda: terminal.show_status(node))
    finally:
        terminal.end()
        node.close()
        if node.recorder is not None:
            recorder, driven = node.recorder, bool(node.drive.t)
            cli.refusing(lambda: recorder.close(keep=driven))
    return node


if __name__ == "__main__":
    sys.exit(main())
