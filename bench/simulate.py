"""`python -m bench.simulate OUT.npz`: arena, drive and sensor make a scan log with its truth."""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bench.drive import LEG, Drive, Robot, drive, drive_far, gyro, legs, odometry
from bench.sensors import SENSORS, Errors, Sensor, find_sensor
from bench.world import World, read_world
from slams.scanlog import ScanLog, Track
from slams.types import Floats, Ranges, wrap_angle

if TYPE_CHECKING:
    from numpy.random import Generator

FINE = 400.0  # Hz, least rate of the true motion that all else is taken from
TRUTH = 200.0  # Hz, least rate of the logged truth
ODOMETRY = 50.0  # Hz
GYRO = 100.0  # Hz
BLOCK = 200  # scans measured at once
CELL = 0.02  # m, of the rescue arena

Progress = Callable[[int, int], None]


def _option(
    default: Any, kind: type, meaning: str, low: float = -math.inf, high: float = math.inf
) -> Any:
    """A field of `Setting`: its type, one line for `--help`, and its bounds."""
    known = {"kind": kind, "meaning": meaning, "low": low, "high": high}
    return dataclasses.field(default=default, metadata=known)


@dataclass(frozen=True)
class Setting:
    """Everything a simulated log follows from; same setting, same log. Fields tell their meaning.

    Raises:
        ValueError: a value out of bounds.
    """

    arena: str = _option(
        "rescue", str, "rescue (a maze made from the seed), MAP.yaml, or a picture (dark = wall)"
    )
    resolution: float | None = _option(
        None, float, f"cell of the rescue arena ({CELL}) or pixel of the picture [m]", 1e-3, 1.0
    )
    size: float = _option(20.0, float, "side of the rescue arena [m]", 7.0, 100.0)
    seed: int = _option(0, int, "seed of every draw", 0, 2**63 - 1)
    sensor: str = _option("utm30lx", str, f"one of {', '.join(SENSORS)}")
    duration: float = _option(300.0, float, "length of the log [s]", 0.1, 14400.0)
    length: float | None = _option(
        None, float, "length of the way [m], instead of the duration", 0.1, 5000.0
    )
    v: float = _option(0.5, float, "greatest speed [m/s]", 0.05, 5.0)
    w: float = _option(0.8, float, "greatest turn rate [rad/s]", 0.1, 10.0)
    clearance: float = _option(0.3, float, "least distance of laser and wall [m]", 0.05, 5.0)
    noise: float | None = _option(
        None, float, "standard deviation of a range [m], instead of the sensor's", 0.0, 10.0
    )
    stdr: bool = _option(
        False, bool, "ranges like stdr_simulator's: no noise, multiples of the map's cell"
    )
    dropout: float = _option(0.0, float, "share of beams lost, half nan, half inf", 0.0, 1.0)
    mixed: float = _option(
        0.0, float, "share of beams beside an edge that fall between near and far", 0.0, 1.0
    )
    people: int = _option(0, int, "how many people walk about", 0, 50)
    sweep: bool = _option(
        False, bool, "measure beam after beam while the robot moves, as a turning mirror does"
    )
    truth_rate: float | None = _option(
        None,
        float,
        "rate of the logged truth [Hz], rounded up to a multiple of the scans'",
        1,
        FINE,
    )

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value, low, high = getattr(self, field.name), *_bounds(field)
            if isinstance(value, (int, float)) and not low <= value <= high:
                raise ValueError(f"{field.name}: got {value}, expected {low:g} to {high:g}")


def _bounds(field: dataclasses.Field[Any]) -> tuple[float, float]:
    return field.metadata["low"], field.metadata["high"]


@dataclass(frozen=True)
class Chance:
    """One stream of random numbers per purpose: a change in one leaves the others alone."""

    arena: Generator
    drive: Generator
    ranges: Generator
    odometry: Generator
    gyro: Generator
    people: Generator

    @classmethod
    def of(cls, seed: int) -> Chance:
        """The streams of a seed."""
        return cls(*np.random.default_rng(seed).spawn(6))


def simulate(setting: Setting | None = None, progress: Progress | None = None) -> ScanLog:
    """The scan log of a setting; without one, of the default: rescue maze, UTM-30LX, 300 s.

    Poses of the truth are in the world's frame. `progress(done, total)` is told of the scans.

    Raises:
        LookupError: no such sensor.
        OSError: the map cannot be opened.
        ValueError: the map is none, or has no room to drive.
    """
    setting = setting or Setting()
    sensor, chance = find_sensor(setting.sensor), Chance.of(setting.seed)
    world = _world(setting, chance.arena)
    true = _drive(setting, sensor, world, chance.drive)
    t = np.arange(max(1, math.floor(true.t[-1] * sensor.rate + 1e-6))) / sensor.rate
    return ScanLog(
        t=t,
        ranges=_Measuring(setting, sensor, world, true, chance).scans(t, progress),
        laser=sensor.laser(setting.sweep),
        odom=_track(true, ODOMETRY, lambda stamps: odometry(true, stamps, chance.odometry)),
        truth=_track(true, _truth_rate(setting, sensor), lambda stamps: _truth(true, stamps)),
        yaw_rate=_track(true, GYRO, lambda stamps: gyro(true, stamps, chance.gyro)),
        meta=_meta(setting, world),
    )


def world_of(log: ScanLog) -> World | None:
    """The world a log was simulated in, exactly, in the frame of the log's truth.

    None when the log was not simulated, or its map is gone or has changed since.
    """
    try:
        known = dict(log.meta["simulated"])
        fingerprint = known.pop("world")
        setting = Setting(**known)
        world = _world(setting, Chance.of(setting.seed).arena)
    except (KeyError, TypeError, ValueError, OSError):
        return None
    return world if world.fingerprint == fingerprint else None


def _world(setting: Setting, rng: Generator) -> World:
    if setting.arena != "rescue":
        return read_world(setting.arena, setting.resolution)
    from bench.arena import rescue_arena

    return rescue_arena(rng, setting.resolution or CELL, setting.size)


def _drive(setting: Setting, sensor: Sensor, world: World, rng: Generator) -> Drive:
    """The true motion; its samples fall on every scan's stamp."""
    robot = Robot(setting.v, setting.w, setting.clearance)
    rate = sensor.rate * math.ceil(FINE / sensor.rate)
    if setting.length is not None:
        return drive_far(world, robot, rng, setting.length, rate)
    return drive(world, robot, rng, max(setting.duration, 1.0 / sensor.rate), rate)


def _truth_rate(setting: Setting, sensor: Sensor) -> float:
    """A whole multiple of the scan rate, so that every scan has a truth of its own."""
    wanted = setting.truth_rate or max(5.0 * sensor.rate, TRUTH)
    return sensor.rate * math.ceil(wanted / sensor.rate - 1e-9)


def _track(true: Drive, rate: float, values: Callable[[Floats], Floats]) -> Track:
    """A signal at an even rate over the whole drive, both ends included."""
    stamps = np.arange(math.ceil(true.t[-1] * rate - 1e-6)) / rate
    stamps = np.append(stamps, true.t[-1])
    return Track(stamps, values(stamps))


def _truth(true: Drive, stamps: Floats) -> Floats:
    poses = true.poses_at(stamps)
    poses[:, 2] = wrap_angle(poses[:, 2])
    return poses


def _meta(setting: Setting, world: World) -> dict[str, Any]:
    """All that is needed to make the log and its world again."""
    known = dataclasses.asdict(setting)
    if setting.arena != "rescue":
        known["arena"] = str(Path(setting.arena).resolve())
    name = f"{Path(setting.arena).stem}-{setting.sensor}-{setting.seed}"
    return {"name": name, "simulated": known | {"world": world.fingerprint}}


class _Measuring:
    """The sensor on its way through the world."""

    def __init__(
        self, setting: Setting, sensor: Sensor, world: World, true: Drive, chance: Chance
    ) -> None:
        self.world, self.true, self.rng = world, true, chance.ranges
        self.laser = sensor.laser(setting.sweep)
        self.errors = _errors(setting, sensor, world)
        self.legs = legs(world, true, setting.people, chance.people) if setting.people else None

    def scans(self, t: Floats, progress: Progress | None) -> Ranges:
        """Ranges (n, b) [m] measured from the stamps t (n,) on."""
        ranges = np.empty((len(t), self.laser.n_beams), np.float32)
        for start in range(0, len(t), BLOCK):
            block = t[start : start + BLOCK]
            distances = self._distances(block).reshape(len(block), -1)
            ranges[start : start + BLOCK] = self.errors.apply(distances, self.rng)
            if progress is not None:
                progress(start + len(block), len(t))
        return ranges

    def _distances(self, t: Floats) -> Floats:
        """True distances (n * b,), each beam at its own time and the pose of that time."""
        delays = self.laser.time_increment * np.arange(self.laser.n_beams)
        stamps = (t[:, None] + delays).ravel()
        rays = self.true.poses_at(stamps)
        rays[:, 2] += np.tile(self.laser.angles, len(t))
        distances = self.world.cast(rays)
        if self.legs is not None:
            from bench.world_kernels import occlude

            now = np.round(stamps / self.true.t[1]).astype(np.int32)
            occlude(rays, np.minimum(now, len(self.legs) - 1), self.legs, LEG, distances)
        return distances


def _errors(setting: Setting, sensor: Sensor, world: World) -> Errors:
    noise, share, step = sensor.noise, sensor.noise_share, sensor.step
    if setting.stdr:
        noise, share, step = 0.0, 0.0, world.resolution
    if setting.noise is not None:
        noise, share = setting.noise, 0.0
    return Errors(noise, share, step, setting.dropout, setting.mixed)


def picture(world: World, way: NDArray[np.float64], title: str, path: Path) -> None:
    """Draw a world and a way (n, 2) [m] through it into an image file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shade = np.where(world.occupied, 0.0, np.where(world.unknown, 0.6, 1.0))
    figure = Figure(figsize=(8, 8), layout="constrained")
    axes = figure.add_subplot()
    axes.imshow(shade, cmap="gray", vmin=0, vmax=1, origin="lower", extent=world.extent)
    axes.plot(way[:, 0], way[:, 1], color="tab:red", linewidth=1.0)
    axes.plot(*way[0], "o", color="tab:green", label="start")
    axes.plot(*way[-1], "s", color="tab:blue", label="end")
    axes.set(title=title, xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.legend(loc="lower right")
    FigureCanvasAgg(figure).print_figure(path, dpi=100)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m bench.simulate",
        description="Simulate a laser scan log with true poses, wheel odometry and gyro.",
    )
    parser.add_argument("out", type=Path, metavar="OUT.npz", help="the log to write")
    for field in dataclasses.fields(Setting):
        flag, meaning = f"--{field.name.replace('_', '-')}", field.metadata["meaning"]
        kind = field.metadata["kind"]
        if kind is bool:
            parser.add_argument(flag, action="store_true", help=meaning)
            continue
        shown = "" if field.default is None else f" (default {field.default})"
        name = field.name.upper()
        parser.add_argument(
            flag, type=kind, default=field.default, metavar=name, help=meaning + shown
        )
    parser.add_argument("--picture", type=Path, metavar="OUT.png", help="draw arena and drive")
    parser.add_argument("-q", "--quiet", action="store_true", help="say nothing but errors")
    return parser


def _check_names(out: Path, drawing: Path | None) -> None:
    """Complain before the work, not after it."""
    if out.suffix != ".npz":
        raise ValueError(f"{out}: expected a name that ends in .npz")
    for path in (out, drawing):
        if path is not None and not path.parent.is_dir():
            raise FileNotFoundError(f"{path.parent}: no such folder; make it first")
        if path is not None and path.is_dir():
            raise IsADirectoryError(f"{path}: is a folder; expected the name of a file")
    if drawing is not None and drawing.suffix not in (".png", ".pdf", ".svg", ".jpg"):
        raise ValueError(f"{drawing}: expected a name that ends in .png, .pdf, .svg or .jpg")


def _shown(quiet: bool) -> Progress | None:
    """A bar on a terminal, else nothing."""
    if quiet or not sys.stderr.isatty():
        return None
    from tqdm import tqdm

    bar = tqdm(unit="scan", desc="simulating", leave=False)

    def progress(done: int, total: int) -> None:
        bar.total = total
        bar.update(done - bar.n)
        if done == total:
            bar.close()

    return progress


def _summary(log: ScanLog, out: Path, seconds: float) -> str:
    way = 0.0 if log.truth is None else float(_lengths(log.truth.values).sum())
    seen = float(np.isfinite(log.ranges).mean())
    return (
        f"{log.name}: {len(log)} scans of {log.laser.n_beams} beams in"
        f" {len(log) * log.scan_period:.1f} s, {way:.1f} m driven, {seen:.1%} of the beams hit\n"
        f"{out}: {out.stat().st_size / 1e6:.1f} MB, made in {seconds:.1f} s CPU\n"
    )


def _lengths(poses: Floats) -> Floats:
    steps: Floats = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    return steps


def _run(options: argparse.Namespace) -> None:
    start = time.process_time()
    _check_names(options.out, options.picture)
    names = {field.name for field in dataclasses.fields(Setting)}
    setting = Setting(**{key: value for key, value in vars(options).items() if key in names})
    log = simulate(setting, _shown(options.quiet))
    log.save(options.out)
    world = world_of(log) if options.picture else None
    if world is not None and log.truth is not None:
        picture(world, log.truth.values[:, :2], log.name, options.picture)
    if not options.quiet:
        sys.stdout.write(_summary(log, options.out, time.process_time() - start))


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    options = _parser().parse_args(argv)
    try:
        _run(options)
    except OSError as error:
        at = f"{error.filename}: {error.strerror}" if error.filename else str(error)
        sys.stderr.write(f"simulate: {at}\n")
        return 2
    except (ValueError, LookupError, TypeError) as error:
        sys.stderr.write(f"simulate: {error.args[0] if error.args else error}\n")
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
