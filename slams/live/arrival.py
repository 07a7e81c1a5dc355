"""Arrival: an algorithm in a map that stays, on a robot that has to find out where it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from slams.live.estimate import LOST
from slams.localize.global_localizer import GlobalLocalizer
from slams.localize.localizer import Localizer
from slams.localize.source import Given, Prepared, open_map, prepare
from slams.params import Params
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan

if TYPE_CHECKING:
    from slams.registry import Entry


class Arrival:
    """A `Slam` that seeks its place in a map, scan by scan, and from there on is a `Localizer`.

    From the scan at which the place is sure the poses are those of `slams.run --localize` on the
    same scans. Before, they are the likeliest place's, `found` is False, and `state` "lost".
    `explained` is the share of the last scan's beams that the map explains there.

    Args:
        ready: the algorithm with the map.
        start: about where the base is at the first scan; None seeks it.
        notes: gets a sentence about where it was found.
    """

    Params: ClassVar[type[Params]] = Params

    def __init__(self, ready: Prepared, start: Pose2 | None, notes: list[str]) -> None:
        self._ready, self._start, self._notes = ready, start, notes
        self._global = GlobalLocalizer(ready.map_index)
        self._localizer: Localizer | None = None
        self._sought = 0

    def anew(self) -> Arrival:
        """Another that seeks its place in the same map, or takes the same start."""
        return Arrival(self._ready, self._start, self._notes)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; the base's pose in the map, or the likeliest one."""
        if self._localizer is None:
            self._seek(scan)
        return self._likeliest if self._localizer is None else self._localizer.update(scan)

    def map(self) -> OccupancyGrid:
        """The map it was given."""
        return self._ready.map_index.grid

    def report(self) -> dict[str, Any]:
        """The algorithm's counts, how much the map explains, and the scans it was sought for."""
        told = dict((self._localizer or self._ready.slam).report())
        return told | {"sought": self._sought}

    @property
    def found(self) -> bool:
        """Whether the place is known."""
        return self._localizer is not None

    @property
    def state(self) -> Any:
        """The algorithm's own, where it has one; "lost" while the place is sought."""
        if self._localizer is None:
            return LOST
        own = getattr(self._ready.slam, "state", None)
        return getattr(self._localizer, "state", own)

    @property
    def explained(self) -> float:
        """Share of the last scan's beams that the map explains, 0..1."""
        if self._localizer is not None:
            return self._localizer.explained
        return self._global.candidates[0].inliers if self._global.candidates else 0.0

    @property
    def quality(self) -> float:
        """The algorithm's own; nan where it has none yet."""
        return math.nan if self._localizer is None else self._localizer.quality

    @property
    def covariance(self) -> Floats:
        """The algorithm's own (3, 3) [m, rad], in the map's frame; inf while it is sought."""
        return np.diag([math.inf] * 3) if self._localizer is None else self._localizer.covariance

    @property
    def doubt(self) -> str:
        """The likeliest places while the place is sought, as a sentence's end; else nothing."""
        if self._localizer is not None:
            return ""
        return f"most likely: {self._global.likely}"

    @property
    def _likeliest(self) -> Pose2:
        return self._global.candidates[0].pose if self._global.candidates else IDENTITY

    def _seek(self, scan: Scan) -> None:
        if self._start is not None:
            match = self._ready.map_index.match(scan, [self._start])[0]
            self._begin(match.pose, f"starts at {match}")
            return
        found = self._global.add(scan)
        if found is None:
            self._sought += 1
            return
        self._begin(found.pose, f"found at {found} after {self._sought} scans")

    def _begin(self, pose: Pose2, note: str) -> None:
        self._notes.append(note)
        self._localizer = self._ready.at(pose)


def arrival(
    entry: Entry,
    params: Params,
    place: str | Path | OccupancyGrid | None,
    start: Sequence[float] | None,
    notes: list[str],
) -> Arrival | None:
    """An algorithm about to arrive in a map, if there is one; all that takes long is done.

    Raises:
        OSError, TypeError, ValueError: as `open_map` and `prepare`; or a start without a map.
    """
    if place is None:
        if start is not None:
            raise ValueError("map_start: got a place without a map; expected map, too")
        return None
    ready = prepare(entry, params, _given(place, notes))
    if start is not None:
        return Arrival(ready, Pose2(*map(float, start)), notes)
    _ = ready.map_index.lattice  # a second per 1000 m^2, before the scans come
    return Arrival(ready, None, notes)


def _given(place: str | Path | OccupancyGrid, notes: list[str]) -> Given:
    if isinstance(place, OccupancyGrid):
        return Given(place, None, "")
    return open_map(place, notes)
