"""TSD SLAM: registration against one grid of truncated signed distances.

[May14] S. May, P. Koch, R. Koch, C. Merkl, C. Pfitzner, A. Nuechter: A Generalized 2D and 3D
Multi-Sensor Data Integration Approach based on Signed Distance Functions for Multi-Modal Robotic
Mapping, VMV 2014.
[Koch15] P. Koch, S. May, M. Schmidpeter, M. Kuehn, C. Pfitzner, C. Merkl, R. Koch, M. Fees,
J. Martin, A. Nuechter: Multi-Robot Localization and Mapping Based on Signed Distance Functions,
ICARSC 2015.

1. Predict: odometry, gyro or the last motion, with a covariance.
2. See: surface elements of the scan, with their normals; ours: from where the base is in the middle
   of the sweep.
3. Ray cast: the model scan that the map would show from there [May14].
4. RANSAC where the prediction or the last fit leaves doubt: poses to begin with [Koch15].
5. ICP: scan to model scan, point to line [May14].
6. Refine, ours: Gauss-Newton on the field itself, from ICP's poses and the prediction.
7. Decide: the pose that explains most of the scan.
8. Look again, ours: see a slow sweep with the motion that was found, and pose it once more.
9. Accept the pose, ours: with what it slipped along a corridor, or on ground of old drifted; or
   refuse it: then the prediction stands.
10. Push the scan into the field when the robot has moved.
11. Find again, ours: a robot that is lost is looked for in all of its map.
12. Return, ours: from the middle of the sweep to its stamp, the first beam's.

The preset `paper` leaves out 6. The published program, `tsd@original`, stands in `original`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from slams.extent import Box, Extent
from slams.localize.relocator import Relocator
from slams.motion.model import Prediction
from slams.motion.track import Track
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, State
from tsd.direct import Direct
from tsd.evidence import SAME, Evidence, Match, near
from tsd.image import Picture, colored
from tsd.map import TileField
from tsd.params import TsdParams
from tsd.registration import Registration
from tsd.search import WIDTHS, Search
from tsd.view import View

COUNTS = ("posed", "kept", "refined", "searched", "pushed", "rejected", "recovered", "empty")
BLUR, BLUR_TURN = 0.002, 0.001  # in one sweep [m], [rad]: a better velocity is worth a second look
NOTHING = np.zeros((3, 3))  # information of a scan that was not matched


class Tsd:
    """SLAM on a field of truncated signed distances.

    Attributes:
        frozen: nothing enters the map.

    Args:
        params: parameters.
    """

    Params: ClassVar[type[TsdParams]] = TsdParams

    def __init__(self, params: TsdParams) -> None:
        p = self.params = params
        self.frozen = False
        self._track = track = Track(params, widen_wheels=True)
        self._relocator = Relocator(track, p.relocate)
        self._extent = Extent(p.max_cells, p.cell)
        self._view = view = View(params)
        self._field = field = TileField(p.cell, p.truncation, p.max_weight, p.max_cells)
        self._evidence = evidence = Evidence(params, view, field, track)
        rng = np.random.default_rng(params.seed)
        self._registration = Registration(params, view, field, track, evidence, rng)
        self._direct = Direct(params, view, field, track, evidence)
        self._search = Search(track, evidence)
        self._posed: list[Pose2] = []  # by ICP
        self._refined: list[Match] = []
        self._pushed_at = self._velocity = IDENTITY
        self._quality = 1.0
        self._counts = dict.fromkeys((*COUNTS, "restarted"), 0)

    def update(self, scan: Scan) -> Pose2:
        """Take the next scan; return the base's pose in the map."""
        start = self._track.predict(scan)  # 1
        self._velocity = start.velocity
        if self._view.take(scan, self._velocity).count == 0:  # 2
            self._counts["empty"] += 1
            self._track.missed(scan)
        elif self._counts["pushed"] == 0:
            self._track.matched(start.pose, NOTHING, scan)
            self._push(start.pose)  # 10
        else:
            self._register(scan, start)  # 3 to 10
        self._relocator.update(scan, self.map)  # 11
        return self._view.at_stamp(self._track.pose)  # 12

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Enter a scan into the map as seen from a pose of the base; nothing is matched."""
        self._track.placed(pose, scan)
        if self._view.take(scan, IDENTITY).count > 0:
            self._push(pose)

    def _register(self, scan: Scan, start: Prediction) -> None:
        self._search.begin(start.dt)
        match = self._pose(start.pose, start)  # 3 to 7
        good = self._evidence.good(match)
        if good and self._looks_again(scan, match.pose):  # 8
            match = self._pose(match.pose, start)
            good = self._evidence.good(match)
        self._count(match)
        self._quality = match.close
        if good:
            self._accept(scan, match)  # 9
            known = self._track.state == "matched" or self._track.adrift
            if known and self._moved():
                self._push(self._track.pose)  # 10
        else:
            self._refuse(scan)  # 9

    def _pose(self, start: Pose2, known: Prediction) -> Match:
        """The pose that explains most of the scan; looked for elsewhere where that is doubtful."""
        self._posed, self._refined = [], []
        own = self._own(start, known.pose)
        posed = self._candidates(start, known.pose)
        found = [own, *posed] if self.params.refine else [*posed, own]
        first = best = self._evidence.best(found)  # 7
        searched = False
        for width in WIDTHS:
            if self._search.wanted(best, width):
                searched = True
                for pose in self._proposed(start, known, width):
                    best = self._evidence.best([best, *self._candidates(pose, pose)])
        self._searched = best is not first
        self._search.end(best, searched, self._searched)
        return best

    def _candidates(self, start: Pose2, known: Pose2) -> list[Match]:
        """What ICP makes of a start and what is ours behind it, if that is not there already."""
        found = self._registration.icp(start, known)  # 3, 5
        if found is None:
            return []
        self._posed.append(found.pose)
        if any(near(found.pose, other.pose, SAME) for other in self._refined):
            return []  # ICP confirms what competes already
        posed = self._evidence.weigh(*found)
        return [self._own(posed.pose, known), posed] if self.params.refine else [posed]

    def _own(self, start: Pose2, known: Pose2) -> Match:
        """What is ours of a start; in the preset `paper` only what speaks for it as it is."""
        if not self.params.refine:
            return self._evidence.weigh(start, NOTHING)
        self._refined.append(self._direct.align(start, known))  # 6
        return self._refined[-1]

    def _proposed(self, start: Pose2, known: Prediction, width: float) -> list[Pose2]:
        """Other starts: by RANSAC, and in the first search the last pose and the last motion."""
        found = self._registration.ransac(start, width)  # 4
        before = self._track.pose
        return [before, before @ known.continued, *found] if width == WIDTHS[0] else found

    def map(self) -> OccupancyGrid:
        """The map as it stands now."""
        return self._field.sketch().draw()

    def sketch(self) -> Callable[[], OccupancyGrid]:
        """What draws the map as it stands now, while updates go on."""
        return self._field.sketch().draw

    def field(self) -> Picture:
        """The field itself: distances [m] (ny, nx), weights, edge of a cell, corner (x, y) [m]."""
        return self._field.picture()

    def pictures(self) -> dict[str, NDArray[np.uint8]]:
        """File name to image (ny, nx, 3), blue, green, red: the field with both its sides."""
        tsd = self.field()[0]
        return {"map_tsd.png": colored(tsd, self.params.truncation)}

    def report(self) -> dict[str, Any]:
        """Counts of what happened so far."""
        lost = {"lost": self._track.lost} | self._relocator.counts
        counts = self._counts | lost | self._track.motion.counts
        return counts | self._extent.counts

    @property
    def state(self) -> State:
        """How the last pose came about."""
        return self._track.state

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last pose against the map [m2, m rad, rad2]."""
        return self._track.covariance

    @property
    def quality(self) -> float:
        """Share of the last scan that agrees with the map, 0 to 1."""
        return self._quality

    def _looks_again(self, scan: Scan, pose: Pose2) -> bool:
        """See the scan anew with the velocity that was found, where that moves its points."""
        if not self._view.sweeps:
            return False
        found, seconds = self._track.motion.velocity_to(pose), scan.laser.sweep_time
        expected = self._velocity
        blur = seconds * math.hypot(found.x - expected.x, found.y - expected.y)
        if blur < BLUR and seconds * abs(found.theta - expected.theta) < BLUR_TURN:
            return False
        self._velocity = found
        return self._view.take(scan, found).count > 0

    def _count(self, match: Match) -> None:
        cell = self.params.cell, self.params.cell
        self._counts["posed"] += bool(self._posed)
        self._counts["kept"] += any(near(match.pose, pose, cell) for pose in self._posed)
        self._counts["refined"] += any(match is other for other in self._refined)
        self._counts["searched"] += self._searched

    def _accept(self, scan: Scan, match: Match) -> None:
        self._evidence.learn(match, self._search.fruitless, scan.t)
        self._counts["recovered"] += self._track.state != "matched"
        leads = self._direct.leads if self.params.refine else None
        self._track.matched(match.pose, match.information, scan, leads=leads)
        self._relocator.old_ground.update(scan)

    def _refuse(self, scan: Scan) -> None:
        """Stay with the prediction; where wheels alone have held it for long, map on from there."""
        self._counts["rejected"] += 1
        self._track.missed(scan)
        if self._track.held and not self._direct.contradicts(self._track.pose):
            self._counts["restarted"] += 1
            self._push(self._track.pose)

    def _moved(self) -> bool:
        step = self._pushed_at.between(self._track.pose)
        far = math.hypot(step.x, step.y) > self.params.push_translation
        return far or abs(math.sin(step.theta)) > self.params.push_rotation

    def _push(self, pose: Pose2) -> None:
        if self.frozen:
            return
        laser = pose @ self._view.laser.mount
        lines, box = self._view.lines(pose)
        if not self._extent.admits(box.joined(Box.around(laser.x, laser.y, 0.0))):
            return
        self._counts["pushed"] += 1
        self._field.push(lines, box, self._view.beams.angle_increment, laser.x, laser.y)
        self._pushed_at = pose
