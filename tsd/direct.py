"""Registration of the default: surface elements of the scan against the directional field."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.types import Floats, Laser, OccupancyGrid, Pose2, Scan
from tsd.field_kernels import place_lines
from tsd.fix import Fix, Start
from tsd.grid import Picture, TileField
from tsd.match_kernels import MatchRule, align
from tsd.params import TsdParams
from tsd.search_kernels import SearchRule, search
from tsd.surface_kernels import (
    Beams,
    SurfaceRule,
    Twist,
    find_hits,
    find_runs,
    fit_surfaces,
    sum_moments,
)

GAIN = 0.02  # another start must be better by this share of the elements
JUMP, JUMP_TURN = 0.5, 0.7  # a start this far off [m], [rad] costs half of the elements
ANGLE_STEP = 0.035  # of the wide search [rad]: half a coarse cell at 3 m
NO_STEP = 1e-6  # between the beams of a laser that has one [rad]
SEARCHED = 100  # elements that take part in the wide search


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
    """

    def __init__(self, params: TsdParams) -> None:
        p = self._params = params
        self._field = TileField(p.cell, p.truncation, p.max_weight)
        self._coarse = TileField(p.coarse_cell, p.coarse_truncation, p.max_weight)
        self._surface_rule = SurfaceRule(
            p.window, p.range_noise, p.max_slope, (p.roughness * p.range_noise) ** 2, p.beam_width
        )
        self._rule = MatchRule(p.iterations, 1e-4, 1e-5, p.robust, p.map_noise * p.range_noise)
        self._coarse_rule = MatchRule(p.iterations, 1e-3, 1e-3, 0.3 * p.coarse_truncation, 0.03)
        self._prior = np.zeros(3)
        self._normal_equations = np.zeros((5, 3))
        self._peaks = np.zeros((512, 4))
        self._usual, self._residual = 0.7, p.range_noise
        self._laser: Laser | None = None
        self._turned = np.zeros((2 * SEARCHED, 4))

    def see(self, scan: Scan, twist: Pose2) -> int:
        """Hits and surface elements of the scan, deskewed; returns how many elements there are."""
        if scan.laser is not self._laser and scan.laser != self._laser:
            self._take(scan.laser)
        self._n_hits = find_hits(scan.ranges, self._beams, Twist(*twist), self._hits)
        find_runs(self._hits, self._n_hits, self._beams, self._surface_rule, self._runs)
        sum_moments(self._hits, self._n_hits, self._sums)
        self._count = self._fit(self._params.spacing, self._elements)
        return self._count

    def register(self, start: Start) -> Fix:
        """Align from the prediction; when that does not convince, from elsewhere; pick the best."""
        self._start = start
        self._prior[:2] = start.deviation**-2
        self._prior[2] = start.turn_deviation**-2
        best = self._align(start.pose)
        information = self._normal_equations[:3].copy()
        searched, tried = False, False
        for attempt, enough in (
            (self._from_others, self._as_usual),
            (self._from_near, self._as_usual),
            (self._from_far, self._plausible),
        ):
            if enough(best):
                break
            tried = True
            for match in attempt():
                if match.worth > best.worth + GAIN:
                    best, searched = match, True
        if searched:
            self._align(best.pose)
            information = self._normal_equations[:3].copy()
        p = self._params
        good = best.close > p.min_close * best.known and best.known > p.min_known
        if good:
            if tried:
                self._usual = min(self._usual, best.close + GAIN)
            self._learn(best)
        return Fix(best.pose, good, best.close, information, searched)

    def push(self, pose: Pose2) -> None:
        """Enter the scan last seen at `pose` of the base into both fields."""
        count = self._fit(0.0, self._dense)
        if count == 0:
            return
        lines = self._lines[:count]
        box = place_lines(self._dense, count, self._runs, self._beams, np.array(pose), lines)
        laser = pose @ self._mount
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
        x = np.array(pose)
        field, rule = (self._coarse, self._coarse_rule) if coarse else (self._field, self._rule)
        known, close, residual, _ = align(
            field.kernel,
            self._elements,
            self._count,
            self._prior,
            rule,
            x,
            self._normal_equations,
        )
        total = max(self._count, 1)
        found = Pose2(*x.tolist())
        worth = close / total - self._penalty(found)
        return Match(found, known / total, close / total, worth, residual)

    def _penalty(self, pose: Pose2) -> float:
        """What a pose must make good for its distance from the prediction."""
        start = self._start
        expected = [start.pose, start.others[-1]] if start.doubtful else [start.pose]
        steps = [other.between(pose) for other in expected]
        return min(
            0.5 * ((step.x**2 + step.y**2) / JUMP**2 + (step.theta / JUMP_TURN) ** 2)
            for step in steps
        )

    def _plausible(self, match: Match) -> bool:
        """Whether most elements are known and most of those agree."""
        return match.close > 0.7 * match.known and match.known > 0.4

    def _as_usual(self, match: Match) -> bool:
        """Whether elements agree with the field as well as in the scans before."""
        usual = match.close > self._params.convincing * self._usual
        return usual and self._plausible(match)

    def _from_others(self) -> list[Match]:
        """Coarse to fine from the prediction and from the other starts."""
        starts = (self._start.pose, *self._start.others)
        return [self._align(self._align(pose, coarse=True).pose) for pose in starts]

    def _from_near(self) -> list[Match]:
        return self._search(1.0)

    def _from_far(self) -> list[Match]:
        return self._search(2.0)

    def _search(self, width: float) -> list[Match]:
        """Coarse to fine from the best peaks of an exhaustive search."""
        p = self._params
        rule = SearchRule(
            p.search_translation * width,
            p.search_rotation * width,
            p.coarse_cell * width,
            ANGLE_STEP,
            p.coarse_truncation,
        )
        stride = max(self._count // SEARCHED, 1)
        some = np.ascontiguousarray(self._elements[: self._count : stride])
        n = search(
            self._coarse.kernel,
            some,
            len(some),
            np.array(self._start.pose),
            rule,
            self._turned,
            self._peaks,
        )
        scores = np.pad(self._peaks[:n, 0], 1)
        peaks = np.flatnonzero((scores[1:-1] >= scores[:-2]) & (scores[1:-1] >= scores[2:]))
        best = peaks[np.argsort(-scores[1 + peaks], kind="stable")][:3]
        poses = [Pose2(*self._peaks[i, 1:].tolist()) for i in best]
        return [self._align(self._align(pose, coarse=True).pose) for pose in poses]

    def _learn(self, match: Match) -> None:
        """The usual agreement, and from the usual residual the field's own error."""
        self._usual += 0.1 * (match.close - self._usual)
        self._residual += 0.05 * (match.residual - self._residual)
        noise = max(self._params.map_noise * self._residual, 0.001)
        self._rule = self._rule._replace(map_noise=noise)
