"""slams ablation: the effect of each mechanism of an algorithm, switched off alone.

The switches are declared in the parameters. The sweep's drives are repeated with each switch, and
each run is compared with the run of the unchanged algorithm.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from bench import sweep
from bench.run import options, single
from slams import cli

if TYPE_CHECKING:
    import pandas as pd

    from bench.results.sweep import Sweep

UNCHANGED_ROW = "all"  # of the unchanged algorithm


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams ablation",
        description="Set every switch of an algorithm to its other value, one at a time, and count "
        "the levels of the sweep's degradations that its runs hold.",
        epilog="Writes ablation.md, ablation.csv and sweep.json. p is McNemar's exact test over "
        "the drives: whether a drive held more levels with the switch or without. Finished runs "
        "are kept in OUT/runs: an interrupted ablation continues from them.",
    )
    p.add_argument("algorithm", metavar="ALGORITHM", help=single.LABEL_WORDS)
    sweep.add_drive_options(p)
    p.set_defaults(seeds=sweep.N_DRIVES)
    options.add_output(p, "ablation-ALGORITHM")
    options.add_jobs(p)
    return p


def _command(arguments: argparse.Namespace) -> int:
    from bench.report.text import markdown_table, text_table
    from bench.results import sweep as results
    from bench.run import folder as folders
    from slams.formats import files

    if arguments.degradations == ["list"]:
        sys.stdout.write(sweep.listed())
        return 0
    rows = cli.refusing(lambda: rows_of(arguments.algorithm))
    defaults = vars(sweep.parser().parse_args([]))  # for options of the sweep only
    asked = defaults | vars(arguments) | {"algorithms": list(rows.values())}
    out = Path(
        arguments.out
        or folders.named_after("ablation", [re.sub("[.:@/]", "-", arguments.algorithm)])
    )
    found = sweep.swept(argparse.Namespace(**asked), out)
    made, lost = table(found, rows), f"lost = {found.facts['lost']}"
    with files.complete_folder(out) as folder:
        results.save(folder, found)
        made.to_csv(folder / "ablation.csv", index_label=arguments.algorithm)
        command = f"`{found.record['command']}`, on {found.record['machine']['cpu']}"
        body = markdown_table(made, arguments.algorithm)
        (folder / "ablation.md").write_text(f"{command}: {lost}.\n\n{body}\n", encoding="utf-8")
        folders.cleared(out, sweep.OUTPUT_FILES)
    if not arguments.quiet:
        files_made = f"{out}/: ablation.md, ablation.csv, sweep.json"
        sys.stdout.write(f"{lost}\n\n{text_table(made, arguments.algorithm)}\n\n{files_made}\n")
    return cli.EXIT_FAILED if all(trial["failed"] for trial in found.trials) else 0


def rows_of(label: str) -> dict[str, str]:
    """The rows of the table with their variants: the unchanged algorithm, then every switch.

    Raises:
        LookupError: no such algorithm, or no switch.
    """
    from slams.params import setting_text

    params = single.params_of(label)
    switches = [name for name, spec in params.specs().items() if spec.switch]
    others = {name: setting_text(not getattr(params, name)) for name in switches}
    if not others:
        raise LookupError(
            f"{label}: has no switch, expected parameters declared with switch=True (slams.params)"
        )
    variants = {f"{n}={v}": single.variant(label, **{n: v}) for n, v in others.items()}
    return {UNCHANGED_ROW: label, **variants}


def table(found: Sweep, rows: dict[str, str]) -> pd.DataFrame:
    """A line per row: levels held and error by sensors, cost, the p-value."""
    import pandas as pd

    from bench.judge import survival
    from bench.judge.statistics import mcnemar
    from bench.report.lines import scaled
    from bench.report.sweep_tables import MODES

    modes = [mode for mode in MODES if any(trial["odometry"] == mode for trial in found.trials)]
    held = {mode: survival.held(found.trials, mode, found.facts["levels"]) for mode in modes}
    lines: dict[str, dict[str, object]] = {}
    for name, label in rows.items():
        own = {MODES[mode]: survival.figures(found, label, mode) for mode in modes}
        # levels held by each drive, over laser alone and with odometry
        before, now = (
            {drive: sum(held[m][row].get(drive, 0) for m in modes) for drive in held[modes[0]][row]}
            for row in (rows[UNCHANGED_ROW], label)
        )
        lines[name] = {
            **{f"levels held, {w}": "{} of {}".format(*of.levels) for w, of in own.items()},
            **{
                f"1 s, {words} [mm]": scaled(figures.second_m, 1e3)
                for words, figures in own.items()
            },
            "CPU a scan [ms]": scaled(next(iter(own.values())).cpu_scan, 1e3),
            "p": None if name == UNCHANGED_ROW else f"{mcnemar(*survival.votes(before, now)):.2g}",
        }
    return pd.DataFrame.from_dict(lines, orient="index")


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
