"""Option --jobs: how many processes do the work of a command. Light: help reads it."""

from __future__ import annotations

import argparse
import os

JOBS = min(2, os.cpu_count() or 1)


def add_option(parser: argparse.ArgumentParser) -> None:
    """Give a command --jobs; the results do not depend on it."""
    words = "number of processes (default: %(default)s)"
    parser.add_argument("--jobs", type=int, metavar="N", default=JOBS, help=words)


def check(jobs: int) -> None:
    """Refuse a number of processes that cannot be.

    Raises:
        ValueError: it is less than 1.
    """
    if jobs < 1:
        raise ValueError(f"--jobs: got {jobs}, expected 1 or more")
