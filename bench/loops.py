"""slams loops: who closes the loops of buildings of bare corridors."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

from bench.run.options import within
from bench.run.single import params_of
from slams import cli

if TYPE_CHECKING:
    from slams.scanlog import ScanLog
    from slams.types import Floats

ROWS = ("hector+loops", "gmapping", "gmapping:n_particles=1")
SIZE, WAY, SPEED = 70.0, 260.0, 2.0  # m, m, m/s: a ring of corridors, driven around and on
STEP, LEVER = 0.7, 0.7  # m between keyframes; m a radian counts for
FAN, BEAMS, RANGE = 180.0, 181, 8.0  # deg, beams and m that the laser sees
SCALE_ERROR, TURN_ERROR = 0.05, 0.05  # of way and turn that wheels count wrong, 5 %
HEADING_DRIFT = 0.052  # rad/m, 3 degrees a meter
AGAIN, NEAR = 40.0, 1.0  # s later and m away: a place visited again
CLOSED = 0.2  # m of error between the two visits, on average


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams loops",
        description="Drive loops in simulated buildings of bare corridors: scans "
        f"{STEP:g} m apart, a laser with a range of {RANGE:g} m, wheels that err by "
        f"{SCALE_ERROR:.0%} and 3 degrees per meter. A loop is closed if the poses at revisited "
        f"places are right to {CLOSED:g} m.",
    )
    p.add_argument(
        "--algorithms",
        metavar="NAME",
        nargs="+",
        default=list(ROWS),
        help=f"name, variant NAME:KEY=VALUE,... or module:Class (default: {' '.join(ROWS)})",
    )
    words = "number of buildings (default: %(default)s)"
    p.add_argument("--buildings", type=cli.count, default=10, metavar="N", help=words)
    words = "seed of the first building (default: %(default)s)"
    p.add_argument("--seed", type=within(int, 0, 10**9), default=0, metavar="N", help=words)
    return p


def _command(arguments: argparse.Namespace) -> int:
    for label in arguments.algorithms:
        cli.refusing(lambda label=label: params_of(label))  # type: ignore[misc]
    errors: dict[str, list[float]] = {label: [] for label in arguments.algorithms}
    seeds = range(arguments.seed, arguments.seed + arguments.buildings)
    for seed in cli.progress(seeds, len(seeds), "driving", quiet=False, unit="building"):
        log = building(seed)
        for label in errors:
            errors[label].append(revisit_error(log, label))
    sys.stdout.write("".join(_line(label, errors[label]) for label in errors))
    return 0


def building(seed: int) -> ScanLog:
    """Keyframes of one drive around a ring of corridors, with wheels that are wrong."""
    import numpy as np

    from bench.sim.degrade.fan import beams, fov
    from bench.sim.degrade.readings import range_
    from bench.sim.setting import Setting
    from bench.sim.simulation import simulate
    from bench.sim.wheels import WHEELS, counted
    from slams.scanlog import TimeSeries

    setting = Setting("ring", seed=seed, size=SIZE, length=WAY, v=SPEED, noise=0.02)
    log, chance = simulate(setting), np.random.default_rng(seed)
    log = log.rows(np.array(_keys(_true(log))))
    log = range_(beams(fov(log, FAN), BEAMS), RANGE)
    wrong = WHEELS._replace(scale=SCALE_ERROR, turning=TURN_ERROR, straight=HEADING_DRIFT)
    odometry = TimeSeries(log.t, counted(_true(log), log.t, chance, wrong))
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


def revisit_error(log: ScanLog, label: str) -> float:
    """Mean error [m] between two visits of a place; of corrected poses where there are some."""
    import numpy as np

    from bench.run.single import algorithm_of
    from slams.metrics import pair_errors
    from slams.player import replay
    from slams.registry import find

    run = replay(find(algorithm_of(label)).cls(params_of(label)), log)
    true = _true(log)
    apart = np.hypot(*(true[:, None, :2] - true[None, :, :2]).transpose(2, 0, 1))
    later, sooner = np.nonzero((apart < NEAR) & (np.subtract.outer(log.t, log.t) > AGAIN))
    return float(pair_errors(run.final, true, sooner, later)[0].mean())


def _line(label: str, errors: list[float]) -> str:
    closed = sum(error <= CLOSED for error in errors)
    meters = " ".join(f"{error:.2f}" for error in errors)
    return f"{label}: {closed} of {len(errors)} closed; error between two visits [m]: {meters}\n"


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    raise SystemExit(main())
