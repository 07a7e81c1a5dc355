"""slams loops: loop closure in buildings of bare corridors."""

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

LOOP_ALGORITHMS = ("hector+loops", "gmapping", "gmapping:n_particles=1")
BUILDING_SIZE, DRIVE_LENGTH, ROBOT_SPEED = 70.0, 260.0, 2.0  # m, m, m/s; more than one lap
KEYFRAME_DISTANCE, ROTATION_LEVER = 0.7, 0.7  # m between keyframes; m per rad of rotation
FIELD_OF_VIEW, N_BEAMS, MAX_RANGE = 180.0, 181, 8.0  # deg, 1, m
ODOMETRY_SCALE_ERROR, ODOMETRY_ROTATION_ERROR = 0.05, 0.05  # of distance and rotation
HEADING_DRIFT = 0.052  # rad/m, 3 degrees per meter
LOOP_REVISIT_TIME, LOOP_REVISIT_DISTANCE = 40.0, 1.0  # s, m between two visits of a place
MAX_CLOSED_LOOP_ERROR = 0.2  # m, mean error between two visits


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams loops",
        description="Drive loops in simulated buildings of bare corridors: scans "
        f"{KEYFRAME_DISTANCE:g} m apart, a laser range of {MAX_RANGE:g} m, odometry errors of "
        f"{ODOMETRY_SCALE_ERROR:.0%} and 3 degrees per meter. A loop is closed if the mean error "
        f"between visits of a place is at most {MAX_CLOSED_LOOP_ERROR:g} m.",
    )
    known, default = "name, variant NAME:KEY=VALUE,... or module:Class", list(LOOP_ALGORITHMS)
    words = f"{known} (default: {' '.join(default)})"
    p.add_argument("--algorithms", metavar="NAME", nargs="+", default=default, help=words)
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
    """Keyframes of one drive around a ring of corridors, with large odometry errors."""
    import numpy as np

    from bench.sim.degrade.fan import beams, fov
    from bench.sim.degrade.readings import range_
    from bench.sim.setting import Setting
    from bench.sim.simulation import simulate
    from bench.sim.wheels import RESCUE_ROBOT_WHEELS, counted
    from slams.scanlog import TimeSeries

    size, length = BUILDING_SIZE, DRIVE_LENGTH
    setting = Setting("ring", seed=seed, size=size, length=length, v=ROBOT_SPEED, noise=0.02)
    log, rng = simulate(setting), np.random.default_rng(seed)
    log = log.rows(np.array(_keyframes(_true(log))))
    log = range_(beams(fov(log, FIELD_OF_VIEW), N_BEAMS), MAX_RANGE)
    errors = RESCUE_ROBOT_WHEELS._replace(
        scale=ODOMETRY_SCALE_ERROR, turning=ODOMETRY_ROTATION_ERROR, straight=HEADING_DRIFT
    )
    odometry = TimeSeries(log.t, counted(_true(log), log.t, rng, errors))
    return replace(log, odom=odometry, yaw_rate=None, meta={})


def _true(log: ScanLog) -> Floats:
    true = log.truth_at(log.t)
    assert true is not None
    return true


def _keyframes(poses: Floats) -> list[int]:
    """Indices of scans that are `KEYFRAME_DISTANCE` apart, by distance and rotation."""
    import numpy as np

    rotation = np.abs(np.angle(np.exp(1j * np.diff(poses[:, 2]))))
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T) + ROTATION_LEVER * rotation
    keyframes, last = [0], 0.0
    for i, length in enumerate(np.cumsum(steps), 1):
        if length - last >= KEYFRAME_DISTANCE:
            keyframes.append(i)
            last = float(length)
    return keyframes


def revisit_error(log: ScanLog, label: str) -> float:
    """Mean error [m] between two visits of a place, of the corrected poses if there are any."""
    import numpy as np

    from bench.run.single import algorithm_of
    from slams.metrics import pair_errors
    from slams.player import replay
    from slams.registry import find

    run = replay(find(algorithm_of(label)).cls(params_of(label)), log)
    true = _true(log)
    distance = np.hypot(*(true[:, None, :2] - true[None, :, :2]).transpose(2, 0, 1))
    near = distance < LOOP_REVISIT_DISTANCE
    later, earlier = np.nonzero(near & (np.subtract.outer(log.t, log.t) > LOOP_REVISIT_TIME))
    return float(pair_errors(run.final, true, earlier, later)[0].mean())


def _line(label: str, errors: list[float]) -> str:
    closed = sum(error <= MAX_CLOSED_LOOP_ERROR for error in errors)
    meters = " ".join(f"{error:.2f}" for error in errors)
    return f"{label}: {closed} of {len(errors)} closed; error between two visits [m]: {meters}\n"


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    raise SystemExit(main())
