"""An algorithm in a map that stays as it is, on a robot whose place in it may be unknown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from slams.live.estimate import LOST
from slams.localize.global_localizer import GlobalLocalizer
from slams.localize.localizer import Localizer
from slams.localize.map_index import Work
from slams.localize.source import Given, open_map, prepare
from slams.params import Params as Parameters  # the class has a Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan

if TYPE_CHECKING:
    from slams.registry import Entry


class InGivenMap:
    """A `Slam` that seeks its place in a map, scan by scan, and from there on is a `Localizer`.

    From the scan at which the place is sure the poses are those of `slams.run --localize` on the
    same scans. Before, they are the likeliest place's, `found` is False, and `state` "lost".
    `explained` is the share of the last scan's beams that the map explains there, 0..1.

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

    def __init__(
        self,
        entry: Entry,
        params: Parameters,
        given: str | Path | OccupancyGrid,
        start: Sequence[float] | None,
        notes: list[str],
    ) -> None:
        if isinstance(given, OccupancyGrid):
            whole = Given(given, None, "")
        else:
            whole = open_map(given, notes)
        self._ready, self._notes = prepare(entry, params, whole), notes
        self._start = None if start is None else Pose2(*map(float, start))
        if start is None:
            self._ready.map_index.prepare(Work())
        self._global = GlobalLocalizer(self._ready.map_index)
        self._localizer: Localizer | None = None
        self._sought = 0
        self.state: Any = LOST
        self.explained, self.quality = 0.0, math.nan
        self.covariance: Floats = np.diag([math.inf] * 3)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; the base's pose in the map, or the likeliest one."""
        localizer = self._localizer = self._localizer or self._sought_place(scan)
        if localizer is None:
            self._sought += 1
            best = self._global.candidates[:1]
            self.explained = best[0].inliers if best else 0.0
            return best[0].pose if best else IDENTITY
        pose = localizer.update(scan)
        self.state = getattr(localizer, "state", getattr(self._ready.slam, "state", None))
        self.explained, self.quality = localizer.explained, localizer.quality
        self.covariance = localizer.covariance
        return pose

    def map(self) -> OccupancyGrid:
        """The map it was given."""
        return self._ready.map_index.grid

    def report(self) -> dict[str, Any]:
        """The algorithm's counts, how much the map explains, and for how many scans it sought."""
        return dict((self._localizer or self._ready.slam).report()) | {"sought": self._sought}

    @property
    def found(self) -> bool:
        """Whether the place is known."""
        return self._localizer is not None

    @property
    def candidates(self) -> str:
        """The likeliest places in words, while the place is sought."""
        return "" if self.found else f"most likely: {self._global.likely}"

    def _sought_place(self, scan: Scan) -> Localizer | None:
        """The algorithm at the given start or at the place that was found; None while in doubt."""
        if self._start is not None:
            match = self._ready.map_index.match(scan, [self._start])[0]
            pose, note = match.pose, f"starts at {match}"
        else:
            found = self._global.add(scan)
            if found is None:
                return None
            pose, note = found.pose, f"found at {found} after {self._sought} scans"
        self._notes.append(note)
        return self._ready.at(pose)
