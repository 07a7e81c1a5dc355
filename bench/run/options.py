"""Options of several commands of the benchmark. Imports stay fast for --help."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable

from slams import cli

DEFAULT_JOBS = min(2, os.cpu_count() or 1)


def add_jobs(parser: argparse.ArgumentParser) -> None:
    """Add --jobs; the results do not depend on it."""
    words = "number of processes (default: %(default)s)"
    parser.add_argument("--jobs", type=cli.count, metavar="N", default=DEFAULT_JOBS, help=words)


def add_output(parser: argparse.ArgumentParser, default: str) -> None:
    """Add --out, --force and -q."""
    out = f"folder of the results (default: results/{default})"
    parser.add_argument("--out", metavar="DIR", help=out)
    force = "replace the results of other settings in the folder; finished runs are kept"
    parser.add_argument("--force", action="store_true", help=force)
    parser.add_argument(
        "-q", "--quiet", action="store_true", help="print no progress and no tables"
    )


def within(kind: type, low: float, high: float) -> Callable[[str], float]:
    """A reader for options that are numbers from `low` to `high`."""

    def _read(text: str) -> float:
        value: float = kind(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"got {value:g}, expected {low:g} to {high:g}")
        return value

    _read.__name__ = kind.__name__  # argparse shows it in its error message
    return _read
