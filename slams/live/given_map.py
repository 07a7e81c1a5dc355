"""A robot whose place in a map that stays may be unknown: it is sought scan by scan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from slams.live.estimate import LOST
from slams.localize.global_localizer import GlobalLocalizer
from slams.localize.localizer import Localizer
from slams.localize.map_index import Work
from slams.localize.source import GivenMap, open_map, prepare, start_at
from slams.params import Params as Parameters  # the class has a Params
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan

if TYPE_CHECKING:
    from slams.registry import Entry


class Seeker:
    """A `Slam` that seeks its place in a map; once that is sure, its `localizer` goes on.

    From the scan at which the place is sure the poses are those of `slams.run --localize` on the
    same scans. Before, they are the likeliest place's, and `explained` is the share of the last
    scan's beams that the map explains there, 0..1.

    Slow preparations are done in the constructor, before the scans come.

    Args:
        entry: the algorithm.
        params: its parameters.
        given: the map.
        start: about where the base is at the first scan, x, y [m], theta [rad]; None seeks it.
        notes: gets a sentence about where it was found.

    Raises:
        OSError, TypeError, ValueError: as `open_map` and `prepare`.
    """

    Params: ClassVar[type[Parameters]] = Parameters
    state = LOST

    def __init__(
        self,
        entry: Entry,
        params: Parameters,
        given: str | Path | OccupancyGrid,
        start: Sequence[float] | None,
        notes: list[str],
    ) -> None:
        if isinstance(given, OccupancyGrid):
            whole = GivenMap(given, None, "")
        else:
            whole = open_map(given, notes)
        self._ready, self._notes = prepare(entry, params, whole), notes
        self._start = None if start is None else Pose2(*map(float, start))
        if start is None:
            self._ready.map_index.prepare(Work())
        self._global = GlobalLocalizer(self._ready.map_index)
        self._sought = 0
        self.localizer: Localizer | None = None
        self.explained = 0.0

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; the base's pose in the map, or the likeliest one."""
        if self._start is not None:
            _, pose, note = start_at(self._ready.map_index, [scan], self._start)
        elif (found := self._global.add(scan)) is not None:
            pose, note = found.pose, f"found at {found} after {self._sought} scans"
        else:
            self._sought += 1
            best = self._global.candidates[:1]
            self.explained = best[0].inliers if best else 0.0
            return best[0].pose if best else IDENTITY
        self._notes.append(note)
        self.localizer = self._ready.at(pose)
        return self.localizer.update(scan)

    def map(self) -> OccupancyGrid:
        """The map it was given."""
        return self._ready.map_index.grid

    def report(self) -> dict[str, Any]:
        """The algorithm's counts."""
        return dict(self._ready.slam.report())

    @property
    def candidates(self) -> str:
        """The likeliest places in words."""
        return f"most likely: {self._global.likely}"
