"""python -m bench.loops: who closes the loops of buildings of bare corridors."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from slams import cli

if TYPE_CHECKING:
    from slams.scanlog import ScanLog
    from slams.types import Floats

PROGRAM = "bench.loops"
FORMAT = "loops-1"
SIZE, WAY, SPEED = 70.0, 260.0, 2.0  # m, m, m/s: a ring of corridors, driven around and on
STEP, LEVER = 0.7, 0.7  # m between keyframes; m a radian counts for
FAN, BEAMS, RANGE = 180.0, 181, 8.0  # deg, beams and m that the laser sees
WRONG_WAY, WRONG_TURN, VEER = 0.05, 0.05, 0.052  # 5 % of way and turn, 3 degrees a meter
AGAIN, NEAR = 40.0, 1.0  # s later and m away: a place seen again
CLOSED = 0.2  # m of error between the two visits, on average


class Contestant(NamedTuple):
    """An algorithm by its label; with how many particles, None if it has none."""

    algorithm: str
    particles: int | None


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog=f"python -m {PROGRAM}",
        description="Drive around in simulated buildings of bare corridors: keyframes "
        f"{STEP:g} m apart, a laser that sees {RANGE:g} m, wheels that are wrong by "
        f"{WRONG_WAY:.0%} and 3 degrees a meter. A loop is closed if places that were seen "
        f"before are where they were, to {CLOSED:g} m.",
        epilog="Writes loops.json.",
    )
    usual, counts = ["gmapping"], [30, 1]
    p.add_argument("--algorithms", metavar="NAME", nargs="+", default=usual, help="gmapping")
    p.add_argument(
        "--particles",
        type=int,
        nargs="+",
        default=counts,
        metavar="N",
        help="of those with any (30 1)",
    )
    p.add_argument("--buildings", type=int, default=10, metavar="N", help="%(default)s")
    p.add_argument("--first", type=int, default=0, metavar="SEED", help="of them (%(default)s)")
    cli.add_output_options(p, "results/loops")
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    cli.one_thread()
    return cli.run_command(PROGRAM, lambda: _command(parser().parse_args(argv)))


def _command(arguments: argparse.Namespace) -> int:
    from bench.results import write_figures
    from slams.formats import files

    contestants = cli.refusing(lambda: _contestants(arguments))
    seeds = range(arguments.first, arguments.first + arguments.buildings)
    driven: list[dict[str, Any]] = []
    for seed in cli.progress(seeds, len(seeds), "driving", arguments.quiet, unit="building"):
        log = building(seed)
        for who in contestants:
            error = revisit_error(log, who)
            driven.append({**who._asdict(), "building": seed, "revisit_m": error})
    with files.complete_folder(Path(arguments.out)) as folder:
        write_figures(folder / "loops.json", {"format": FORMAT, "driven": driven})
    if not arguments.quiet:
        sys.stdout.write("\n".join(_lines(driven, contestants)) + "\n")
    return 0


def _contestants(arguments: argparse.Namespace) -> list[Contestant]:
    """Every algorithm, one with particles once for each number of them.

    Raises:
        ValueError: an option that can't be.
    """
    from slams.formats.files import check_folder
    from slams.registry import find

    if arguments.buildings < 1:
        raise ValueError(f"--buildings: got {arguments.buildings}, expected 1 or more")
    check_folder(arguments.out)
    contestants = []
    for label in arguments.algorithms:
        params = find(label).params()
        counts = arguments.particles if hasattr(params, "n_particles") else [None]
        for particles in counts:
            if particles is not None:
                params.replace(n_particles=particles)
            contestants.append(Contestant(label, particles))
    return contestants


def building(seed: int) -> ScanLog:
    """Keyframes of one drive around a ring of corridors, with wheels that are wrong."""
    import numpy as np

    from bench.sim.degrade.fan import beams, field_of_view
    from bench.sim.degrade.readings import cut
    from bench.sim.setting import Setting
    from bench.sim.simulation import simulate
    from bench.sim.wheels import WHEELS, counted
    from slams.scanlog import Track

    setting = Setting("ring", seed=seed, size=SIZE, length=WAY, v=SPEED, noise=0.02)
    log, chance = simulate(setting), np.random.default_rng(seed)
    log = log.rows(np.array(_keys(_true(log))))
    log = cut(beams(field_of_view(log, FAN, chance), BEAMS, chance), RANGE, chance)
    wrong = WHEELS._replace(scale=WRONG_WAY, turning=WRONG_TURN, straight=VEER)
    odometry = Track(log.t, counted(_true(log), log.t, chance, wrong))
    return replace(log, odom=odometry, yaw_rate=None, meta={})


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


def revisit_error(log: ScanLog, who: Contestant) -> float:
    """Mean error [m] between two visits of a place."""
    import numpy as np

    from slams.metrics import pair_errors
    from slams.registry import find

    entry = find(who.algorithm)
    params = entry.params()
    if who.particles is not None:
        params = params.replace(n_particles=who.particles)
    slam = entry.cls(params)
    poses, true = np.array([slam.update(scan) for scan in log]), _true(log)
    apart = np.hypot(*(true[:, None, :2] - true[None, :, :2]).transpose(2, 0, 1))
    later, sooner = np.nonzero((apart < NEAR) & (np.subtract.outer(log.t, log.t) > AGAIN))
    return float(pair_errors(poses, true, sooner, later)[0].mean())


def _lines(driven: list[dict[str, Any]], contestants: Sequence[Contestant]) -> list[str]:
    lines = [
        "algorithm         particles    closed"
        "  mean error between two visits of a place [m], building by building"
    ]
    for who in contestants:
        errors = [d["revisit_m"] for d in driven if d.items() >= who._asdict().items()]
        closed = f"{sum(e <= CLOSED for e in errors)} of {len(errors)}"
        lines.append(
            f"{who.algorithm:16}  {who.particles or '-':>9}  {closed:>8}  "
            + " ".join(f"{e:.2f}" for e in errors)
        )
    return lines


if __name__ == "__main__":
    raise SystemExit(main())
