"""python -m slams.run: one algorithm over one log, with map, trajectory and summary."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from slams import cli
from slams.registry import names

if TYPE_CHECKING:
    from slams.params import Params
    from slams.player import Run
    from slams.registry import Entry
    from slams.scanlog import ScanLog
    from slams.types import Slam

PROGRAM = "slams.run"
WARM_UP_SCANS = 4


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog=f"python -m {PROGRAM}",
        description="Replay every scan of a log through one SLAM algorithm, in order.",
        epilog="Writes trajectory.csv, trajectory.tum, map.pgm + map.yaml, map.png, summary.json.",
    )
    p.add_argument("algorithm", help=f"one of {', '.join(names())}; name@preset; or module:Class")
    p.add_argument("log", nargs="?", help="scan log, scans.npz")
    p.add_argument("--out", metavar="DIR", help="default: results/<log>-<algorithm>")
    p.add_argument("--preset", metavar="NAME", help="as name@preset, e.g. original")
    p.add_argument("--params", metavar="FILE.yaml", help="parameters, lines 'name: value'")
    p.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        dest="changes",
        help="one parameter; may be given again",
    )
    p.add_argument("--show-params", action="store_true", help="print all parameters and end")
    p.add_argument("--no-odometry", action="store_true", help="hide odometry and gyro")
    p.add_argument("--limit", type=int, metavar="N", help="only N scans")
    p.add_argument("--every", type=int, default=1, metavar="K", help="only every K-th scan")
    p.add_argument("--seed", type=int, metavar="N", help="seed of every random draw")
    p.add_argument("-q", "--quiet", action="store_true", help="no progress bar, no summary")
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    cli.one_thread()
    return cli.run_command(PROGRAM, lambda: _command(parser().parse_args(argv)))


def _command(arguments: argparse.Namespace) -> int:
    entry, params = cli.refusing(lambda: chosen(arguments))
    if arguments.show_params:
        sys.stdout.write(parameter_table(params))
        return 0
    log = cli.refusing(lambda: _log(arguments))
    slam, run, start_up_s = _replayed(entry, params, log, arguments.quiet)
    folder = Path(arguments.out or f"results/{log.name}-{entry.label.replace(':', '.')}")
    text = cli.refusing(lambda: write_results(folder, entry, params, log, slam, run, start_up_s))
    if not arguments.quiet:
        sys.stdout.write(
            f"{text}\n{folder}/: map.png, map.pgm + map.yaml, trajectory.csv, "
            "trajectory.tum, summary.json\n"
        )
    return 0


def chosen(arguments: argparse.Namespace) -> tuple[Entry, Params]:
    """The algorithm and its parameters: defaults < preset < YAML file < --set < --seed."""
    from slams.registry import find

    label = arguments.algorithm
    if arguments.preset:
        label = f"{label.partition('@')[0]}@{arguments.preset}"
    entry = find(label)
    params = entry.params()
    if arguments.params:
        params = params.with_yaml(arguments.params)
    params = params.replace(**dict(_assignment(text) for text in arguments.changes))
    if arguments.seed is not None:
        params = params.replace(seed=arguments.seed)
    return entry, params


def parameter_table(params: Params) -> str:
    """All parameters as YAML that `--params` reads back, with unit, meaning and source."""
    rows = params.table()
    width = max(len(f"{name}: {value}") for name, value, *_ in rows)
    lines = [
        f"{f'{name}: {value}':{width}}  # [{unit}] {meaning} ({source})"
        for name, value, unit, meaning, source in rows
    ]
    return "\n".join(lines) + "\n"


def write_results(
    folder: Path,
    entry: Entry,
    params: Params,
    log: ScanLog,
    slam: Slam,
    run: Run,
    start_up_s: float,
) -> str:
    """Write all files of a run to `folder`, whole or not at all; returns the summary as text."""
    from slams.formats import files, occupancy, trajectory
    from slams.summary import as_json, as_text, summarize

    summary = summarize(run, log, entry.label, params, start_up_s)
    grid = slam.map()
    with files.complete_folder(folder) as partial:
        trajectory.write_csv(partial / "trajectory.csv", run.t, run.poses)
        trajectory.write_tum(partial / "trajectory.tum", run.t, run.poses)
        occupancy.write_map(partial, grid)
        occupancy.write_picture(partial / "map.png", grid, run.poses)
        (partial / "summary.json").write_text(as_json(summary), encoding="utf-8")
    return as_text(summary)


def _log(arguments: argparse.Namespace) -> ScanLog:
    from slams.scanlog import load

    if arguments.log is None:
        raise ValueError(f"no log given; expected {PROGRAM} {arguments.algorithm} scans.npz")
    for name in ("limit", "every"):
        value = getattr(arguments, name)
        if value is not None and value < 1:
            raise ValueError(f"--{name}: got {value}, expected 1 or more")
    log = load(arguments.log)
    return log.select(arguments.limit, arguments.every, not arguments.no_odometry)


def _replayed(entry: Entry, params: Params, log: ScanLog, quiet: bool) -> tuple[Slam, Run, float]:
    from slams.player import replay, warm_up

    start_up_s = warm_up(entry.cls, params, log.select(WARM_UP_SCANS))
    slam = entry.cls(params)
    scans = cli.progress(log, len(log), entry.label, quiet)
    return slam, replay(slam, scans), start_up_s


def _assignment(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals:
        raise ValueError(f"--set: got {text!r}, expected KEY=VALUE")
    return key.strip(), value.strip()


if __name__ == "__main__":
    sys.exit(main())
