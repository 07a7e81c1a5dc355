"""slams convert LOG OUT.npz: convert a recorded log of any kind to a scan log npz."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from slams import cli
from slams.formats.files import check_new_file
from slams.info import described


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams convert",
        description="Convert a recorded log to one npz file, which loads fast.",
    )
    p.add_argument("-q", "--quiet", action="store_true", help="print errors only")
    p.add_argument("--force", action="store_true", help="replace files that exist")
    cli.add_log(p)
    p.add_argument("out", type=Path, metavar="OUT.npz", help="the scan log to write")
    return p


def _command(arguments: argparse.Namespace) -> int:
    from slams.formats.source import load

    cli.refusing(lambda: check_new_file(arguments.out, arguments.force, ".npz"))
    log = cli.refusing(lambda: load(arguments.log, cli.log_options(arguments)))
    cli.show_notes(arguments, log.notes)
    cli.refusing(lambda: log.save(arguments.out))
    if not arguments.quiet:
        sys.stdout.write(f"{described(log)}\n{arguments.out}\n")
    return 0


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
