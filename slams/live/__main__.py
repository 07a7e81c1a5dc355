"""slams live: run an algorithm on a robot; ROS 2 scans in, map and transforms out."""

from __future__ import annotations

import argparse
import gc
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from slams import cli, run
from slams.live.network import add_network_options, transport_of
from slams.live.options import add_node_options, node_options

if TYPE_CHECKING:
    from slams.live.diagnostics import Terminal
    from slams.live.node import Node
    from slams.params import Params


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams live",
        description="Run one SLAM algorithm on a robot: it subscribes to scans, odometry, gyro and "
        "tf by ROS 2 and publishes map, transform, pose and state. No ROS is needed. Ctrl-C ends "
        "the node and writes the results.",
    )
    cli.add_algorithm_options(p)
    p.add_argument(
        "--out",
        metavar="DIR",
        help="folder of the results (default: results/live-<algorithm>, with -2, -3, ... where "
        "that exists)",
    )
    p.add_argument("--force", action="store_true", help="replace files that exist")
    p.add_argument("--record", metavar="FILE.mcap", help="record all messages in and out to a bag")
    p.add_argument("-q", "--quiet", action="store_true", help="print no notes and no status line")
    run.add_state_options(p)
    add_node_options(p)
    add_network_options(p)
    return p


def _command(arguments: argparse.Namespace) -> int:
    entry, params, _ = cli.refusing(lambda: run.chosen(arguments))
    if arguments.show_params:
        sys.stdout.write(run.parameter_table(params))
        return 0
    from slams.live.diagnostics import Terminal

    folder = cli.refusing(lambda: _folder(entry.label, arguments))
    terminal, ending = Terminal(arguments), _end_event()
    node = cli.refusing(lambda: _node(arguments, entry.label, params, terminal))
    gc.collect()
    gc.freeze()  # later collections skip what is loaded by now: they would delay a scan
    outputs: list[Callable[[], None]] = [node.close]
    try:
        node.start(ending)
        node.run(ending, lambda: terminal.show_status(node))
        if node.drive.t:
            outputs.append(lambda: write_results(folder, entry.label, node))
            if arguments.save_state:
                outputs.append(lambda: node.live.save(arguments.save_state))
    finally:
        terminal.end()
        cli.refusing_each(outputs)
    if not node.drive.t:
        searched, reason = node.scans.counts["sought"], "ended before the first scan"
        if searched:
            reason = f"not localized in the map after {searched} scans ({node.live.candidates})"
        raise RuntimeError(f"{reason}; nothing is written")
    if not arguments.quiet:
        dropped = node.scans.counts["dropped"]
        delays = ", ".join(f"{name} {value} ms" for name, value in node.drive.delay_ms().items())
        sys.stdout.write(
            f"{len(node.drive.t)} scans, {dropped} left out; "
            f"from scan to pose: {delays}\n{folder}/: {', '.join(run.files_of_run(folder))}\n"
        )
    return 0


def _folder(label: str, arguments: argparse.Namespace) -> Path:
    """The folder of the results; files are replaced only by --force."""
    from slams.formats import files

    folder = Path(arguments.out or f"results/live-{label.replace(':', '.')}")
    if arguments.out is None and not arguments.force:
        folder = files.unused(folder)
    run.check_results(folder, arguments)
    if arguments.record is not None:
        files.check_new_file(arguments.record, arguments.force, ".mcap")
    return folder


def _node(arguments: argparse.Namespace, label: str, params: Params, terminal: Terminal) -> Node:
    """The node with compiled kernels; its algorithm is new, resumed, or localizes in a map."""
    from slams.live.node import Node
    from slams.live.recorder import Recorder
    from slams.live.slam import LiveSlam

    options, start = node_options(arguments), run.given_start(arguments)
    transport = transport_of(arguments)
    saved, given = arguments.resume_state, arguments.localize
    values = params.as_dict() if run.are_given(arguments) else {}
    live = LiveSlam(label, state=saved, map=given, map_start=start, **values)
    if arguments.save_state:
        live.check_saving(arguments.save_state)
    node = Node(live, transport, options, terminal.notify)
    if arguments.record is not None:
        node.recorder = Recorder(arguments.record, options)
    return node


def write_results(folder: Path, label: str, node: Node) -> None:
    """Write map, trajectory and summary, all of them or none.

    Raises:
        OSError: a file cannot be written.
    """
    import numpy as np

    live, drive = node.live, node.drive
    summary = {
        "algorithm": label,
        "params": live.params.as_dict(),
        "delay_ms": drive.delay_ms(),
        "node": node.report(),
    }
    poses = np.array(drive.poses, np.float64).reshape(-1, 3)
    run.write_drive(folder, live.map(), (np.array(drive.t), poses, live.corrected()), summary)


def _end_event() -> threading.Event:
    """The event that Ctrl-C, SIGTERM and SIGHUP set; a second Ctrl-C interrupts without results."""
    ending = threading.Event()

    def end(*_: object) -> None:
        """Ask the node to end."""
        ending.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)

    hangup = getattr(signal, "SIGHUP", signal.SIGTERM)  # Windows has none
    for number in (signal.SIGINT, signal.SIGTERM, hangup):
        if number != hangup or signal.getsignal(hangup) != signal.SIG_IGN:  # as nohup sets it
            signal.signal(number, end)
    return ending


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
