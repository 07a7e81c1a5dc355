"""Shared by the commands: exit codes, messages about bad input, options of logs, progress."""

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
from itertools import pairwise
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from slams.formats.options import SourceOptions
from slams.params import LASER_MODELS
from slams.registry import names
from slams.validation import expect

T = TypeVar("T")

EXIT_REFUSED, EXIT_FAILED, EXIT_INTERRUPTED, EXIT_TERMINATED = 2, 1, 130, 143
THREAD_VARIABLES = tuple(f"{name}_NUM_THREADS" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA"))


class RefusedError(Exception):
    """Bad input, described in one sentence; ends a command with exit code 2."""


class TerminatedError(BaseException):
    """Raised by SIGTERM; like `KeyboardInterrupt` it is caught by the command only."""


class Parser(argparse.ArgumentParser):
    """Parser that reports an error in one sentence and takes no abbreviated options."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(allow_abbrev=False, **settings)

    def error(self, message: str) -> NoReturn:
        """Raise `RefusedError`."""
        raise RefusedError(f"{message} (see {self.prog} --help)")


def refusing(work: Callable[[], T]) -> T:
    """Run a step that reads input of the user; its errors become `RefusedError`."""
    try:
        return work()
    except KeyError:
        raise
    except (LookupError, ValueError, TypeError, OSError) as error:
        raise RefusedError(sentence(error)) from error


def refusing_each(steps: Iterable[Callable[[], object]]) -> None:
    """Do every step, whatever the others raise; then raise their `RefusedError`s as one."""
    failures: list[Exception] = []
    for step in steps:
        try:
            refusing(step)
        except Exception as error:
            failures.append(error)
    for failure in failures:
        if not isinstance(failure, RefusedError):
            raise failure
    if failures:
        raise RefusedError("; ".join(map(str, failures))) from failures[0]


def sentence(error: BaseException) -> str:
    """The message of an exception in one line."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror.lower()}"
    return " ".join(str(error).split()) or type(error).__name__


def run_command(program: str, command: Callable[[], int]) -> int:
    """Run a command and return its exit code; errors of the user become one line on stderr.

    Every library uses one thread, so that CPU times can be compared. SIGTERM ends the command as
    Ctrl-C does: its processes are ended, and incomplete files are removed.
    """
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    _prepare_output()
    _add_working_folder()
    try:
        with _raising_on_sigterm():
            return command()
    except RefusedError as refused:
        return _say(program, str(refused), EXIT_REFUSED)
    except RuntimeError as error:
        return _say(program, sentence(error), EXIT_FAILED)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_FAILED
    except KeyboardInterrupt:
        return _say(program, "interrupted", EXIT_INTERRUPTED)
    except TerminatedError:
        return _say(program, "terminated", EXIT_TERMINATED)


def main_of(
    parser: Callable[[], argparse.ArgumentParser], command: Callable[[argparse.Namespace], int]
) -> Callable[..., int]:
    """The `main` of a command: it parses the words after the name and returns the exit code.

    The parsed arguments also contain these `words` and the name of the `program`.
    """

    def main(argv: list[str] | None = None) -> int:
        made, words = parser(), sys.argv[1:] if argv is None else argv
        given = argparse.Namespace(words=words, program=made.prog)

        def parse_and_run() -> int:
            """The command with its parsed arguments."""
            for before, word in pairwise([made.prog, *words]):
                if not word or (word.startswith("--") and word.endswith("=")):
                    made.error(f"{word[:-1] or before}: got an empty value")
            return command(made.parse_intermixed_args(words, given))

        return run_command(made.prog, parse_and_run)

    return main


def _terminate(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    raise TerminatedError


@contextmanager
def _raising_on_sigterm() -> Iterator[None]:
    """The first SIGTERM raises `TerminatedError`; a second one ends the process at once."""
    if threading.current_thread() is not threading.main_thread():  # it gets no signals
        yield
        return

    before = signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _prepare_output() -> None:
    """Print file names that are not UTF-8 unchanged; silence matplotlib without a home folder."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="surrogateescape")
    logging.getLogger("matplotlib").setLevel(logging.ERROR)


def _add_working_folder() -> None:
    """Import `mine:Icp` from the working folder, as `python -m` does.

    The folder comes last in the path, so that no file in it hides an installed package.
    """
    here = str(Path.cwd())
    if not sys.flags.safe_path and here not in sys.path:
        sys.path.append(here)


def add_algorithm_options(parser: argparse.ArgumentParser) -> None:
    """Add the algorithm and the options of its parameters, for `slams.run.chosen`."""
    known = f"one of {', '.join(names())}; name@preset; or module:Class"
    parser.add_argument("algorithm", help=known)
    parser.add_argument(
        "--sensor", metavar="NAME", help=f"parameters for this laser: {', '.join(LASER_MODELS)}"
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
    """Add the options that select scans of a log, for `ScanLog.select`."""
    parser.add_argument(
        "--no-odometry", action="store_true", help="ignore the odometry and gyro of the log"
    )
    parser.add_argument("--limit", type=count, metavar="N", help="use the first N scans only")
    parser.add_argument(
        "--every", type=count, default=1, metavar="K", help="use every K-th scan only"
    )


def add_log(parser: argparse.ArgumentParser, number: str = "+") -> None:
    """Add the files of a recorded log, for `slams.load`, and the options of reading it."""
    known = "scan log: npz, ROS bag (all files of a split one) or CARMEN log"
    parser.add_argument("log", nargs=number, help=known)
    add_log_options(parser)


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of reading a recorded log."""
    group = parser.add_argument_group(
        "reading a log",
        "A log is an npz, a ROS 1 or ROS 2 bag or a CARMEN log, recognized by its content. These "
        "options are needed only if the log is ambiguous.",
    )
    for option in fields(SourceOptions):
        if option.metadata:
            group.add_argument(f"--{option.name.replace('_', '-')}", **option.metadata)


def log_options(arguments: argparse.Namespace) -> SourceOptions:
    """The values of the options of `add_log_options`, for `slams.load`.

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
        ValueError: there is no "=".
    """
    key, equals, value = text.partition("=")
    expect(bool(equals), "--set", repr(text), "KEY=VALUE")
    return key.strip(), value.strip()


def show_notes(arguments: argparse.Namespace, notes: Iterable[str]) -> None:
    """Print the notes of a reader about a log on stderr, a line each, unless -q was given."""
    if not arguments.quiet:
        for note in notes:
            sys.stderr.write(f"{arguments.program}: note: {note}\n")


def progress(
    items: Iterable[T], total: int, what: str, quiet: bool, unit: str = "scan"
) -> Iterable[T]:
    """The items, with a progress bar on stderr if that is a terminal."""
    from tqdm import tqdm

    return tqdm(items, total=total, desc=what, unit=unit, disable=quiet or None, leave=False)


def _say(program: str, message: str, code: int) -> int:
    sys.stderr.write(f"{program}: {message}\n")
    return code
