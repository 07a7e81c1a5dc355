"""A map to localize in: a saved state, or the yaml of map_server; and where to begin in it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from slams.localize.global_localizer import GlobalLocalizer
from slams.localize.hooks import Localizes, check_localizes
from slams.localize.localizer import Localizer
from slams.localize.map_index import MapIndex
from slams.localize.virtual import build
from slams.types import IDENTITY, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from slams.params import Params
    from slams.registry import Entry
    from slams.scanlog import ScanLog
    from slams.types import Scan, Slam

ZIP = b"PK"  # how a saved state begins


class Given(NamedTuple):
    """A map: as a grid, with the algorithm it is the own map of, if it is a state."""

    grid: OccupancyGrid
    slam: Slam | None
    label: str


class Prepared(NamedTuple):
    """An algorithm with its own, frozen map of a map index, and its frame's place in there."""

    slam: Localizes
    map_index: MapIndex
    origin: Pose2

    def at(self, start: Pose2) -> Localizer:
        """The algorithm, begun at a pose in the map."""
        return Localizer(self.slam, self.map_index, start, self.origin)


def open_map(path: str | Path, notes: list[str] | None = None) -> Given:
    """Read a saved state, or a map_server yaml with its picture.

    Raises:
        OSError: a file cannot be opened.
        ValueError: it is neither; the sentence says why.
    """
    from slams.formats.occupancy import read_map
    from slams.state import read_state

    path = Path(path)
    with path.open("rb") as file:
        is_state = file.read(len(ZIP)) == ZIP
    if not is_state:
        return Given(read_map(path, notes), None, "")
    state = read_state(path)
    return Given(state.slam.map(), state.slam, state.label)


def prepare(entry: Entry, params: Params, given: Given) -> Prepared:
    """An algorithm in a map: its own state, or new with a virtual drive through any other map.

    Raises:
        TypeError: the algorithm does not offer the hooks.
        ValueError: the map is no floor with walls.
    """
    from slams.registry import label_of

    index = MapIndex(given.grid)
    if given.slam is not None and given.label == label_of(entry.cls):
        slam = check_localizes(given.slam, entry.label)
        slam.frozen = True
        return Prepared(slam, index, IDENTITY)
    slam = check_localizes(entry.cls(params), entry.label)
    return Prepared(slam, index, build(slam, index.distances))


class Start(NamedTuple):
    """Where a log begins in a map: the number of the scan, the pose there, what to tell."""

    scan: int
    pose: Pose2
    note: str


def start_at(index: MapIndex, log: Iterable[Scan], pose: Pose2) -> Start:
    """The first scan, at the pose near the given one where it fits best."""
    match = index.match(next(iter(log)), [pose])[0]
    return Start(0, match.pose, f"starts at {match}")


def find_start(index: MapIndex, log: ScanLog) -> Start:
    """The first scan of a log at which its pose in the map is certain.

    Raises:
        RuntimeError: it never is; the sentence tells the most likely places.
    """
    localizer = GlobalLocalizer(index)
    for number, scan in enumerate(log):
        found = localizer.add(scan)
        if found is not None:
            return Start(number, found.pose, f"found at {found} by scan {number} of {len(log)}")
    raise RuntimeError(
        f"{log.name}: its place in the map is not sure after all {len(log)} scans (most likely: "
        f"{localizer.likely}); expected a log that leaves alike places, or --start"
    )


def pose_of(text: str) -> Pose2:
    """The pose "x,y,theta" of the command line [m, rad].

    Raises:
        ValueError: it is none.
    """
    try:
        x, y, theta = map(float, text.split(","))
        if not all(map(math.isfinite, (x, y, theta))):
            raise ValueError
    except ValueError:
        raise ValueError(f"--start: got {text!r}, expected x,y,theta in m and rad") from None
    return Pose2(x, y, theta)
