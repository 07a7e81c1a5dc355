"""slams localize: localization in a fixed map, compared with the ground truth."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from bench.run.options import within
from slams import cli

if TYPE_CHECKING:
    import pandas as pd

    from bench.sim.world import World
    from slams.localize.source import Prepared
    from slams.scanlog import ScanLog
    from slams.types import OccupancyGrid, Pose2

FLOOR_PLAN_CELL = 0.05  # m
MAX_PLACE_ERROR, MAX_PLACE_ROTATION = 0.1, math.radians(3.0)  # m, rad, of a correct result
SECOND_DRIVE_SEED = 1000  # offset of the second drive's seed
SEARCHES_PER_ARENA = 20
MIN_PROBABILITY = 0.95  # of a confident result
SETTLING_TIME = 1.0  # s after the start, in which the pose converges


class Place(NamedTuple):
    """An arena: its floor plan, and two drives in its frame."""

    name: str
    plan: OccupancyGrid
    first: ScanLog
    second: ScanLog


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = cli.Parser(
        prog="slams localize",
        description="Localize in simulated arenas: a second drive in the map of a first one and "
        f"in the arena's floor plan of {FLOOR_PLAN_CELL:g} m, and global localization of "
        f"{SEARCHES_PER_ARENA} scans in each arena.",
    )
    default = ["hector", "tsd"]
    p.add_argument("--algorithms", metavar="NAME", nargs="+", default=default, help="(hector tsd)")
    p.add_argument("--arenas", type=cli.count, default=10, metavar="N", help="number (%(default)s)")
    drive = within(float, 2.0, 14400.0)  # S
    p.add_argument("--duration", type=drive, default=30.0, metavar="S", help="of a drive (30)")
    p.add_argument("--size", type=float, metavar="M", help="of an arena, as slams simulate")
    return p


def _command(arguments: argparse.Namespace) -> int:
    from bench.report.text import text_table

    cli.refusing(lambda: _check(arguments))
    searched: list[dict[str, Any]] = []
    drives: list[dict[str, Any]] = []
    numbers = range(arguments.arenas)
    for number in cli.progress(numbers, len(numbers), "localizing", quiet=False, unit="arena"):
        place = cli.refusing(lambda number=number: _place(number, arguments))  # type: ignore[misc]
        searched += _searched(place)
        for label in arguments.algorithms:
            drives += _driven(place, label)
    sys.stdout.write(f"{search_words(searched)}\n\n{text_table(drive_table(drives), 'in')}\n")
    return 0


def _check(arguments: argparse.Namespace) -> None:
    from slams.localize.hooks import check_localizes
    from slams.registry import find

    for label in arguments.algorithms:
        entry = find(label)
        check_localizes(entry.cls(entry.params()), label)


def _place(number: int, arguments: argparse.Namespace) -> Place:
    """An arena and two drives with different seeds, in one frame."""
    from bench.sim.setting import Setting
    from bench.sim.simulation import simulate, world_of
    from slams.formats.occupancy import write_map

    kind = ("rescue", "office", "hall")[number % 3]
    made = simulate(Setting(kind, size=arguments.size, seed=number, duration=1.0))
    world = world_of(made)
    assert world is not None
    with TemporaryDirectory() as folder:
        write_map(Path(folder), world.grid())
        arena = str(Path(folder) / "map.yaml")
        first, second = (
            simulate(Setting(arena, seed=seed, duration=arguments.duration))
            for seed in (number, number + SECOND_DRIVE_SEED)
        )
    return Place(f"{kind} {number}", floor_plan(world), first, second)


def floor_plan(world: World) -> OccupancyGrid:
    """The world in cells of `FLOOR_PLAN_CELL`: occupied where a wall is, free where known."""
    cell = FLOOR_PLAN_CELL
    import numpy as np

    from slams.types import OccupancyGrid

    left, right, bottom, top = world.extent
    shape = tuple(math.ceil(round(side / cell, 6)) for side in (top - bottom, right - left))
    p = np.full(shape, np.nan)
    for cells, value in ((world.free, 0.0), (world.occupied, 1.0)):
        iy, ix = ((index + 0.5) * world.resolution / cell for index in np.nonzero(cells))
        p[iy.astype(int), ix.astype(int)] = value
    return OccupancyGrid(p.astype(np.float32), cell, world.origin)


def _searched(place: Place) -> Iterator[dict[str, Any]]:
    """Global localization of single scans of a drive in the floor plan."""
    import numpy as np

    from slams.localize import GlobalLocalizer, MapIndex
    from slams.types import Pose2

    index, log = MapIndex(place.plan), place.first
    truth = log.truth_at(log.t)
    assert truth is not None
    scans = list(log)
    GlobalLocalizer(index).add(scans[0])  # compiles the kernels
    for k in np.linspace(0, len(scans) - 1, SEARCHES_PER_ARENA).astype(int).tolist():
        start, localizer = time.process_time(), GlobalLocalizer(index)
        localizer.add(scans[k])
        spent, found = time.process_time() - start, localizer.candidates
        error = found[0].pose.between(Pose2(*truth[k])) if found else Pose2(math.inf, 0.0, 0.0)
        distance = math.hypot(error.x, error.y)
        right = bool(distance < MAX_PLACE_ERROR and abs(error.theta) < MAX_PLACE_ROTATION)
        confident = bool(found and found[0].probability >= MIN_PROBABILITY)
        yield {"right": right, "confident": confident, "error_m": distance, "cpu_s": spent}


def _driven(place: Place, label: str) -> Iterator[dict[str, Any]]:
    """The second drive in the algorithm's own map of the first, and in the floor plan."""
    from slams.localize import prepare
    from slams.localize.source import GivenMap
    from slams.player import replay
    from slams.registry import find
    from slams.types import IDENTITY, Pose2

    entry = find(label)
    slam, truth = entry.cls(entry.params()), place.first.truth_at(place.first.t)
    assert truth is not None
    replay(slam, place.first)
    for kind, given, frame in (
        ("first drive", GivenMap(slam.map(), slam), Pose2(*truth[0])),
        ("floor plan", GivenMap(place.plan), IDENTITY),
    ):
        row = {"algorithm": label, "map": kind}
        try:
            ready = prepare(entry, entry.params(), given)
            yield row | _figures(ready, place.second, frame)
        except RuntimeError as error:
            sys.stderr.write(f"{label} in the {kind} of {place.name}: {cli.sentence(error)}\n")
            yield row


def _figures(ready: Prepared, log: ScanLog, frame: Pose2) -> dict[str, float]:
    """Errors of the absolute pose [m]: at the start, and after it has settled.

    `frame` is the pose of the map's frame in the frame of the ground truth.

    Raises:
        RuntimeError: the global localization failed.
    """
    import numpy as np

    from slams.localize.source import find_start
    from slams.player import replay

    start = find_start(ready.map_index, log)
    rest = log.rows(slice(start.scan, None))
    run, truth = replay(ready.at(start.pose), rest), rest.truth_at(rest.t)
    assert truth is not None
    errors = np.hypot(*(frame.transform(run.poses[:, :2]) - truth[:, :2]).T)
    settled = errors[rest.t >= min(rest.t[0] + SETTLING_TIME, rest.t[-1])]
    return {
        "first_m": float(errors[0]),
        "mean_m": float(settled.mean()),
        "p95_m": float(np.percentile(settled, 95)),
    }


def search_words(rows: list[dict[str, Any]]) -> str:
    """Success, accuracy and cost of the searches in a sentence."""
    import pandas as pd

    found = pd.DataFrame(rows)
    right, wrong = found[found["right"]], found[~found["right"]]
    return (
        f"global localization: {len(right)} of {len(found)} correct, median error "
        f"{1e3 * right['error_m'].median():.0f} mm, {right['confident'].sum()} of them confident; "
        f"{wrong['confident'].sum()} of {len(wrong)} wrong ones confident; "
        f"median CPU {1e3 * found['cpu_s'].median():.0f} ms"
    )


def drive_table(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Errors [mm] by algorithm and map over the arenas: median and maximum."""
    import pandas as pd

    columns = ["algorithm", "map", "first_m", "mean_m", "p95_m"]
    runs = pd.DataFrame(rows, columns=columns).groupby(["map", "algorithm"], sort=False)
    table = pd.DataFrame(
        {
            "mean [mm]": 1e3 * runs["mean_m"].median(),
            "worst arena [mm]": 1e3 * runs["mean_m"].max(),
            "its 95 % [mm]": 1e3 * runs["p95_m"].max(),
            "where found [mm]": 1e3 * runs["first_m"].median(),
            "arenas": runs["mean_m"].count(),
        }
    )
    return table.set_axis([f"{kind}: {label}" for kind, label in table.index])


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
