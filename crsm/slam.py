"""CRSM SLAM: a few critical rays matched against one global map by hill climbing.

[Tsardoulias13] E. Tsardoulias, L. Petrou: "Critical Rays Scan Match SLAM", Journal of Intelligent
& Robotic Systems 72, 2013. One scan after the other:

1. predict the pose; ours: with a covariance;
2. clean the ranges and choose the critical rays: few beams that fix x, y and theta; ours: seen from
   where the base is in the middle of the sweep;
3. climb from the predicted pose to where the map under the ends of these rays is darkest; where
   that is less dark than usual, restart at random;
4. ours: fit all beams to the walls inside the cells, from there; evidence decides;
5. ours: free a slow sweep from the motion that was found, and match it once more;
6. take the pose, or the prediction if the map does not explain the scan; ours: on ground of old;
7. draw the scan into the global map;
8. ours: look for a robot that is lost in all of its map;
9. ours: go from the middle of the sweep back to its stamp, the first beam's.

The preset `paper` leaves out step 4. The published program as it was, `crsm@original`, stands in
`original`.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from crsm.choice import Match, is_near
from crsm.climber import Climbed, Climber
from crsm.map import WallGrid
from crsm.match_kernels import evidence, told
from crsm.pace import Pace
from crsm.params import CrsmParams
from crsm.scan import ScanReader
from slams.geometry import Prior
from slams.localize.relocator import Relocator
from slams.motion.model import Prediction
from slams.motion.track import Track
from slams.params import Params
from slams.patience import Patience
from slams.refine.lines import Match as Fit
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, State
from slams.usual import Usual

MEMORY = 2.0  # s over which the evidence is usual: the way through a room
CELL = 0.1  # m and rad, within which a refined pose is still the climb's
WEIGHED = 360  # points that evidence is taken of
SETTLE = 10  # scans at the start that all enter the map: of one alone it has gaps and its noise
PAUSE = 0.5  # s between two searches of a robot that is not matched


class Crsm:
    """Critical rays climbed, and all beams fitted to walls; see the module for the steps.

    `frozen`: nothing enters the map.
    """

    Params: ClassVar[type[Params]] = CrsmParams

    def __init__(self, params: CrsmParams) -> None:
        self.params = params
        self.frozen = False
        self._map = WallGrid(params)
        self._climber = Climber(params)
        self._lines = self._map.lines
        self._track = Track(params)
        self._relocator = Relocator(self._track, params.relocate)
        self._reader = ScanReader(params)
        self._quality, self._usual = 0.0, Usual(MEMORY)
        self._patience = Patience(PAUSE, PAUSE)
        self._inserted = Pace(params.insert_step, params.insert_rest, SETTLE)
        names = ("posed", "kept", "refined", "searched", "refused", "inserted", "rejected", "faded")
        self._counts = dict.fromkeys(names, 0)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; return the base's pose in the map, T_map_base."""
        start = self._track.predict(scan)  # 1.
        view = self._reader.take(scan, start.velocity)  # 2.
        match = None
        if view.is_usable and not self._map.is_empty:
            climbed = self._climbed(view, start)  # 3.
            match = self._chosen(view, start.pose, climbed)  # 4.
            if view.sweeps:  # 5.
                self._reader.take(scan, self._track.motion.velocity_to(match.fit.pose))
                match = self._again(view, start.pose, match)
        self._settle(scan, view, match, start.pose)  # 6.
        self._relocator.old_ground.update(scan)
        self._draw(view, scan.t)  # 7.
        self._relocator.update(scan, self.map)  # 8.
        return view.at_stamp(self._track.pose)  # 9.

    def map(self) -> OccupancyGrid:
        """The grey levels of the map as probabilities."""
        return self._map.occupancy()

    def report(self) -> dict[str, Any]:
        """Counts of scans: posed by the climb, kept (it or near it won), refined, searched ..."""
        restarts = {"restarts": self._climber.restarts, "lost": self._track.lost}
        again = self._relocator.counts
        counts = self._counts | restarts | again | self._track.motion.counts
        return counts | self._map.extent.counts

    @property
    def pose(self) -> Pose2:
        """The base's last pose in the map."""
        return self._track.pose

    @property
    def state(self) -> State:
        """How the last pose came about."""
        return self._track.state

    @property
    def quality(self) -> float:
        """Share of the last scan that the map explains, 0..1."""
        return self._quality

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last pose against the map [m^2, m rad, rad^2]."""
        return self._track.covariance

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Let a scan enter the map as seen from `pose` of the base, without a match."""
        self._track.placed(pose, scan)
        view = self._reader.take(scan, IDENTITY)
        if view.is_usable and not self.frozen:
            self._insert(view, pose, scan.t, True)

    def _climbed(self, view: ScanReader, start: Prediction) -> Climbed:
        """Step 3: random restart hill climbing within what is expected."""
        climber, track = self._climber, self._track
        prior = climber.prior(start.pose, track.prior(start.pose), len(view.rays))
        found = climber.climb(self._map, view, prior, track.uncertain)
        self._counts["posed"] += 1
        self._patience.wait(start.dt)
        pauses = track.state != "matched" and not self._patience.over
        if climber.is_enough(found) or pauses:
            return found
        self._patience.tried()
        self._counts["searched"] += 1
        before = track.pose
        others = [before @ start.continued, before]
        return climber.restart(self._map, view, prior, others, found)

    def _chosen(self, view: ScanReader, expected: Pose2, climbed: Climbed) -> Match:
        """Step 4: of the climb and the fits behind it, the one with the most evidence.

        A climb takes part where its fit is elsewhere, or contradicts the prediction and explains no
        more: people who walk along a corridor pull it. Otherwise what stays would win for free.
        """
        if not self.params.refine:
            self._counts["kept"] += 1
            return self._by_rays(view, climbed.pose)
        prior = self._prior(expected)
        starts = [climbed.pose] + ([] if is_near(expected, climbed.pose) else [expected])
        matches = [self._weighed(view, self._lines.fit(view, at, prior), True) for at in starts]
        near = [m for m in matches if is_near(m.fit.pose, climbed.pose, CELL, CELL)]
        if all(m.is_pulled for m in near):
            as_it_is = self._weighed(view, self._lines.seen_from(view, climbed.pose), False)
            matches += [as_it_is] if all(as_it_is.explains_no_less(m) for m in near) else []
        best = max(matches, key=lambda match: match.value)
        self._counts["kept"] += is_near(best.fit.pose, climbed.pose, CELL, CELL)
        return best

    def _again(self, view: ScanReader, expected: Pose2, match: Match) -> Match:
        """Step 5: the same match of the scan as it is without the motion that was found."""
        at = match.fit.pose
        if match.refined:
            fit = self._lines.fit(view, at, self._prior(expected))
            return self._weighed(view, fit, True)
        track, climber = self._track, self._climber
        prior = climber.prior(at, track.prior(expected), len(view.rays))
        pose = climber.climb(self._map, view, prior, 0.0).pose
        if not self.params.refine:
            return self._by_rays(view, pose)
        return self._weighed(view, self._lines.seen_from(view, pose), False)

    def _prior(self, expected: Pose2) -> Prior:
        return Prior(expected, self._track.prior(expected))

    def _by_rays(self, view: ScanReader, pose: Pose2) -> Match:
        """A climb without anything behind it: the dark field and the rays tell all."""
        cells, seen = self._map.cells, np.empty((3, 3))
        told(cells, view.points, view.normals, view.rays, tuple(pose), view.variances, seen)
        explained, contradicted = self._evidence(view, pose)
        return self._judged(
            Fit(pose, explained, view.noise**2, seen), explained - contradicted, False
        )

    def _weighed(self, view: ScanReader, fit: Fit, refined: bool) -> Match:
        _, contradicted = self._evidence(view, fit.pose)
        return self._judged(fit, fit.share - contradicted, refined)

    def _evidence(self, view: ScanReader, pose: Pose2) -> tuple[float, float]:
        """Shares of a scan that the dark field explains at a pose, and grey levels contradict."""
        every = max(1, view.n // WEIGHED)
        dark, white = evidence(self._map.cells, view.points, view.n, tuple(pose), every)
        return dark, white

    def _judged(self, fit: Fit, worth: float, refined: bool) -> Match:
        value = worth - self._track.charge(fit.pose)
        if not self._track.reachable(fit.pose):
            value -= 1.0
        return Match(fit, fit.share, worth, value, refined)

    def _settle(self, scan: Scan, view: ScanReader, match: Match | None, expected: Pose2) -> None:
        """Step 6: tell the track what was found, learn what is usual."""
        track = self._track
        if match is None:
            if view.is_usable:
                track.matched(expected, np.eye(3), scan)  # the map begins here
            else:
                track.missed(scan)
            self._quality = 0.0
            return
        self._quality = match.quality
        explains = match.evidence >= self.params.lost_below * self._usual.value
        if not (explains and track.reachable(match.fit.pose)):
            self._counts["refused"] += 1
            track.missed(scan)
            return
        track.matched(match.fit.pose, match.fit.seen, scan)
        self._counts["refined"] += match.refined
        self._usual.learn(match.evidence, scan.t)
        self._lines.learn(match.fit, view)
        self._climber.learn(self._map, view, match.fit.pose, scan.t)

    def _draw(self, view: ScanReader, t: float) -> None:
        """Step 7: a scan that is explained, or of ground that wheels alone have led to."""
        track = self._track
        known = track.state == "matched" or track.held or track.adrift
        if not (view.is_usable and known):
            self._counts["rejected"] += 1
            return
        if not self.frozen:
            self._insert(view, track.pose, t, False)

    def _insert(self, view: ScanReader, pose: Pose2, t: float, at_once: bool) -> None:
        """Walls, lines and grey levels, where the robot has moved on or waited."""
        if not (self._inserted.is_due(pose, t) or at_once):
            return
        if not self._map.insert(view, pose):
            self._counts["rejected"] += 1
            return
        self._inserted.done(pose, t)
        self._counts["inserted"] += 1
        self._counts["faded"] += self._map.draw(view, pose)
