"""slams localize: poses in a map that stays, against the truth."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from slams import cli

if TYPE_CHECKING:
    from bench.sim.world import World
    from slams.localize.source import Prepared
    from slams.scanlog import ScanLog
    from slams.types import OccupancyGrid, Pose2

PROGRAM = "slams localize"
FORMAT = "localize-1"
ARENAS = ("rescue", "office", "hall")
PLAN = 0.05  # [m] of a cell of the floor plan
NEAR, ALIGNED = 0.1, math.radians(3.0)  # [m], [rad]: a place that is found is right
OTHER = 1000  # from a drive's seed to that of the second one
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
        prog=PROGRAM,
        description="Localize in simulated arenas: a second drive in the map of a first one and in "
        f"the arena's floor plan (cells of {PLAN:g} m), and single scans without a start pose.",
        epilog="Writes localize.json.",
    )
    usual = ["hector", "tsd"]
    p.add_argument(
        "--algorithms", metavar="NAME", nargs="*", default=usual, help="names (default: hector tsd)"
    )
    counts = {"arenas": (10, "number of arenas"), "places": (20, "single scans in each arena")}
    for name, (number, text) in counts.items():
        shown = f"{text} (default: %(default)s)"
        p.add_argument(f"--{name}", type=int, default=number, metavar="N", help=shown)
    p.add_argument(
        "--duration",
        type=float,
        default=30.0,
        metavar="S",
        help="length of a drive [s] (default: %(default)g)",
    )
    p.add_argument("--size", type=float, metavar="M", help="longer side of an arena [m]")
    cli.add_output_options(p, "results/localize")
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    cli.one_thread()
    return cli.run_command(PROGRAM, lambda: _command(parser().parse_args(argv)))


def _command(arguments: argparse.Namespace) -> int:
    from bench.results import write_figures
    from slams.formats import files

    cli.refusing(lambda: _check(arguments))
    searched: list[dict[str, Any]] = []
    driven: list[dict[str, Any]] = []
    numbers = cli.progress(
        range(arguments.arenas), arguments.arenas, "localizing", arguments.quiet, unit="arena"
    )
    for number in numbers:
        place = cli.refusing(lambda number=number: _place(number, arguments))  # type: ignore[misc]
        searched += _searched(place, arguments.places)
        for label in arguments.algorithms:
            driven += _driven(place, label)
    figures = {"format": FORMAT, "searched": searched, "driven": driven}
    with files.complete_folder(Path(arguments.out)) as folder:
        write_figures(folder / "localize.json", figures)
    if not arguments.quiet:
        sys.stdout.write("\n".join([*_search_lines(searched), *_drive_lines(driven)]) + "\n")
    return 0


def _check(arguments: argparse.Namespace) -> None:
    from slams.formats.files import check_folder
    from slams.localize.hooks import check_localizes
    from slams.registry import find

    for name in ("arenas", "places"):
        if getattr(arguments, name) < 1:
            raise ValueError(f"--{name}: got {getattr(arguments, name)}, expected 1 or more")
    check_folder(arguments.out)
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


def _searched(place: Place, n: int) -> Iterator[dict[str, Any]]:
    """Single scans of a drive, each found from nothing in the floor plan."""
    import numpy as np

    from slams.localize.map_index import MapIndex
    from slams.types import Pose2

    index, log = MapIndex(place.plan), place.first
    truth = log.truth_at(log.t)
    assert truth is not None
    scans = list(log)
    index.search(scans[0])  # compiled
    for k in np.linspace(0, len(scans) - 1, n).astype(int).tolist():
        start = time.process_time()
        found = index.search(scans[k])
        spent = time.process_time() - start
        off = found[0].pose.between(Pose2(*truth[k])) if found else Pose2(math.inf, 0.0, 0.0)
        distance = math.hypot(off.x, off.y)
        right = bool(distance < NEAR and abs(off.theta) < ALIGNED)
        sure = bool(found and found[0].probability >= SURE)
        row = {"right": right, "sure": sure, "off_m": float(distance), "cpu_s": spent}
        yield {"place": place.name} | row


def _driven(place: Place, label: str) -> Iterator[dict[str, Any]]:
    """The second drive in the algorithm's own map of the first, and in the floor plan."""
    from slams.localize import prepare
    from slams.localize.source import Given
    from slams.player import replay
    from slams.registry import find
    from slams.types import IDENTITY, Pose2

    entry = find(label)
    slam, truth = entry.cls(entry.params()), place.first.truth_at(place.first.t)
    assert truth is not None
    replay(slam, place.first)
    for kind, given, frame in (
        ("first drive", Given(slam.map(), slam, label), Pose2(*truth[0])),
        ("floor plan", Given(place.plan, None, ""), IDENTITY),
    ):
        row = {"place": place.name, "algorithm": label, "map": kind}
        try:
            ready = prepare(entry, entry.params(), given)
            yield row | _figures(ready, place.second, frame)
        except RuntimeError as error:
            yield row | {"failed": cli.sentence(error)}


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
    rest = log.from_scan(start.scan)
    run, truth = replay(ready.at(start.pose), rest), rest.truth_at(rest.t)
    assert truth is not None
    errors = np.hypot(*(frame.transform(run.poses[:, :2]) - truth[:, :2]).T)
    settled = errors[rest.t >= rest.t[0] + SETTLING]
    return {
        "first_m": float(errors[0]),
        "mean_m": float(settled.mean()),
        "p95_m": float(np.percentile(settled, 95)),
    }


def _search_lines(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    import numpy as np

    right = [row for row in rows if row["right"]]
    wrong = [row for row in rows if not row["right"]]
    unsure = sum(not row["sure"] for row in wrong)
    yield (
        f"found from nothing: {len(right)} of {len(rows)} right, "
        f"{1e3 * np.median([row['off_m'] for row in right or rows]):.0f} mm off in the median; "
        f"{sum(row['sure'] for row in right)} of them sure; {unsure} of {len(wrong)} wrong ones "
        f"unsure; {1e3 * np.median([row['cpu_s'] for row in rows]):.0f} ms CPU in the median"
    )


def _drive_lines(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """For each algorithm and map: errors over the places, and in the worst place."""
    import numpy as np

    for kind in dict.fromkeys((row["algorithm"], row["map"]) for row in rows):
        these = [row for row in rows if (row["algorithm"], row["map"]) == kind]
        good = [row for row in these if "failed" not in row]
        if good:
            first, mean, p95 = (
                1e3 * np.array([row[f"{name}_m"] for row in good])
                for name in ("first", "mean", "p95")
            )
            yield (
                f"{kind[0]} in the {kind[1]}: mean {np.median(mean):.1f} mm in the median arena, "
                f"{mean.max():.1f} in the worst, 95 % below {p95.max():.1f}; where it was found "
                f"{np.median(first):.0f} mm; {len(good)} of {len(these)} arenas"
            )
        for row in these:
            if "failed" in row:
                yield f"{kind[0]} in the {kind[1]} of {row['place']}: {row['failed']}"


if __name__ == "__main__":
    sys.exit(main())
