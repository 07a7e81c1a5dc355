"""What the commands share: one thread, one sentence for bad input, log options, progress."""

from __future__ import annotations

import argparse
import io
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from slams.formats.options import SourceOptions
from slams.params import LASERS
from slams.registry import names
from slams.validation import expect

T = TypeVar("T")

USAGE, FAILED, INTERRUPTED, TERMINATED = 2, 1, 130, 143
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class RefusedError(Exception):
    """Bad input, said in one sentence; ends a command with exit code 2."""


class TerminatedError(BaseException):
    """SIGTERM came; like `KeyboardInterrupt` nothing but the command itself catches it."""


class Parser(argparse.ArgumentParser):
    """Arguments that do not fit get one sentence; an option is known by its whole name alone."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(allow_abbrev=False, **settings)

    def error(self, message: str) -> NoReturn:
        """Refuse the arguments."""
        raise RefusedError(f"{message} (see {self.prog} --help)")


def refusing(work: Callable[[], T]) -> T:
    """Run a step that reads what the user gave; its errors become `RefusedError`."""
    try:
        return work()
    except KeyError:
        raise
    except (LookupError, ValueError, TypeError, OSError) as error:
        raise RefusedError(sentence(error)) from error


def sentence(error: BaseException) -> str:
    """An exception in one line."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror.lower()}"
    return " ".join(str(error).split()) or type(error).__name__


def run_command(program: str, command: Callable[[], int]) -> int:
    """Exit code of a command: errors the user can act on become one line on stderr.

    Every library uses one thread: CPU times mean little else. SIGTERM ends the command as Ctrl-C
    does: its processes are ended, what is half-written is removed.
    """
    os.environ.update(dict.fromkeys(THREADS, "1"))
    _settle_output()
    _reach_own_modules()
    try:
        with _heeding_termination():
            return command()
    except RefusedError as refused:
        return _say(program, str(refused), USAGE)
    except RuntimeError as error:
        return _say(program, sentence(error), FAILED)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except KeyboardInterrupt:
        return _say(program, "interrupted", INTERRUPTED)
    except TerminatedError:
        return _say(program, "terminated", TERMINATED)


def main_of(
    parser: Callable[[], argparse.ArgumentParser], command: Callable[[argparse.Namespace], int]
) -> Callable[..., int]:
    """The `main` of a command: runs it with the words behind its name; returns its exit code.

    The arguments have these `words` and the name of the `program`, too.
    """

    def main(argv: list[str] | None = None) -> int:
        made, words = parser(), sys.argv[1:] if argv is None else argv
        given = argparse.Namespace(words=words, program=made.prog)
        return run_command(made.prog, lambda: command(made.parse_intermixed_args(words, given)))

    return main


def _terminate(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    raise TerminatedError


@contextmanager
def _heeding_termination() -> Iterator[None]:
    """The first SIGTERM raises `TerminatedError`; a second one ends the process on the spot."""
    if threading.current_thread() is not threading.main_thread():  # signals are not for others
        yield
        return

    before = signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _settle_output() -> None:
    """Names of files that are not UTF-8 are printed as they are; matplotlib does without a home."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="surrogateescape")
    logging.getLogger("matplotlib").setLevel(logging.ERROR)


def _reach_own_modules() -> None:
    """`mine:Icp` is found in the folder one is in, by the installed commands as by python -m.

    At the end of the path: nothing there takes the place of an installed package.
    """
    here = str(Path.cwd())
    if not sys.flags.safe_path and here not in sys.path:
        sys.path.append(here)


def add_algorithm_options(parser: argparse.ArgumentParser) -> None:
    """Give a command the algorithm and the options of its parameters, for `slams.run.chosen`."""
    known = f"one of {', '.join(names())}; name@preset; or module:Class"
    parser.add_argument("algorithm", help=known)
    parser.add_argument(
        "--sensor", metavar="NAME", help=f"parameters for this laser: {', '.join(LASERS)}"
    )
    parser.add_argument(
        "--ros-params",
        metavar="FILE",
        action="append",
        default=[],
        help="launch or parameter file of the original's ROS node; may be given again",
    )
    parser.add_argument(
        "--params", metavar="FILE.yaml", help="file of parameters, lines 'name: value'"
    )
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        dest="changes",
        help="set one parameter; may be given again",
    )
    parser.add_argument(
        "--show-params", action="store_true", help="print all parameters, run nothing"
    )
    parser.add_argument("--seed", type=int, metavar="N", help="seed of every random draw")


def count(text: str) -> int:
    """The value of an option that is 1 or more."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"got {value}, expected 1 or more")
    return value


def add_selection_options(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of what it uses of a log, for `ScanLog.select`."""
    parser.add_argument(
        "--no-odometry", action="store_true", help="ignore the odometry and gyro of the log"
    )
    parser.add_argument("--limit", type=count, metavar="N", help="use the first N scans only")
    parser.add_argument(
        "--every", type=count, default=1, metavar="K", help="use every K-th scan only"
    )


def add_log(parser: argparse.ArgumentParser, number: str = "+") -> None:
    """Give a command the files of a recorded log, for `slams.load`, and the options of reading."""
    known = "scan log: npz, ROS bag (all files of a split one) or CARMEN log"
    parser.add_argument("log", nargs=number, help=known)
    add_log_options(parser)


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of what to take from a recorded log."""
    group = parser.add_argument_group(
        "reading a log",
        "A log is an npz, a ROS 1 or ROS 2 bag or a CARMEN log; its content tells which. These "
        "options are needed only where the log leaves a choice.",
    )
    for option in fields(SourceOptions):
        if option.metadata:
            group.add_argument(f"--{option.name.replace('_', '-')}", **option.metadata)


def log_options(arguments: argparse.Namespace) -> SourceOptions:
    """What the options of `add_log_options` say, for `slams.load`.

    Raises:
        ValueError: they choose an odometry that is ignored.
    """
    if getattr(arguments, "no_odometry", False) and (arguments.odom or arguments.imu):
        raise ValueError("--no-odometry: got --odom or --imu, too; expected one of them")
    given = {f.name: getattr(arguments, f.name, None) for f in fields(SourceOptions)}
    topics = tuple(arguments.scan_topic or ())
    lasers = {"scan_topic": topics[0] if topics else None, "more_scan_topics": topics[1:]}
    return SourceOptions(**given | lasers)


def assignment(text: str) -> tuple[str, str]:
    """Name and value of a `--set KEY=VALUE`.

    Raises:
        ValueError: it has no "=".
    """
    key, equals, value = text.partition("=")
    expect(bool(equals), "--set", repr(text), "KEY=VALUE")
    return key.strip(), value.strip()


def show_notes(arguments: argparse.Namespace, notes: Iterable[str]) -> None:
    """What a reader has to say about a log: a line each on stderr, unless -q was given."""
    if not arguments.quiet:
        for note in notes:
            sys.stderr.write(f"{arguments.program}: note: {note}\n")


def progress(
    items: Iterable[T], total: int, what: str, quiet: bool, unit: str = "scan"
) -> Iterable[T]:
    """The items, with a bar on stderr if that is a terminal."""
    from tqdm import tqdm

    silent = quiet or not sys.stderr.isatty()
    return tqdm(items, total=total, desc=what, unit=unit, disable=silent, leave=False)


def _say(program: str, message: str, code: int) -> int:
    sys.stderr.write(f"{program}: {message}\n")
    return code
