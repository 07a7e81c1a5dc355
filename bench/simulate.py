"""slams simulate OUT.npz: a scan log with ground truth, from arena, drive and sensor."""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from bench.sim.setting import Setting, kinds
from slams import cli

if TYPE_CHECKING:
    from slams.scanlog import ScanLog


def _command(options: argparse.Namespace) -> int:
    from bench.sim.simulation import picture, simulate, world_of
    from slams.formats.files import check_new_file

    start = time.process_time()
    cli.refusing(lambda: check_new_file(options.out, options.force, ".npz"))
    if options.picture is not None:
        endings = ".png", ".pdf", ".svg", ".jpg"
        cli.refusing(lambda: check_new_file(options.picture, options.force, *endings))
    names = {field.name for field in dataclasses.fields(Setting)}
    given = {key: value for key, value in vars(options).items() if key in names}
    log = cli.refusing(lambda: simulate(Setting(**given), options.quiet))
    cli.refusing(lambda: log.save(options.out))
    world = world_of(log) if options.picture else None
    if world is not None and log.truth is not None:
        picture(world, log.truth.values[:, :2], log.name, options.picture)
    if not options.quiet:
        sys.stdout.write(_summary(log, options.out, time.process_time() - start))
    return 0


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams simulate",
        description="Simulate a laser scan log with true poses, wheel odometry and gyro.",
    )
    p.add_argument("out", type=Path, metavar="OUT.npz", help="the log to write")
    types = kinds()
    for field in dataclasses.fields(Setting):
        flag, meaning = f"--{field.name.replace('_', '-')}", field.metadata["meaning"]
        kind = types[field.name]
        if kind is bool:
            p.add_argument(flag, action="store_true", help=meaning)
            continue
        shown = "" if field.default is None else f" (default {field.default})"
        name = field.name.upper()
        p.add_argument(flag, type=kind, default=field.default, metavar=name, help=meaning + shown)
    p.add_argument(
        "--picture", type=Path, metavar="OUT.png", help="draw the arena and the drive to a file"
    )
    p.add_argument("--force", action="store_true", help="replace files that exist")
    p.add_argument("-q", "--quiet", action="store_true", help="print errors only")
    return p


def _summary(log: ScanLog, out: Path, seconds: float) -> str:
    import numpy as np

    from slams.metrics import path_length

    distance = 0.0 if log.truth is None else path_length(log.truth.values)
    hits = float(np.isfinite(log.ranges).mean())
    return (
        f"{log.name}: {len(log)} scans of {log.laser.n_beams} beams in"
        f" {len(log) * log.scan_period:.1f} s, {distance:.1f} m driven, {hits:.1%} returns\n"
        f"{out}: {out.stat().st_size / 1e6:.1f} MB, made in {seconds:.1f} s CPU\n"
    )


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
