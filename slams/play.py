"""slams play: publish a log by ROS 2 in real time, as a robot would."""

from __future__ import annotations

import argparse
import gc
import math
import signal
import sys
import threading
import time
from typing import TYPE_CHECKING

from slams import cli
from slams.live.network import add_network_options, transport_of
from slams.live.options import NodeOptions, topic_names
from slams.validation import expect

if TYPE_CHECKING:
    from slams.live.robot import DueMessage
    from slams.live.transport import Transport
    from slams.scanlog import ScanLog

MIN_RATE = 0.01  # a log of years still fits the clock's waiting time


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams play",
        description="Publish a log by ROS 2 as a robot would, in real time: /scan, /tf_static, "
        "and /odom, /tf and /imu where the log has them. No ROS needed.",
    )
    p.add_argument("--rate", type=float, default=1.0, metavar="X", help="play X times as fast")
    p.add_argument("--limit", type=cli.count, metavar="N", help="publish the first N scans only")
    p.add_argument("--no-odometry", action="store_true", help="publish no odometry and no gyro")
    p.add_argument(
        "--wait-for-subscriber",
        type=float,
        default=5.0,
        metavar="S",
        help="longest time to wait for a subscriber [s] (default: %(default)g)",
    )
    p.add_argument("-q", "--quiet", action="store_true", help="print no notes and no progress")
    cli.add_log(p)
    add_network_options(p)
    return p


def _command(arguments: argparse.Namespace) -> int:
    log = cli.refusing(lambda: _log(arguments))
    cli.show_notes(arguments, log.notes)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    transport = cli.refusing(lambda: transport_of(arguments))
    try:
        sent = _play(log, transport, arguments, stop)
    finally:
        transport.close()
    if not arguments.quiet:
        sys.stdout.write(f"{sent} scans of {log.name} published\n")
    return 0


def _log(arguments: argparse.Namespace) -> ScanLog:
    from slams.formats.source import load

    wait, rate = arguments.wait_for_subscriber, arguments.rate
    expect(0.0 <= wait < math.inf, "--wait-for-subscriber", f"{wait:g}", "0 s or more")
    expect(MIN_RATE <= rate < math.inf, "--rate", f"{rate:g}", f"{MIN_RATE:g} or more")
    log = load(arguments.log, cli.log_options(arguments)).of_one_laser()
    return log.select(arguments.limit, 1, not arguments.no_odometry)


def until_last_scan(schedule: list[DueMessage]) -> list[DueMessage]:
    """The messages up to the last scan, and those after it that a node may wait for."""
    end = max(due.t for due in schedule if due.topic == "/scan") + NodeOptions.wait
    return [due for due in schedule if due.t <= end]


def _play(
    log: ScanLog, transport: Transport, arguments: argparse.Namespace, stop: threading.Event
) -> int:
    """Publish the log; returns the number of scans."""
    from slams.live.robot import DELIVERY_TIME, Robot

    robot = cli.refusing(lambda: Robot(log, transport, topic_names(arguments.remap)))
    transport.listen()
    if not robot.await_subscriber(arguments.wait_for_subscriber, stop):
        cli.show_notes(arguments, ["no subscriber to the scans yet; they are published anyway"])
    gc.collect()
    gc.freeze()  # garbage collection over all scans would delay messages
    schedule = robot.schedule if arguments.limit is None else until_last_scan(robot.schedule)
    sent, start = 0, time.monotonic()
    for due in cli.progress(schedule, len(schedule), "playing", arguments.quiet, ""):
        if stop.wait(start + due.t / arguments.rate - time.monotonic()):
            break
        robot.send(due)
        sent += due.topic == "/scan"
    stop.wait(DELIVERY_TIME)
    return sent


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
