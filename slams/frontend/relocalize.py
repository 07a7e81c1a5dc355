"""Global localization in an algorithm's own map, with bounded work for each scan.

A lost robot is searched for in the part of the map around its predicted pose. The part is drawn,
made into distance maps and into a view lattice; a scan is compared with all points of the lattice,
and the best poses are fitted. These stages are spread over scans. The poses that explain the scan
are then tracked, and a second scan, some distance or time later, is searched for as well. A pose
that explains both, and better than any other, is returned. As long as several poses are as good,
the robot has to drive on; when none explains the scan, a new search begins after a pause.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from slams.frontend.map_part import MapPart
from slams.grid_bounds import Box
from slams.localize.finder import STILL, SURE, TURN, WAY
from slams.localize.places import Disc
from slams.localize.search import Atlas, Candidate, Search, apart, is_same, merged, shows_enough
from slams.patience import Patience
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan

MAX_HALF_WIDTH = 20.0  # m, of the part of the map that is searched: 800^2 cells of 0.05 m
MARGIN = 4.0  # m around `reach`: driven while the map is made ready; as much again for its walls
COMPARISONS = 2_000  # points of the lattice compared with one scan: 8 ms at 4 us
FITS = 40  # poses fitted and judged for one scan: 5 to 10 ms at 0.12 to 0.25 ms
MIN_EVIDENCE = 0.6  # share of a scan's beams explained less that refuted, at the robot's pose
MAX_REFUTED = 0.1  # share of a scan's beams through walls of the map, at the robot's pose
PAUSES = 0.5, 8.0  # s, the first and the longest pause after searches that came to nothing


class Observation(NamedTuple):
    """A scan, the predicted pose of the base, and the farthest that the base is from it [m]."""

    scan: Scan
    predicted: Pose2
    reach: float

    def reaches(self, pose: Pose2) -> bool:
        """Whether the base can be at `pose`."""
        away = math.hypot(pose.x - self.predicted.x, pose.y - self.predicted.y)
        return away <= self.reach


class Relocalizer:
    """Global localization in the algorithm's own map; bounded work per scan.

    A robot within `MAX_HALF_WIDTH` of the predicted pose at which a search begins is found. `found`
    counts relocalized poses. `work` is what the last update took, as a share 0..1 of the most that
    a scan may take: counted in cells, rays, comparisons and fits, never in time, so that the same
    input gives the same output. A map that is drawn counts 1.
    """

    def __init__(self, enabled: bool = True) -> None:
        self.found = 0
        self.work = 0.0
        self._enabled = enabled
        self._pause = Patience(*PAUSES)
        self.reset()

    def reset(self) -> None:
        """The pose is known again: forget everything."""
        self._pause.forget()
        self._time = math.inf  # stamp of the last scan [s]
        self._forget_search()

    def _forget_search(self) -> None:
        self._part: MapPart | None = None
        self._search: Search | None = None
        self._at: Observation | None = None  # which the tracked poses belong to
        self._later: list[Observation] = []  # those after it, up to the last scan
        self._tracked: list[Candidate] = []  # the most likely first
        self._moved: list[Candidate] = []  # tracked to the first of the later ones
        self._complete = self._confirmed = False  # all are tracked; the first stood in two searches
        self._searched_at, self._searched_from = 0.0, IDENTITY  # stamp and first pose then

    def update(
        self,
        scan: Scan,
        predicted: Pose2,
        reach: float,
        draw: Callable[[Box], OccupancyGrid | None],
    ) -> Pose2 | None:
        """Take a scan of a lost robot; the base's pose at this scan, once it is certain, else None.

        Args:
            scan: ignored if less than 20 directions are valid.
            predicted: dead-reckoned pose of the base in the map; motion is taken from its steps.
            reach: how far from it the base can be [m]; may be inf.
            draw: part of the map as a grid, without scans inserted while lost; None if none.
        """
        self.work = 0.0
        if not (self._enabled and all(map(math.isfinite, (scan.t, *predicted)))):
            return None
        self._pause.wait(max(scan.t - self._time, 0.0))
        self._time = scan.t
        if not (self._pause.over and reach >= 0.0 and shows_enough(scan)):
            return None
        now = Observation(scan, predicted, reach)
        if self._part is None:
            self._draw(now, draw)
            return None
        if self._at is not None:
            self._later.append(now)
        self._work_on(self._part, now)
        if self._later or not self._certain:
            return None
        pose = self._tracked[0].pose
        self.reset()
        self.found += 1
        return pose

    def _draw(self, now: Observation, draw: Callable[[Box], OccupancyGrid | None]) -> None:
        self.work = 1.0
        (x, y, _), reach = now.predicted, now.reach
        grid = draw(Box.around(x, y, min(reach + 2.0 * MARGIN, MAX_HALF_WIDTH)))
        if grid is None or grid.p.size == 0:
            self._give_up()
        else:
            self._part = MapPart(grid, Disc(x, y, reach + MARGIN))

    def _work_on(self, part: MapPart, now: Observation) -> None:
        """Do pieces until the next one is more than what is left of this scan's work."""
        done = math.inf
        while done > 0.0 and self._part is not None:
            share, atlas = 1.0 - self.work, part.ready
            done = self._piece(atlas, share, now) if atlas else self._prepare(part, share)
            self.work += done

    def _prepare(self, part: MapPart, share: float) -> float:
        try:
            return part.prepare(share)
        except ValueError:  # no walls
            self._give_up()
            return 0.0

    def _piece(self, atlas: Atlas, share: float, now: Observation) -> float:
        """Search, else track, else begin a search; returns the share of a scan's work done."""
        if self._at is None:
            self._at = now
        if self._search is None and self._later:
            return self._track(atlas, self._at, share)
        if self._search is None:
            if self._tracked and not self._due(self._at):
                return 0.0
            self._search = Search(atlas, self._at.scan)
        return self._search_on(self._search, self._at, share)

    def _search_on(self, search: Search, at: Observation, share: float) -> float:
        """Compare a scan with the lattice, fit the best poses, then keep what explains the scan."""
        if search.to_compare:
            count = min(int(share * COMPARISONS), search.to_compare)
            search.compare(count)
            return count / COMPARISONS
        count = min(int(share * FITS), search.to_look)
        search.look(count)
        if not search.to_look:
            self._search = None
            self._conclude(at, search.candidates)
        return count / FITS

    def _conclude(self, at: Observation, fresh: list[Candidate]) -> None:
        """Track the poses that explain the scan; give up if none does."""
        known = apart(self._tracked) if self._complete else []
        known, fresh = ([c for c in poses if at.reaches(c.pose)] for poses in (known, fresh))
        every = merged(known, fresh)
        if not any(map(explains, every)):
            self._give_up()
            return
        self._tracked = every[: FITS // 2]  # two scans can be worked on in one
        self._complete = len(every) == len(self._tracked)
        self._confirmed = any(is_same(every[0].pose, c.pose) for c in known)
        self._searched_at, self._searched_from = at.scan.t, every[0].pose

    def _track(self, atlas: Atlas, at: Observation, share: float) -> float:
        """Fit the tracked poses to the next scan, from where the predicted motion leads."""
        now, first = self._later[0], len(self._moved)
        step = at.predicted.between(now.predicted)
        poses = self._tracked[first : first + int(share * FITS)]
        moved = [atlas.look(now.scan, c.pose @ step)._replace(odds=c.odds) for c in poses]
        self._moved += moved
        if len(self._moved) == len(self._tracked):
            self._at, self._tracked, self._moved = self._later.pop(0), self._moved, []
        return len(moved) / FITS

    def _due(self, at: Observation) -> bool:
        """Whether a scan tells something new, or some time later can confirm the first pose.

        Alike poses are not compared again while the robot stands: its scans share their errors,
        which would add up to a wrong certainty.
        """
        if self._certain:
            return False
        first = self._tracked[0]
        way = self._searched_from.between(first.pose)
        if math.hypot(way.x, way.y) >= WAY or abs(way.theta) >= TURN:
            return True
        waits = at.scan.t >= self._searched_at + STILL
        return waits and (first.odds >= SURE or not explains(first))

    @property
    def _certain(self) -> bool:
        """Whether the first of the tracked poses is confirmed, and no other is as good."""
        first = self._tracked[0] if self._confirmed else None
        return first is not None and first.odds >= SURE and explains(first)

    def _give_up(self) -> None:
        self._forget_search()
        self._pause.tried()


def explains(candidate: Candidate) -> bool:
    """Whether the map explains the scan at a pose."""
    return candidate.evidence >= MIN_EVIDENCE and candidate.refuted < MAX_REFUTED
