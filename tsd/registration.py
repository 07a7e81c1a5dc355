"""The published registration: ray cast of a model scan, RANSAC, ICP."""

from __future__ import annotations

import math

import numpy as np

from slams.frontend.motion_filter import Prediction
from slams.geometry import Prior
from slams.refine.lines import Match
from slams.types import Laser, Pose2
from tsd.icp_kernels import IcpRule, icp
from tsd.map import STEP_TOLERANCE, TileField
from tsd.model_kernels import Fan, Model, cast_rays
from tsd.params import TsdParams
from tsd.ransac_kernels import PairRule, try_pairs
from tsd.scan import SurfaceScan

COARSE_STEP_TOLERANCE = 1e-3, 5e-4  # m, rad: of an ICP that the refinement follows
MIN_THINNED_ELEMENTS = 100  # left of a scan for RANSAC, and for an ICP that is refined
MAX_ICP_START_STD = 0.15  # m, of a prediction; from a worse start ICP may not converge
INLIER_RATIO_TIME = 1.0  # s, time constant of the mean inlier ratio


class Registration:
    """Matches a scan as [May14] and [Koch15] do, to a model scan cast from the map.

    Args:
        params: parameters.
        field: the map.
        rng: source of every random draw.
    """

    def __init__(self, params: TsdParams, field: TileField, rng: np.random.Generator) -> None:
        self._p, self._field, self._rng = params, field, rng
        self._points = np.zeros((params.rays, 5))
        self._best = np.zeros((2, 4))
        self._scratch = np.zeros((5, 3))
        self._mean_inlier_ratio = 0.0

    def match(self, scan: SurfaceScan, start: Pose2, prior: Prediction) -> Match:
        """ICP from a start; if the start is an uncertain prediction, also from RANSAC's pose."""
        expected = Prior(prior.pose, prior.information)
        found = self.icp(scan, start, expected)
        if start != prior.pose:
            return found
        (xx, _, _), (_, yy, _), _ = prior.covariance.tolist()
        least = self._p.convincing * self._mean_inlier_ratio
        if xx + yy > MAX_ICP_START_STD**2 or found.inlier_ratio < least:
            other = self.icp(scan, self.ransac(scan, start), expected)
            found = max(found, other, key=lambda match: match.inlier_ratio)
        gain = min(prior.dt / INLIER_RATIO_TIME, 1.0) if self._mean_inlier_ratio > 0.0 else 1.0
        self._mean_inlier_ratio += gain * (found.inlier_ratio - self._mean_inlier_ratio)
        return found

    def cast(self, base: Pose2, laser: Laser) -> Model:
        """Model scan: what the laser would measure in the map with the base at this pose."""
        at = base @ laser.mount
        model = Model(self._points, self._fan(laser), at.x, at.y, at.theta)
        cast_rays(self._field.kernel, model)
        return model

    def icp(self, scan: SurfaceScan, start: Pose2, prior: Prior) -> Match:
        """ICP of the scan to the model scan cast from `start`; `start` if there are few pairs."""
        p, x = self._p, np.array(start)
        rule = IcpRule(
            p.icp_iterations,
            *(COARSE_STEP_TOLERANCE if p.refine else STEP_TOLERANCE),
            p.widest_gate,
            max(p.narrowest_gate, scan.softness),
            p.pair_window,
            self._field.error,
            max(scan.count // MIN_THINNED_ELEMENTS, 1) if p.refine else 1,
        )
        model, mean, scratch = self.cast(start, scan.laser), np.array(prior.pose), self._scratch
        information = prior.information
        pairs, rms, _ = icp(model, scan.elements, scan.count, mean, information, rule, x, scratch)
        pose = Pose2(*x.tolist())
        if pairs <= p.min_known * scan.count or not all(map(math.isfinite, pose)):
            return Match(start, 0.0)
        inliers, conflicts = self._field.evaluate(scan, pose)
        return Match(pose, inliers - conflicts, rms * rms, scratch[:3].copy())

    def ransac(self, scan: SurfaceScan, start: Pose2) -> Pose2:
        """Pose near `start` with the best match score; `start` if no pair proposes a better one.

        A pair is a point of the model scan and an element of the scan [Koch15].
        """
        p = self._p
        angle = min(p.search_rotation, math.pi)
        rule = PairRule(p.search_translation, math.cos(angle), p.truncation)
        stride = max(scan.count // MIN_THINNED_ELEMENTS, 1)
        thinned = np.ascontiguousarray(scan.elements[: scan.count : stride])
        model, x = self.cast(start, scan.laser), np.array(start)
        hits = np.flatnonzero(model.points[: model.fan.rays, 4])
        trials, best = self._rng.permutation(hits)[: p.trials], self._best
        best[0, :3] = start
        try_pairs(self._field.kernel, model.points, trials, thinned, len(thinned), x, rule, best)
        return Pose2(*best[0, :3].tolist())

    def _fan(self, laser: Laser) -> Fan:
        """Rays over the laser's field of view, at most as many as its beams."""
        count = min(self._p.rays, laser.n_beams)
        width = abs(laser.angle_increment) * (laser.n_beams - 1)
        middle = laser.angle_min + 0.5 * laser.angle_increment * (laser.n_beams - 1)
        reach = min(laser.range_max, self._p.max_range)
        if width + 1.5 * abs(laser.angle_increment) >= 2.0 * math.pi:
            gap = 2.0 * math.pi / count
            return Fan(count, middle - 0.5 * gap * (count - 1), gap, reach, count)
        gap = width / max(count - 1, 1)
        return Fan(count, middle - 0.5 * width, gap, reach, 0)
