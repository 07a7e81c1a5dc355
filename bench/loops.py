"""python -m bench.loops: whether particles close the loops of buildings of bare corridors."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slams import cli

if TYPE_CHECKING:
    from slams.scanlog import ScanLog
    from slams.types import Floats

PROGRAM = "bench.loops"
FORMAT = "loops-1"
SIZE, WAY, SPEED = 70.0, 260.0, 2.0  # m, m, m/s: a ring of corridors, driven around and on
STEP, LEVER = 0.7, 0.7  # m between key scans; m a radian counts for
EVERY, HALF, RANGE = 4, 360, 8.0  # one beam in four, of 181 ahead, to 8 m
WRONG_WAY, WRONG_TURN, VEER = 0.05, 0.05, 0.052  # 5 % of way and turn, 3 degrees a meter
AGAIN, NEAR = 40.0, 1.0  # s later and m away: a place seen again
CLOSED = 0.2  # m of error between the two visits, on average


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog=f"python -m {PROGRAM}",
        description="Drive around in simulated buildings of bare corridors: key scans "
        f"{STEP:g} m apart, a laser that sees {RANGE:g} m, wheels that are wrong by "
        f"{WRONG_WAY:.0%} and 3 degrees a meter. A loop is closed if places that were seen "
        f"before are where they were, to {CLOSED:g} m.",
        epilog="Writes loops.json.",
    )
    p.add_argument("--algorithm", default="gmapping", metavar="NAME", help="%(default)s")
    counts = [30, 1]
    p.add_argument("--particles", type=int, nargs="+", default=counts, metavar="N", help="30 1")
    p.add_argument("--buildings", type=int, default=10, metavar="N", help="%(default)s")
    p.add_argument("--first", type=int, default=0, metavar="SEED", help="of them (%(default)s)")
    p.add_argument("--out", default="results/loops", metavar="DIR", help="%(default)s")
    p.add_argument("-q", "--quiet", action="store_true", help="no progress, no table")
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    cli.one_thread()
    return cli.run_command(PROGRAM, lambda: _command(parser().parse_args(argv)))


def _command(arguments: argparse.Namespace) -> int:
    from bench.results import write_figures
    from slams.formats import files

    cli.refusing(lambda: _check(arguments))
    seeds = range(arguments.first, arguments.first + arguments.buildings)
    driven: list[dict[str, Any]] = []
    for seed in cli.progress(seeds, len(seeds), "driving", arguments.quiet, unit="building"):
        log = building(seed)
        for particles in arguments.particles:
            error = revisit_error(log, arguments.algorithm, particles)
            driven.append({"building": seed, "particles": particles, "revisit_m": error})
    with files.complete_folder(Path(arguments.out)) as folder:
        write_figures(folder / "loops.json", {"format": FORMAT, "driven": driven})
    if not arguments.quiet:
        sys.stdout.write("\n".join(_lines(driven, arguments.particles)) + "\n")
    return 0


def _check(arguments: argparse.Namespace) -> None:
    from slams.formats.files import check_folder
    from slams.registry import find

    if arguments.buildings < 1:
        raise ValueError(f"--buildings: got {arguments.buildings}, expected 1 or more")
    entry = find(arguments.algorithm)
    for particles in arguments.particles:
        entry.params().replace(n_particles=particles)
    check_folder(arguments.out)


def building(seed: int) -> ScanLog:
    """Key scans of one drive around a ring of corridors, with wheels that are wrong."""
    import numpy as np

    from bench.sim.setting import Setting
    from bench.sim.simulation import simulate
    from bench.sim.wheels import WHEELS, counted
    from slams.scanlog import Track

    setting = Setting("ring", seed=seed, size=SIZE, length=WAY, v=SPEED, noise=0.02)
    log = simulate(setting)
    keys = _keys(_true(log))
    middle = log.laser.n_beams // 2
    beams = slice(middle - HALF, middle + HALF + 1, EVERY)
    ranges = np.array(log.ranges[keys][:, beams])
    ranges[ranges > RANGE] = np.inf
    laser = replace(
        log.laser,
        angle_min=log.laser.angle_min + (middle - HALF) * log.laser.angle_increment,
        angle_increment=EVERY * log.laser.angle_increment,
        n_beams=ranges.shape[1],
        range_max=RANGE,
    )
    wrong = WHEELS._replace(scale=WRONG_WAY, turning=WRONG_TURN, straight=VEER)
    t, chance = log.t[keys], np.random.default_rng(seed)
    odometry = Track(t, counted(_true(log)[keys], t, chance, wrong))
    return replace(log, t=t, ranges=ranges, laser=laser, odom=odometry, yaw_rate=None, meta={})


def _true(log: ScanLog) -> Floats:
    true = log.truth_at(log.t)
    assert true is not None
    return true


def _keys(poses: Floats) -> list[int]:
    """Scans that are a step of way or turn behind each other."""
    import numpy as np

    turned = np.abs(np.angle(np.exp(1j * np.diff(poses[:, 2]))))
    way = np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T) + LEVER * turned)
    keys, last = [0], 0.0
    for i, far in enumerate(way, 1):
        if far - last >= STEP:
            keys.append(i)
            last = float(far)
    return keys


def revisit_error(log: ScanLog, label: str, particles: int) -> float:
    """Mean error [m] between two visits of a place."""
    import numpy as np

    from slams.metrics import between
    from slams.registry import find

    entry = find(label)
    slam = entry.cls(entry.params().replace(n_particles=particles))
    poses, true = np.array([slam.update(scan) for scan in log]), _true(log)
    apart = np.hypot(*(true[:, None, :2] - true[None, :, :2]).transpose(2, 0, 1))
    later, sooner = np.nonzero((apart < NEAR) & (np.subtract.outer(log.t, log.t) > AGAIN))
    found = between(poses[sooner], poses[later])
    off = between(between(true[sooner], true[later]), found)
    return float(np.hypot(off[:, 0], off[:, 1]).mean())


def _lines(driven: list[dict[str, Any]], counts: Sequence[int]) -> list[str]:
    lines = [
        "particles  closed  mean error between two visits of a place [m], building by building"
    ]
    for particles in counts:
        errors = [d["revisit_m"] for d in driven if d["particles"] == particles]
        closed = f"{sum(e <= CLOSED for e in errors)} of {len(errors)}"
        lines.append(f"{particles:9d}  {closed:>8}  " + " ".join(f"{e:.2f}" for e in errors))
    return lines


if __name__ == "__main__":
    raise SystemExit(main())
