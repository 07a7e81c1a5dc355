"""Maps to localize in, saved states or yaml files of map_server, and the start in them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from slams.localize.global_localizer import GlobalLocalizer
from slams.localize.hooks import Localizes, check_localizes
from slams.localize.localizer import Localizer
from slams.localize.map_index import MapIndex, has_enough
from slams.localize.virtual import build
from slams.types import IDENTITY, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from slams.params import Params
    from slams.registry import Entry
    from slams.scanlog import ScanLog
    from slams.types import Scan, Slam

ZIP_MAGIC = b"PK"  # first bytes of a saved state


class GivenMap(NamedTuple):
    """A given map as a grid; if it is a state, with its algorithm; `name` for messages."""

    grid: OccupancyGrid
    slam: Slam | None = None
    name: str = "map"


class Prepared(NamedTuple):
    """An algorithm with its frozen map, the given map, and the algorithm's frame in it."""

    slam: Localizes
    map_index: MapIndex
    origin: Pose2

    def at(self, start: Pose2) -> Localizer:
        """The algorithm, started at a pose in the map."""
        return Localizer(self.slam, self.map_index, start, self.origin)


def open_map(path: str | Path, notes: list[str] | None = None, own: str = "") -> GivenMap:
    """Read a saved state, or a map_server yaml with its image; `own` as in `read_state`.

    Raises:
        OSError: a file cannot be opened.
        ValueError: the file is neither; the message gives the reason.
    """
    from slams.formats.occupancy import read_map
    from slams.state import read_state

    path = Path(path)
    with path.open("rb") as file:
        is_state = file.read(len(ZIP_MAGIC)) == ZIP_MAGIC
    if not is_state:
        return GivenMap(read_map(path, notes), name=str(path))
    slam = read_state(path, own=own).slam
    return GivenMap(slam.map(), slam, str(path))


def prepare(entry: Entry, params: Params, given: GivenMap, are_given: bool = False) -> Prepared:
    """An algorithm in a given map: its own state, or a new one after a virtual drive.

    `are_given` tells whether the user gave parameters: those of a state cannot be changed.

    Raises:
        TypeError: the algorithm does not implement `Localizes`.
        ValueError: the map has no wall or no free space, or its algorithm other parameters.
    """
    from slams.state.store import check_params

    try:
        index = MapIndex(given.grid)
    except ValueError as error:
        raise ValueError(f"{given.name}: {error}") from None
    if given.slam is not None and type(given.slam) is entry.cls:
        check_params(given.name, given.slam, params, are_given)
        slam = check_localizes(given.slam, entry.label)
        slam.frozen = True
        return Prepared(slam, index, IDENTITY)
    slam = check_localizes(entry.cls(params), entry.label)
    return Prepared(slam, index, build(slam, index.distances))


class Start(NamedTuple):
    """Start of a log in a map: number of the scan, its pose, a note for the user."""

    scan: int
    pose: Pose2
    note: str


def start_at(index: MapIndex, log: Iterable[Scan], pose: Pose2) -> Start:
    """Start at the first scan, fitted to the map near the given pose.

    Raises:
        ValueError: the scan does not fit at all.
    """
    scan = next(iter(log))
    match = index.match(scan, [pose])[0]
    if match.inliers == 0.0 and has_enough(scan):
        at = f"{pose.x:g}, {pose.y:g} m"
        raise ValueError(f"start: no beam of the first scan ends at a wall of the map near {at}")
    return Start(0, match.pose, f"starts at {match}")


def find_start(index: MapIndex, log: ScanLog) -> Start:
    """Start at the first scan of a log at which its pose in the map is certain.

    Raises:
        RuntimeError: no pose is certain; the message has the most likely ones.
    """
    localizer = GlobalLocalizer(index)
    for number, scan in enumerate(log):
        found = localizer.add(scan)
        if found is not None:
            return Start(number, found.pose, f"found at {found} by scan {number} of {len(log)}")
    raise RuntimeError(
        f"{log.name}: no certain pose in the map after all {len(log)} scans (most likely: "
        f"{localizer.likely}); expected a log that leaves similar places, or --start"
    )


def pose_of(text: str) -> Pose2:
    """Parse a pose "x,y,theta" of the command line [m, rad].

    Raises:
        ValueError: the text is no pose.
    """
    try:
        x, y, theta = map(float, text.split(","))
        if not all(map(math.isfinite, (x, y, theta))):
            raise ValueError
    except ValueError:
        raise ValueError(f"--start: got {text!r}, expected x,y,theta in m and rad") from None
    return Pose2(x, y, theta)
