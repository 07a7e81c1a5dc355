"""slams check: does an algorithm keep the contract of `slams.types.Slam`?

It takes some seconds and writes no files.
"""

from __future__ import annotations

import argparse
import sys

from slams import cli
from slams.registry import Entry, find


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams check",
        description="Check that an algorithm keeps the contract of slams.types.Slam.",
        epilog="Prints a line per clause; exit code 0 if all hold, else 1.",
    )
    p.add_argument(
        "algorithm",
        nargs="+",
        help="name, name@preset or module:Class; without @preset every preset is checked",
    )
    return p


def _command(arguments: argparse.Namespace) -> int:
    from slams.contract import CLAUSES, broken

    entries = cli.refusing(lambda: [e for label in arguments.algorithm for e in _all(label)])
    failed = 0
    for entry in entries:
        sys.stdout.write(f"{entry.label}\n")
        for name, clause in CLAUSES.items():
            sentence = broken(entry, clause)
            failed += sentence is not None
            text = f"ok      {name}" if sentence is None else f"FAILED  {name}: {sentence}"
            sys.stdout.write(f"  {text}\n")
            sys.stdout.flush()
    return cli.EXIT_FAILED if failed else 0


def _all(label: str) -> list[Entry]:
    """The entry of a label; of a label without a preset all presets."""
    entry = find(label)
    others = [] if "@" in label else entry.cls.Params.presets()[1:]
    return [entry, *(find(f"{label}@{preset}") for preset in others)]


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
