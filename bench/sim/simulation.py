"""Simulation of a scan log with ground truth, from arena, drive and sensor."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bench.sim.drive import Drive, Robot, drive, drive_far
from bench.sim.measuring import Measuring
from bench.sim.ramps import Ramps
from bench.sim.sensors import SENSORS, Sensor
from bench.sim.setting import ARENA_CELL_SIZE, ARENAS, MOTION_RATE, Setting, kinds, look_up
from bench.sim.swing import Swing, measured
from bench.sim.wheels import gyro, odometry
from bench.sim.world import World, read_world
from slams.scanlog import ScanLog, TimeSeries
from slams.types import Floats, Pose2, wrap_angle

if TYPE_CHECKING:
    from numpy.random import Generator

TRUTH_RATE = 200.0  # Hz, minimum rate of the logged ground truth
ODOMETRY_RATE = 50.0  # Hz
GYRO_RATE = 100.0  # Hz
LASER_OFFSET = 0.2  # m, of each of two lasers from the base
RANDOM_STREAMS = ("arena", "drive", "ranges", "odometry", "gyro", "people", "tilt")


def _chances(seed: int) -> dict[str, Generator]:
    """A random generator for each purpose, so that a change in one does not affect the others."""
    streams = np.random.default_rng(seed).spawn(len(RANDOM_STREAMS))
    return dict(zip(RANDOM_STREAMS, streams, strict=True))


def simulate(setting: Setting | None = None, quiet: bool = True) -> ScanLog:
    """The scan log of a setting; the default is the rescue maze, UTM-30LX, 300 s.

    True poses are in the world frame. Unless `quiet`, a terminal shows the progress.

    Raises:
        LookupError: no such sensor.
        OSError: the map cannot be opened.
        ValueError: the file is not a map, or has no room to drive.
    """
    setting = setting or Setting()
    sensor, chance = look_up("sensor", setting.sensor, SENSORS), _chances(setting.seed)
    world = _world(setting, chance["arena"])
    body = _body(setting, chance["tilt"])
    true = _drive(setting, sensor, world, chance["drive"])
    t = np.arange(max(1, math.floor(true.t[-1] * sensor.rate + 1e-6))) / sensor.rate
    # a multiple of the scan rate, so that each scan has a true pose
    truth_rate = sensor.rate * math.ceil(max(5.0, TRUTH_RATE / sensor.rate) - 1e-9)
    measuring = Measuring(setting, sensor, world, true, chance, body)
    if setting.lasers > 1:
        scans = _front_and_rear(setting, measuring, t, quiet)
    else:
        scans = {"t": t, "ranges": measuring.scans(t, quiet), "laser": measuring.laser}
    return ScanLog(
        **scans,
        odom=_track(true, ODOMETRY_RATE, lambda stamps: odometry(true, stamps, chance["odometry"])),
        truth=_track(true, truth_rate, lambda stamps: _truth(true, stamps)),
        yaw_rate=_track(true, GYRO_RATE, lambda stamps: gyro(true, stamps, chance["gyro"])),
        meta=_meta(setting, world),
        attitude=None if body is None else _attitudes(true, body, chance["tilt"]),
    )


def _body(setting: Setting, rng: Generator) -> Swing | Ramps | None:
    """The motion that tilts the robot, if any."""
    if setting.ramps:
        return Ramps(setting.ramps, rng)
    return Swing(setting.tilt, rng) if setting.tilt else None


def _attitudes(true: Drive, body: Swing | Ramps, rng: Generator) -> TimeSeries:
    """Measured roll and pitch."""
    return _track(true, GYRO_RATE, lambda t: measured(body.stand(t, true.poses_at(t))[0], t, rng))


def _front_and_rear(
    setting: Setting, measuring: Measuring, t: Floats, quiet: bool
) -> dict[str, Any]:
    """Scans of a front and a rear laser, half a period apart, ordered by stamps."""
    half = measuring.sensor.half().laser(setting.sweep)
    front, rear = (
        dataclasses.replace(half, mount=mount, mount_z=measuring.laser.mount_z)
        for mount in (Pose2(LASER_OFFSET, 0.0, 0.0), Pose2(-LASER_OFFSET, 0.0, math.pi))
    )
    stamps = np.concatenate([t, t + 0.5 / measuring.sensor.rate])
    rows = []
    for laser, own in ((front, t), (rear, stamps[len(t) :])):
        measuring.laser = laser
        rows.append(measuring.scans(own, quiet))
    order, numbers = np.argsort(stamps, kind="stable"), np.repeat([0, 1], len(t))
    ranges = np.concatenate(rows)[order]
    return {
        "t": stamps[order],
        "ranges": ranges,
        "laser": front,
        "others": (rear,),
        "laser_of": numbers[order],
    }


def world_of(log: ScanLog) -> World | None:
    """The world of a simulated log, in the frame of its ground truth.

    None if the log was not simulated, or its map is missing or has changed.
    """
    try:
        known = dict(log.meta["simulated"])
        setting = Setting(**{name: known[name] for name in kinds() if name in known})
        world = _world(setting, _chances(setting.seed)["arena"])
        return world if world.fingerprint == known["world"] else None
    except (KeyError, TypeError, ValueError, OSError):
        return None


def build_arena(
    name: str, rng: Generator, resolution: float | None = None, size: float | None = None
) -> World:
    """The arena of that name with its longer side of about `size` [m] and cells of `resolution`.

    The same generator state gives the same arena. Defaults: `ARENA_CELL_SIZE`, the arena's size.

    Raises:
        ValueError: the cells are too coarse for its walls, or the size is out of bounds.
    """
    from bench.sim.hall import hall
    from bench.sim.maze import rescue_arena
    from bench.sim.office import office
    from bench.sim.ring import ring

    builders = {"rescue": rescue_arena, "office": office, "hall": hall, "ring": ring}
    known = ARENAS[name]
    size = known.size if size is None else size
    if not known.least <= size <= known.most:
        raise ValueError(
            f"size: got {size:g} m, expected {known.least:g} to {known.most:g} for the {name} arena"
        )
    return builders[name](rng, resolution or ARENA_CELL_SIZE, size)


def _world(setting: Setting, rng: Generator) -> World:
    if setting.arena not in ARENAS:
        return read_world(setting.arena, setting.resolution)
    return build_arena(setting.arena, rng, setting.resolution, setting.size)


def _drive(setting: Setting, sensor: Sensor, world: World, rng: Generator) -> Drive:
    """The true motion, with a sample at every scan's stamp."""
    known = ARENAS.get(setting.arena)
    laps = known is not None and known.laps
    robot = Robot(setting.v, setting.w, setting.clearance, laps=laps)
    rate = sensor.rate * math.ceil(MOTION_RATE / sensor.rate)
    if setting.length is not None:
        return drive_far(world, robot, rng, setting.length, rate)
    seconds = max(setting.duration, 1.0 / sensor.rate)
    return drive(world, robot, rng, seconds, rate)


def _track(true: Drive, rate: float, values: Callable[[Floats], Floats]) -> TimeSeries:
    """A signal at a constant rate over the whole drive, with both ends."""
    stamps = np.arange(math.ceil(true.t[-1] * rate - 1e-6)) / rate
    stamps = np.append(stamps, true.t[-1])
    return TimeSeries(stamps, values(stamps))


def _truth(true: Drive, stamps: Floats) -> Floats:
    poses = true.poses_at(stamps)
    poses[:, 2] = wrap_angle(poses[:, 2])
    return poses


def _meta(setting: Setting, world: World) -> dict[str, Any]:
    """The setting and the world's fingerprint, to reproduce the log and its world."""
    known = dataclasses.asdict(setting)
    if setting.arena not in ARENAS:
        known["arena"] = str(Path(setting.arena).resolve())
    elif setting.size is None:
        known["size"] = ARENAS[setting.arena].size
    name = f"{Path(setting.arena).stem}-{setting.sensor}-{setting.seed}"
    return {"name": name, "simulated": known | {"world": world.fingerprint}}


def picture(world: World, points: NDArray[np.float64], title: str, path: Path) -> None:
    """Draw a world and a path of points (n, 2) [m] into an image file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shade = np.where(world.occupied, 0.0, np.where(world.unknown, 0.6, 1.0))
    figure = Figure(figsize=(8, 8), layout="constrained")
    axes = figure.add_subplot()
    axes.imshow(shade, cmap="gray", vmin=0, vmax=1, origin="lower", extent=world.extent)
    axes.plot(points[:, 0], points[:, 1], color="tab:red", linewidth=1.0)
    axes.plot(*points[0], "o", color="tab:green", label="start")
    axes.plot(*points[-1], "s", color="tab:blue", label="end")
    axes.set(title=title, xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.legend(loc="lower right")
    FigureCanvasAgg(figure).print_figure(path, dpi=100)
