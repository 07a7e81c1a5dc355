"""Registration: surface elements of the scan against the directional field."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.extent import Box, Extent
from slams.motion.track import Track
from slams.types import Floats, Laser, OccupancyGrid, Pose2, Scan
from tsd.fix import Fix
from tsd.image import Picture
from tsd.map import TileField
from tsd.map_kernels import place_lines
from tsd.match_kernels import MatchRule, agreement_along, align
from tsd.params import TsdParams
from tsd.ransac_kernels import PairRule, try_pairs
from tsd.scan_kernels import (
    Beams,
    SurfaceRule,
    Twist,
    find_hits,
    find_runs,
    fit_surfaces,
    sum_moments,
)

GAIN = 0.02  # another start must be better by this share of the elements
NO_STEP = 1e-6  # between the beams of a laser that has one [rad]
SCORED = 100  # elements that make and score hypotheses
TAKEN = 3  # hypotheses aligned
APART = 0.1, 0.05  # closer hypotheses [m], [rad] are one
UNSEEN = 0.01  # a direction seen worse than this [m] is looked along
SHIFTS = np.linspace(-0.4, 0.4, 17)  # along it [m]
SAME = 0.03, 0.02  # a pose so near [m], [rad] is no other answer: only noise prefers it


class Match(NamedTuple):
    """One aligned pose with the share of elements known and of those close, and its worth."""

    pose: Pose2
    known: float
    close: float
    worth: float
    residual: float


class Direct:
    """Direct alignment with a wide start in reserve.

    Args:
        params: parameters.
        track: what is known of the pose before the scan.
        rng: source of every random draw.
    """

    def __init__(self, params: TsdParams, track: Track, rng: np.random.Generator) -> None:
        p = self._params = params
        self._track = track
        self._rng = rng
        self._field = TileField(p.cell, p.truncation, p.max_weight)
        self._coarse = TileField(p.coarse_cell, p.coarse_truncation, p.max_weight)
        self._surface_rule = SurfaceRule(
            p.window, p.range_noise, p.max_slope, (p.roughness * p.range_noise) ** 2, p.beam_width
        )
        self._rule = MatchRule(p.iterations, 1e-4, 1e-5, p.robust, p.map_noise * p.range_noise)
        self._coarse_rule = MatchRule(p.iterations, 1e-3, 1e-3, 0.3 * p.coarse_truncation, 0.03)
        self._normal_equations = np.zeros((5, 3))
        self._best = np.zeros((p.trials + 1, 4))
        self._counts = np.zeros((len(SHIFTS), 2))
        self._usual, self._residual = 0.7, p.range_noise
        self.extent = Extent(p.max_cells, p.cell)
        self._laser: Laser | None = None
        self._n_lines = 0

    def see(self, scan: Scan, twist: Pose2) -> int:
        """Hits and surface elements of the scan, deskewed; returns how many elements there are."""
        if scan.laser is not self._laser and scan.laser != self._laser:
            self._take(scan.laser)
        self._n_hits = find_hits(scan.ranges, self._beams, Twist(*twist), self._hits)
        find_runs(self._hits, self._n_hits, self._beams, self._surface_rule, self._runs)
        sum_moments(self._hits, self._n_hits, self._sums)
        self._count = self._fit(self._params.spacing, self._elements)
        return self._count

    def register(self, start: Pose2, others: tuple[Pose2, ...]) -> Fix:
        """Align from the prediction; when that does not convince, from elsewhere; pick the best."""
        self._start, self._others = start, others
        best = direct = self._align(start)
        information = self._normal_equations[:3].copy()
        tried = False
        for attempt, enough in (
            (self._from_others, self._as_usual),
            (self._from_near, self._as_usual),
            (self._from_far, self._plausible),
        ):
            if enough(best):
                break
            tried = True
            for match in attempt():
                elsewhere = not _near(match.pose, direct.pose, SAME)
                if elsewhere and match.worth > best.worth + GAIN:
                    best = match
        if best is not direct:
            self._align(best.pose)
            information = self._normal_equations[:3].copy()
        p = self._params
        good = best.close > p.min_close * best.known and best.known > p.min_known
        good &= self._track.reachable(best.pose)
        pose, doubt = best.pose, np.zeros((2, 2))
        if good:
            self._learn(best, tried)
            pose, doubt = self._slipped(pose, information)
        return Fix(pose, best.pose, good, best.close, information, doubt, best is not direct)

    def push(self, pose: Pose2) -> None:
        """Enter the scan last seen at `pose` of the base into both fields, if they may grow so."""
        count = self._fit(0.0, self._dense)
        if count == 0:
            return
        lines = self._lines[:count]
        box = place_lines(self._dense, count, self._runs, self._beams, np.array(pose), lines)
        self._n_lines = count
        laser = pose @ self._mount
        if not self.extent.admits(Box(*box).joined(Box.around(laser.x, laser.y, 0.0))):
            return
        for field in (self._field, self._coarse):
            field.push(lines, box, self._beams.angle_increment, laser.x, laser.y)

    def occupancy(self) -> OccupancyGrid:
        """The map for the outside."""
        return self._field.occupancy()

    def picture(self) -> Picture:
        """The field itself."""
        return self._field.picture()

    def _take(self, laser: Laser) -> None:
        """Memory and constants for a new scanner."""
        c, s = math.cos(laser.mount.theta), math.sin(laser.mount.theta)
        directions = np.ascontiguousarray(laser.directions @ np.array([[c, s], [-s, c]]))
        n = laser.n_beams
        self._laser, self._mount = laser, laser.mount
        self._beams = Beams(
            directions,
            *laser.mount,
            laser.angle_increment,
            laser.range_min,
            laser.range_max,
            laser.time_increment,
        )
        self._hits, self._runs = np.zeros((n, 4)), np.zeros((n, 2))
        self._sums = np.zeros((n + 1, 5))
        self._elements, self._dense = np.zeros((n, 6)), np.zeros((n, 6))
        self._lines = np.zeros((n, 7))

    def _fit(self, spacing: float, out: Floats) -> int:
        return int(
            fit_surfaces(
                self._hits,
                self._n_hits,
                self._runs,
                self._sums,
                self._beams,
                self._surface_rule,
                spacing,
                out,
            )
        )

    def _align(self, pose: Pose2, coarse: bool = False) -> Match:
        """Gauss-Newton on one of the fields."""
        x, prior = np.array(pose), self._track.prior(pose)
        field, rule = (self._coarse, self._coarse_rule) if coarse else (self._field, self._rule)
        known, close, residual, _ = align(
            field.kernel,
            self._elements,
            self._count,
            prior,
            rule,
            x,
            self._normal_equations,
        )
        total = max(self._count, 1)
        found = Pose2(*x.tolist())
        worth = close / total - self._track.charge(found) - (not self._track.reachable(found))
        return Match(found, known / total, close / total, worth, residual)

    def _slipped(self, pose: Pose2, information: Floats) -> tuple[Pose2, Floats]:
        """Where the scan sees one direction badly, the mean of all poses along it by likelihood.

        In a corridor the few elements that face along it are beyond the reach of Gauss-Newton
        once the robot has slipped, and what noise turned that way holds the pose where it is.
        """
        xx, xy, yy = information[0, 0], information[1, 0], information[1, 1]
        if 0.5 * (xx + yy) - math.hypot(0.5 * (xx - yy), xy) > UNSEEN**-2:
            return pose, np.zeros((2, 2))
        across = 0.5 * math.atan2(2.0 * xy, xx - yy)
        axis = np.array([-math.sin(across), math.cos(across)])
        seen, agree = self._agreement(pose, SHIFTS[:, None] * axis).T
        middle = len(SHIFTS) // 2
        evidence = agree - seen * agree[middle] / max(seen[middle], 1.0)
        evidence -= 0.5 * SHIFTS**2 / (axis @ self._track.expected[:2, :2] @ axis)
        likelihood = np.exp(evidence - evidence.max())
        likelihood /= likelihood.sum()
        mean = likelihood @ SHIFTS
        x, y = (mean * axis).tolist()
        doubt = likelihood @ (SHIFTS - mean) ** 2 * np.outer(axis, axis)
        return Pose2(pose.x + x, pose.y + y, pose.theta), doubt

    def contradicts(self, pose: Pose2) -> bool:
        """Whether more elements lie where beams passed than agree with the field."""
        seen, agree = self._agreement(pose, np.zeros((1, 2)))[0]
        return bool(2.0 * agree < seen)

    def _agreement(self, pose: Pose2, offsets: Floats) -> Floats:
        """Of a pose moved by offsets (n, 2): elements where beams were, and that agree (n, 2)."""
        counts = self._counts[: len(offsets)]
        agreement_along(
            self._field.kernel,
            self._elements,
            self._count,
            self._beams,
            np.array(pose),
            offsets,
            self._rule,
            counts,
        )
        return counts

    def _plausible(self, match: Match) -> bool:
        """Whether most elements are known and most of those agree."""
        return match.close > 0.7 * match.known and match.known > 0.4

    def _as_usual(self, match: Match) -> bool:
        """Whether elements agree with the field as well as in the scans before."""
        usual = match.close > self._params.convincing * self._usual
        return usual and self._plausible(match)

    def _from_others(self) -> list[Match]:
        """Coarse to fine from the prediction and from the other starts."""
        starts = (self._start, *self._others)
        return [self._align(self._align(pose, coarse=True).pose) for pose in starts]

    def _from_near(self) -> list[Match]:
        return self._from_pairs(1.0)

    def _from_far(self) -> list[Match]:
        return self._from_pairs(2.0)

    def _from_pairs(self, width: float) -> list[Match]:
        """From the best of the poses that random pairs of elements propose."""
        return [self._align(pose) for pose in self._hypotheses(width)]

    def _hypotheses(self, width: float) -> list[Pose2]:
        """RANSAC: lines of the last push, elements of the scan."""
        p = self._params
        rule = PairRule(
            p.search_translation * width, math.cos(p.search_rotation * width), p.truncation
        )
        stride = max(self._count // SCORED, 1)
        some = np.ascontiguousarray(self._elements[: self._count : stride])
        trials = self._rng.permutation(self._n_lines)[: p.trials]
        start = np.array(self._start)
        best = self._best[: len(trials) + 1]
        try_pairs(self._field.kernel, self._lines, trials, some, len(some), start, rule, best)
        found: list[Pose2] = []
        for *numbers, score in best[np.argsort(-best[:-1, 3], kind="stable")].tolist():
            pose = Pose2(*numbers)
            if score > 0.0 and not any(_near(pose, other, APART) for other in found):
                found.append(pose)
        return found[:TAKEN]

    def _learn(self, match: Match, tried: bool) -> None:
        """The usual agreement, and from the usual residual the field's own error.

        Where nothing better was found the usual falls at once: the scans after are alike, and
        trying everything at each of them finds no more.
        """
        share = 0.5 if tried and match.close < self._usual else 0.1
        self._usual += share * (match.close - self._usual)
        self._residual += 0.05 * (match.residual - self._residual)
        noise = max(self._params.map_noise * self._residual, 0.001)
        self._rule = self._rule._replace(map_noise=noise)


def _near(a: Pose2, b: Pose2, limits: tuple[float, float]) -> bool:
    """Whether two poses are closer than limits [m], [rad]."""
    step = a.between(b)
    return math.hypot(step.x, step.y) < limits[0] and abs(step.theta) < limits[1]
