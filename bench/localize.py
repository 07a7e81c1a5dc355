"""slams localize: poses in a map that stays, against the truth."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from slams import cli

if TYPE_CHECKING:
    import pandas as pd

    from bench.sim.world import World
    from slams.localize.source import Prepared
    from slams.scanlog import ScanLog
    from slams.types import OccupancyGrid, Pose2

ARENAS = ("rescue", "office", "hall")
PLAN = 0.05  # [m] of a cell of the floor plan
NEAR, ALIGNED = 0.1, math.radians(3.0)  # [m], [rad]: a place that is found is right
OTHER = 1000  # from a drive's seed to that of the second one
PLACES = 20  # of each arena, to be found
SURE = 0.95  # probability
SETTLING = 1.0  # [s] after it was found, in which the pose is pulled to where the map has it


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
        f"in the arena's floor plan of {PLAN:g} m, and {PLACES} scans of each found from nothing.",
    )
    usual = ["hector", "tsd"]
    p.add_argument("--algorithms", metavar="NAME", nargs="*", default=usual, help="hector tsd")
    p.add_argument("--arenas", type=cli.count, default=10, metavar="N", help="%(default)s")
    p.add_argument("--duration", type=float, default=30.0, metavar="S", help="of a drive (30)")
    p.add_argument("--size", type=float, metavar="M", help="of an arena, as slams simulate")
    return p


def _command(arguments: argparse.Namespace) -> int:
    from bench.report.text import text_table

    cli.refusing(lambda: _check(arguments))
    searched: list[dict[str, Any]] = []
    driven: list[dict[str, Any]] = []
    numbers = range(arguments.arenas)
    for number in cli.progress(numbers, len(numbers), "localizing", quiet=False, unit="arena"):
        place = cli.refusing(lambda number=number: _place(number, arguments))  # type: ignore[misc]
        searched += _searched(place)
        for label in arguments.algorithms:
            driven += _driven(place, label)
    sys.stdout.write(f"{search_words(searched)}\n\n{text_table(drive_table(driven), 'in')}\n")
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

    kind = ARENAS[number % len(ARENAS)]
    made = simulate(Setting(kind, size=arguments.size, seed=number, duration=1.0))
    world = world_of(made)
    assert world is not None
    with TemporaryDirectory() as folder:
        write_map(Path(folder), world.grid())
        arena = str(Path(folder) / "map.yaml")
        first, second = (
            simulate(Setting(arena, seed=seed, duration=arguments.duration))
            for seed in (number, number + OTHER)
        )
    return Place(f"{kind} {number}", floor_plan(world), first, second)


def floor_plan(world: World) -> OccupancyGrid:
    """The world's picture in cells of `PLAN`: dark wherever a wall is, white where it is known."""
    import numpy as np

    from slams.types import OccupancyGrid

    left, right, bottom, top = world.extent
    shape = tuple(math.ceil(round(side / PLAN, 6)) for side in (top - bottom, right - left))
    p = np.full(shape, np.nan)
    for cells, value in ((world.free, 0.0), (world.occupied, 1.0)):
        iy, ix = ((index + 0.5) * world.resolution / PLAN for index in np.nonzero(cells))
        p[iy.astype(int), ix.astype(int)] = value
    return OccupancyGrid(p.astype(np.float32), PLAN, world.origin)


def _searched(place: Place) -> Iterator[dict[str, Any]]:
    """Single scans of a drive, each found from nothing in the floor plan."""
    import numpy as np

    from slams.localize.map_index import MapIndex
    from slams.types import Pose2

    index, log = MapIndex(place.plan), place.first
    truth = log.truth_at(log.t)
    assert truth is not None
    scans = list(log)
    index.search(scans[0])  # compiled
    for k in np.linspace(0, len(scans) - 1, PLACES).astype(int).tolist():
        start = time.process_time()
        found = index.search(scans[k])
        spent = time.process_time() - start
        off = found[0].pose.between(Pose2(*truth[k])) if found else Pose2(math.inf, 0.0, 0.0)
        distance = math.hypot(off.x, off.y)
        right = bool(distance < NEAR and abs(off.theta) < ALIGNED)
        sure = bool(found and found[0].probability >= SURE)
        yield {"right": right, "sure": sure, "off_m": distance, "cpu_s": spent}


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
        ("first drive", GivenMap(slam.map(), slam, label), Pose2(*truth[0])),
        ("floor plan", GivenMap(place.plan, None, ""), IDENTITY),
    ):
        row = {"algorithm": label, "map": kind}
        try:
            ready = prepare(entry, entry.params(), given)
            yield row | _figures(ready, place.second, frame)
        except RuntimeError as error:
            sys.stderr.write(f"{label} in the {kind} of {place.name}: {cli.sentence(error)}\n")
            yield row


def _figures(ready: Prepared, log: ScanLog, frame: Pose2) -> dict[str, float]:
    """Errors of the absolute pose [m]: where it was found, and once it has settled.

    `frame` is the map's in that of the truth, by the first scan that went into it.

    Raises:
        RuntimeError: the place is not found.
    """
    import numpy as np

    from slams.localize.source import find_start
    from slams.player import replay

    start = find_start(ready.map_index, log)
    rest = log.rows(slice(start.scan, None))
    run, truth = replay(ready.at(start.pose), rest), rest.truth_at(rest.t)
    assert truth is not None
    errors = np.hypot(*(frame.transform(run.poses[:, :2]) - truth[:, :2]).T)
    settled = errors[rest.t >= rest.t[0] + SETTLING]
    return {
        "first_m": float(errors[0]),
        "mean_m": float(settled.mean()),
        "p95_m": float(np.percentile(settled, 95)),
    }


def search_words(rows: list[dict[str, Any]]) -> str:
    """How many scans were found, how well, and at which cost."""
    import pandas as pd

    found = pd.DataFrame(rows)
    right, wrong = found[found["right"]], found[~found["right"]]
    return (
        f"found from nothing: {len(right)} of {len(found)} right, "
        f"{1e3 * right['off_m'].median():.0f} mm off in the median, {right['sure'].sum()} of them "
        f"sure; {wrong['sure'].sum()} of {len(wrong)} wrong ones sure; "
        f"{1e3 * found['cpu_s'].median():.0f} ms CPU in the median"
    )


def drive_table(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """For each algorithm and map: errors [mm] over the arenas, in the median and the worst one."""
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
