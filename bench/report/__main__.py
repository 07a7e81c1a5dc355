"""slams report: draw the report, figures and tables of a folder of results again."""

from __future__ import annotations

import sys
from pathlib import Path

from slams import cli

PROGRAM = "slams report"


def parser() -> cli.Parser:
    """The command's arguments."""
    p = cli.Parser(
        prog=PROGRAM,
        description="Draw the report, figures and tables of a folder of results again.",
    )
    p.add_argument(
        "folders",
        nargs="+",
        type=Path,
        metavar="DIR",
        help="results of slams compare or slams sweep",
    )
    p.add_argument("-q", "--quiet", action="store_true", help="print no tables")
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""

    def _command() -> int:
        arguments = parser().parse_args(argv)
        for folder in arguments.folders:
            words = cli.refusing(lambda folder=folder: redraw(folder))  # type: ignore[misc]
            if not arguments.quiet:
                sys.stdout.write(f"{words}\n")
        return 0

    return cli.run_command(PROGRAM, _command)


def redraw(folder: Path) -> str:
    """Draw a folder's files from its results; returns the tables for the terminal.

    Raises:
        OSError: there are no results.
        ValueError: they are damaged or of another version.
    """
    from bench import results
    from bench.report import outputs, sweep_outputs, sweep_tables, text
    from bench.results import sweep
    from bench.run.folder import cleared
    from slams.formats import files

    if (folder / sweep.TRIALS).exists():
        found = sweep.read(folder)
        with files.complete_folder(folder) as partial:
            weighed = sweep_outputs.write(partial, found)
        return sweep_tables.terminal(weighed, found.facts)
    comparison = results.read(folder)
    with files.complete_folder(folder) as partial:
        outputs.write(partial, comparison)
        cleared(folder, outputs.DRAWN)
    return text.terminal(comparison)


if __name__ == "__main__":
    sys.exit(main())
