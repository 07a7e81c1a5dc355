"""Where the robot is and how sure that is: matched, predicted or lost, the same for all.

[Zhang16] J. Zhang, M. Kaess, S. Singh: On Degeneracy of Optimization-based State Estimation
Problems, ICRA 2016.
"""

from __future__ import annotations

import math

import numpy as np

from slams.geometry import inverse3, unlikely, widened
from slams.motion import belief_kernels as kernels
from slams.motion.chord import FLOOR, with_the_same_error
from slams.motion.model import Motion, Prediction
from slams.motion.params import MotionParams, without_wheels
from slams.motion.sight import CLEAR, sight
from slams.motion.sight_kernels import hits
from slams.motion.slip import SHIFTS, Leads, slip
from slams.motion.trust import Limits
from slams.types import IDENTITY, Floats, Pose2, Scan, State, wrap_angle
from slams.usual import FRESH

LOST_AFTER = 1.0  # s without a match, after which only wheels still tell where the robot is
LOST_XY, LOST_TURN = 0.5, 0.3  # m, rad: deviation at which they do not either
INDEPENDENT = 50.0  # pieces of wall in a scan whose errors have nothing to do with each other
DEGREES = 3.0  # of freedom of a pose
RISE, FALL = 1.0, 10.0  # s, in which what is expected becomes wider and narrower
MOST = 10.0  # that one surprise counts
GAP = 3.0  # usual intervals; a longer one is a gap in the log
WIDEST = 1e3  # variance, times the expected one
SEEN = 0.9  # share of what a match says along a corridor, below which slips are looked for
GAPLESS = 360  # hits of a scan, below which the map that is made of them has gaps
EVEN = 0.2  # ratio of variances of x and y above which a scan sees all directions: no corridor


class Track:
    """The pose with its covariance, from one scan to the next, by the one `Motion`.

    Per scan: `predict`, then `matched` or `missed`. `pose` and `covariance` (3, 3) [m, rad] are
    those of the last scan in the map, `expected` (3, 3) the prediction's covariance, `predicted`
    the same without caution, `lost` the number of scans in that state. `held`: nothing was matched
    for long, yet wheels tell the pose. `adrift`: lost, but only along a corridor: scans match
    across, and what they show is mapped on. `widen_wheels`: learn from surprises also where wheels
    predict (in a bare corridor hector's lines surprise without being right).
    """

    def __init__(self, params: MotionParams, widen_wheels: bool = False) -> None:
        self.motion = Motion(params)
        self.pose = IDENTITY
        self.covariance: Floats = FLOOR * np.eye(3)
        self.state: State = "matched"
        self.lost = 0
        self.held = self.adrift = False
        self._widen_wheels = widen_wheels
        self._params, self._limits = params, Limits(params)
        self.expected = self.predicted = self._information = self.covariance
        self._matched_at = IDENTITY
        self._begun = False
        self._scale = 1.0  # of what was expected, learned
        self._seconds = 0.0  # since the last match
        self._even = 1.0  # of the last match: how alike it saw the two directions
        self._sight = CLEAR  # of the last match
        self._seeing = self._walls = CLEAR  # of the last look by itself, and of the last two
        self._looked = -math.inf  # s, stamp of the last look
        self._by_wheels = True  # all that time
        self._missed = False  # the last scan
        self._unproven = 0.0  # s for which matches have to stand before they are believed

    def predict(self, scan: Scan) -> Prediction:
        """What is known of the pose at `scan` before it is looked at."""
        if not self._begun and scan.odometry is None:
            self.motion = Motion(without_wheels(self._params), self.motion.counts)
        now = self._prediction = self.motion.predict(self.pose, scan)
        self._seconds += now.dt
        self._by_wheels &= "wheels" in now.used
        self.predicted, self.expected, self._information = self._foreseen(now, scan)
        return now

    def _foreseen(self, now: Prediction, scan: Scan) -> tuple[Floats, Floats, Floats]:
        """The prediction's covariance, the same with caution, and the inverse of that.

        A velocity that is wrong makes every step wrong to the same side: without wheels deviations
        of the pose before and of the step add, not variances; in the direction that no match sees,
        and, while nothing is matched, in all. What is expected is scaled by what was learned.
        """
        before, matched, sees = self.covariance, self.state == "matched", self._sight
        by_velocity = "wheels" not in now.used
        if by_velocity and not matched:
            before = with_the_same_error(before, now.covariance)
        scale, caution = (self._scale, self._caution(scan)) if matched else (1.0, 1.0)
        learned = (float(by_velocity and matched), scale, caution)
        step, variance = tuple(now.step), tuple(now.variance)
        blind = (sees.x, sees.y, 1.0 - sees.share)
        return kernels.foreseen(before, now.heading, step, variance, blind, learned)

    def _caution(self, scan: Scan) -> float:
        """Times what is expected where scans see all directions: there the map is to be believed.

        In a bare corridor what a scan seems to say along it is mostly noise, as [Zhang16] has it;
        there the prediction counts as much as it is worth. So do wheels where few beams make a map
        with gaps: those that end where others did before hold the robot back, the rest is silent.
        (Without wheels the prediction has been held back, too.)
        """
        sees = min(self._even / EVEN, 1.0)
        if "wheels" in self._prediction.used:
            sees *= hits(scan.ranges, scan.laser.range_max, GAPLESS) / GAPLESS
        return 1.0 + (self._params.caution - 1.0) * sees**2

    def prior(self, start: Pose2) -> Floats:
        """Information (3, 3) [1/m^2, 1/(m rad), 1/rad^2] of a start for a matcher.

        That of the prediction; if the prediction errs by as much as the start is elsewhere, its
        deviation is at least that: C + d d^T (its inverse by Sherman and Morrison).
        """
        if start == self._prediction.pose:
            return self._information
        return widened(self._information, self._off(start))[0]

    def charge(self, pose: Pose2) -> float:
        """What a pose must explain more of a scan, as a share, for contradicting the prediction.

        By the density of Student's law, as the fit weighs its prior: what the robot has seen last
        explains more of a scan than the new ground ahead, so a cheap way back wins in corridors.
        """
        return unlikely(self._distance(pose)) / INDEPENDENT

    def reachable(self, pose: Pose2) -> bool:
        """Whether a robot can have come there since the last match."""
        step = self._matched_at.between(pose)
        return self._limits.allow(*step, self._seconds)

    @property
    def room(self) -> float:
        """How far [m] from its prediction a robot that accelerates can be."""
        return self.motion.room(self._seconds)

    @property
    def uncertain(self) -> float:
        """Deviation [m] of the prediction, of a point one meter away, as far as a scan can tell.

        Where scans see nothing along a direction, there is nothing to search along it either.
        """
        told = self._sight.stretched(self.expected, math.sqrt(self._sight.share))
        xx, yy, turn = np.diagonal(told).tolist()
        return math.sqrt(xx + yy + turn)

    @property
    def unseen(self) -> Floats:
        """Unit vector (2,) in the map along which the last match saw worst."""
        return np.array((self._sight.x, self._sight.y))

    def matched(
        self, pose: Pose2, seen: Floats, scan: Scan, rough: bool = False, leads: Leads | None = None
    ) -> None:
        """The map explains the scan at `pose`; `seen` (3, 3) is the information of the scan.

        `rough`: by cells alone, whose steps look like walls that face any way. `leads`: what the
        map says of places along a corridor.
        """
        if self._begun:
            self._look(scan, pose, seen, rough)
        else:  # the first pose is the map's origin
            seen, self._begun = np.eye(3) / FLOOR, True
        honest, found = self._sight.of(seen), pose
        pose = self._fused(pose, seen, honest)
        if leads is not None and self._sight.share < SEEN:
            pose, honest = self._looked_along(pose, honest, leads)
        alone, covariance, self._even = kernels.settled(honest, self._information, self._off(pose))
        learns = self._widen_wheels or not self._by_wheels
        if learns and self.state == "matched":  # a blind drive tells of the wheels, not of one step
            self._learn(self._by_scan(found, seen), alone)
        self.motion.moved(pose, alone, scan)
        self.covariance = covariance
        self.pose = self._matched_at = pose
        self._unproven = LOST_AFTER if self._astray() else self._unproven - self._seconds
        self.held, self._seconds, self._by_wheels, self._missed = False, 0.0, True, False
        sure, proven = self._sure(self.covariance), self._unproven <= 0.0
        self.adrift = proven and not sure
        self._call("matched" if proven and sure else "lost")

    def placed(self, pose: Pose2, scan: Scan, proven: bool = True) -> None:
        """The pose of a scan is given, at rest: what was known of the motion means nothing.

        Unless `proven` the matches behind it have to stand.
        """
        self.motion, self._begun = Motion(self._params, self.motion.counts), False
        self._seconds, self._missed = 0.0, False
        self._unproven = 0.0 if proven else LOST_AFTER
        self.pose, self.covariance, self.state = pose, FLOOR * np.eye(3), "matched"
        self.predict(scan)
        self.matched(pose, self._information, scan)

    def _look(self, scan: Scan, pose: Pose2, seen: Floats, rough: bool) -> None:
        """Which direction is seen badly, by the last two looks and the matcher."""
        if not 0.0 <= scan.t - self._looked < FRESH:
            seeing = sight(scan, pose) or self._seeing
            self._walls, self._seeing = seeing.after(self._seeing), seeing
            self._looked = scan.t
        self._sight = self._walls.judging(seen, rough)

    def _fused(self, pose: Pose2, seen: Floats, honest: Floats) -> Pose2:
        """A match of what was `seen`, without what noise says: there the prediction stands."""
        sees = self._sight
        known, off = self._information, self._off(pose)
        back = kernels.held_back(seen, honest, known, off, sees.x, sees.y)
        if back == 0.0:
            return pose
        return Pose2(pose.x + back * sees.x, pose.y + back * sees.y, pose.theta)

    def _looked_along(self, pose: Pose2, honest: Floats, leads: Leads) -> tuple[Pose2, Floats]:
        """A match and what it is worth, with the slip that the map proves made good."""
        sees = self._sight
        doubt = sees.along(inverse3(honest + self.prior(pose)))
        found = slip(leads(pose, SHIFTS[:, None] * np.array((sees.x, sees.y))), doubt)
        x, y = pose.x + found.moved * sees.x, pose.y + found.moved * sees.y
        return Pose2(x, y, pose.theta), sees.widened(honest, found.information)

    def _by_scan(self, pose: Pose2, seen: Floats) -> Floats:
        """How far (3,) from the prediction the scan alone has a pose that lies between the two."""
        return kernels.by_scan(seen, self._information, self._off(pose))

    def _astray(self) -> bool:
        """Whether a match may be anywhere: the first after a second without any, or after a gap."""
        if self._by_wheels or self._seconds < LOST_AFTER:
            return False
        gap = self._prediction.dt > GAP * self.motion.interval
        return (self._missed or gap) and not self._sure(self.predicted)

    @property
    def proving(self) -> bool:
        """Whether the robot, matched again after a gap, may still be elsewhere."""
        return self._unproven > 0.0

    @property
    def unproven(self) -> bool:
        """The same, and the last scan was matched."""
        return self.proving and self._seconds == 0.0

    def proven(self) -> None:
        """The last match is right: the whole map has no better place."""
        self._unproven, self.state = 0.0, "matched"

    def refuted(self) -> None:
        """The last match, unproven, goes through walls: those before it prove nothing."""
        self._unproven = LOST_AFTER

    def _learn(self, by_scan: Floats, alone: Floats) -> None:
        """Widen what is expected where matches, good to `alone` (3, 3), surprise too often.

        The normalized innovation squared, of a mean of 3, tells.
        """
        surprise = min(kernels.surprise(self.expected, alone, by_scan) / DEGREES, MOST)
        seconds = min(self._seconds, 1.0)
        growth = (surprise - 1.0) * seconds / (RISE if surprise > 1.0 else FALL)
        self._scale = min(max(self._scale * math.exp(growth), 1.0), WIDEST)

    def corrected(self, pose: Pose2) -> None:
        """The last pose was elsewhere all along, as another map has it: no motion."""
        self.pose = self._matched_at = pose

    def missed(self, scan: Scan) -> None:
        """The map does not explain the scan: the pose is the prediction."""
        self.motion.missed(scan)
        self._missed = True
        self._sight = self._seeing = self._walls = CLEAR
        self._looked = -math.inf
        self.pose, self.covariance = self._prediction.pose, self.predicted
        overdue = self._seconds >= LOST_AFTER
        self.held = overdue and self._by_wheels and self._sure(self.predicted)
        self.adrift = False
        if self.proving:  # a match that does not stand, or none at all any more
            self._unproven = 0.0 if overdue else LOST_AFTER
        lost = (overdue or self.proving) and not self.held
        self._call("lost" if lost else "predicted")

    def _call(self, state: State) -> None:
        self.state = state
        self.lost += state == "lost"

    def _sure(self, covariance: Floats) -> bool:
        (xx, _, _), (_, yy, _), (_, _, turn) = covariance.tolist()
        return bool(xx + yy < LOST_XY**2 and turn < LOST_TURN**2)

    def _off(self, pose: Pose2) -> Floats:
        expected = self._prediction.pose
        turn = wrap_angle(pose.theta - expected.theta)
        return np.array((pose.x - expected.x, pose.y - expected.y, turn))

    def _distance(self, pose: Pose2) -> float:
        """Squared distance from the prediction, in units of its covariance."""
        return widened(self._information, self._off(pose))[1]
