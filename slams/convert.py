"""slams convert LOG OUT.npz: a recorded log of any kind as a scan log npz."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from slams import cli

if TYPE_CHECKING:
    from slams.scanlog import ScanLog

PROGRAM = "slams convert"


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog=PROGRAM,
        description="Turn a recorded log into an npz that loads at once and can be passed on.",
    )
    p.add_argument(
        "log",
        nargs="+",
        help="npz, ROS bag (of a split one all files), CARMEN log, BreezySLAM .dat",
    )
    p.add_argument("out", type=Path, metavar="OUT.npz", help="the scan log to write")
    p.add_argument("-q", "--quiet", action="store_true", help="say nothing but errors")
    cli.add_log_options(p)
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    cli.one_thread()
    return cli.run_command(PROGRAM, lambda: _command(parser().parse_intermixed_args(argv)))


def _command(arguments: argparse.Namespace) -> int:
    from slams.formats.source import load

    cli.refusing(lambda: _check_name(arguments.out))
    log = cli.refusing(lambda: load(arguments.log, cli.log_options(arguments)))
    cli.show_notes(PROGRAM, log.notes, arguments.quiet)
    cli.refusing(lambda: log.save(arguments.out))
    if not arguments.quiet:
        sys.stdout.write(f"{described(log)}\n{arguments.out}\n")
    return 0


def described(log: ScanLog) -> str:
    """What is in a log, in a few lines."""
    laser, source = log.laser, log.meta.get("source")
    rate = f"{1.0 / log.scan_period:.1f} Hz" if log.scan_period > 0.0 else "one stamp"
    lines = [
        f"{log.name}: {len(log)} scans of {laser.n_beams} beams, {rate}, "
        f"{float(log.t.max() - log.t.min()):.1f} s",
        f"laser: {laser.range_min:.2f} to {laser.range_max:.2f} m, mounted at "
        f"({laser.mount.x:.3f}, {laser.mount.y:.3f}) m, {laser.mount.theta:.4f} rad",
    ]
    tracks = {"odometry": log.odom, "yaw_rate": log.yaw_rate, "truth": log.truth}
    for name, track in tracks.items():
        if track is not None:
            origin = source.get(name) if isinstance(source, dict) else None  # it is free text
            named = f" from {origin}" if origin else ""
            lines.append(f"{name.replace('_', ' ')}: {len(track.t)} stamps{named}")
    return "\n".join(lines)


def _check_name(out: Path) -> None:
    """Complain before the work, not after it."""
    if out.suffix != ".npz":
        raise ValueError(f"{out}: expected a name that ends in .npz")
    if not out.parent.is_dir():
        raise FileNotFoundError(f"{out.parent}: no such folder; make it first")
    if out.is_dir():
        raise IsADirectoryError(f"{out}: is a folder; expected the name of a file")


if __name__ == "__main__":
    sys.exit(main())
