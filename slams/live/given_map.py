"""Localization in a given map: global localization scan by scan, then tracking."""

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
from slams.registry import label_of
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan

if TYPE_CHECKING:
    from slams.registry import Entry


class GivenMapSlam:
    """A `Slam` that localizes in a fixed map; after global localization its `localizer` tracks.

    From the scan at which the robot is localized, the poses are those of `slams.run --localize` on
    the same scans. Until then they are those of the likeliest candidate, and `explained` is the
    share of the last scan's beams that the map explains there, 0..1. The constructor is slow.

    Args:
        entry: the algorithm.
        params: its parameters, which those of a state have to equal if they `are_given`.
        given: the map.
        start: approximate pose of the base at the first scan, x, y [m], theta [rad]; None:
            global localization.
        notes: receives a sentence with the pose at which the robot was localized.

    Raises:
        OSError, TypeError, ValueError: as `open_map` and `prepare`.
    """

    Params: ClassVar[type[Parameters]] = Parameters
    state = LOST

    def __init__(
        self,
        entry: Entry,
        params: Parameters,
        are_given: bool,
        given: str | Path | OccupancyGrid,
        start: Sequence[float] | None,
        notes: list[str],
    ) -> None:
        own = label_of(entry.cls)
        opened = (
            GivenMap(given) if isinstance(given, OccupancyGrid) else open_map(given, notes, own)
        )
        self._prepared, self._notes = prepare(entry, params, opened, are_given), notes
        self.params = getattr(self._prepared.slam, "params", params)
        self._start = None if start is None else Pose2(*map(float, start))
        if start is None:
            self._prepared.map_index.prepare(Work())
        self._global_localizer = GlobalLocalizer(self._prepared.map_index)
        self._n_searched = 0
        self.localizer: Localizer | None = None
        self.explained = 0.0

    def update(self, scan: Scan) -> Pose2:
        """Process the next scan; gives the base's pose in the map, or the likeliest candidate."""
        if self._start is not None:
            _, pose, note = start_at(self._prepared.map_index, [scan], self._start)
        elif (found := self._global_localizer.add(scan)) is not None:
            pose, note = found.pose, f"found at {found} after {self._n_searched} scans"
        else:
            self._n_searched += 1
            best = self._global_localizer.candidates[:1]
            self.explained = best[0].inliers if best else 0.0
            return best[0].pose if best else IDENTITY
        self._notes.append(note)
        self.localizer = self._prepared.at(pose)
        return self.localizer.update(scan)

    def map(self) -> OccupancyGrid:
        """The given map."""
        return self._prepared.map_index.grid

    def report(self) -> dict[str, Any]:
        """The algorithm's counts."""
        return dict(self._prepared.slam.report())

    @property
    def candidates(self) -> str:
        """The likeliest candidates as text."""
        return f"most likely: {self._global_localizer.likely}"
