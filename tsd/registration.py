"""The published registration: ray cast of a model scan, RANSAC, ICP."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.motion.track import Track
from slams.types import Floats, Pose2
from tsd.evidence import Evidence, near
from tsd.icp_kernels import IcpRule, icp
from tsd.map import TileField
from tsd.model_kernels import Fan, Model, cast_rays
from tsd.params import TsdParams
from tsd.ransac_kernels import PairRule, try_pairs
from tsd.view import View

FARTHEST = 30.0  # m a ray is followed
TAKEN = 3  # hypotheses that ICP starts from
APART = 0.1, 0.05  # closer hypotheses [m], [rad] are one
SCORED = 100  # elements that make and score hypotheses
ENOUGH = 100  # elements for an ICP that the field itself makes exact
SLOPPY = 1e-4, 1e-5  # steps of ICP [m], [rad] that are none
ROUGHLY = 1e-3, 5e-4  # the same of an ICP that the field itself makes exact


class Found(NamedTuple):
    """What ICP found: a pose, and what the pairs know of it (3, 3) [1/m2, 1/(m rad), 1/rad2].

    The information is overwritten by the next ICP.
    """

    pose: Pose2
    information: Floats


class Registration:
    """Poses a scan as [May14] and [Koch15] do, against the scan that the map would show.

    Args:
        params: parameters.
        view: the last scan.
        field: the map.
        track: what is known of the pose before the scan.
        evidence: what weighs the poses found.
        rng: source of every random draw.
    """

    def __init__(
        self,
        params: TsdParams,
        view: View,
        field: TileField,
        track: Track,
        evidence: Evidence,
        rng: np.random.Generator,
    ) -> None:
        self._params, self._view, self._field = params, view, field
        self._track, self._evidence, self._rng = track, evidence, rng
        self._points = np.zeros((params.rays, 5))
        self._best = np.zeros((params.trials + 1, 4))
        self._room = np.zeros((5, 3))

    def cast(self, base: Pose2) -> Model:
        """The model scan: what the laser would see of the map, were the base there."""
        laser = base @ self._view.laser.mount
        self._model = Model(self._points, self._fan(), laser.x, laser.y, laser.theta)
        self._hits = cast_rays(self._field.kernel, self._model)
        return self._model

    def icp(self, start: Pose2, known: Pose2) -> Found | None:
        """ICP of the scan to the model scan cast from `start`; None if too little of it pairs.

        `known` is the pose known beforehand: the prediction, or a hypothesis.
        """
        p, view = self._params, self._view
        x, model = np.array(start), self.cast(start)
        noise = view.noise / p.range_noise
        rule = IcpRule(
            p.icp_iterations,
            *(ROUGHLY if p.refine else SLOPPY),
            p.widest_gate,
            p.narrowest_gate * noise,
            p.pair_window,
            self._evidence.map_noise,
            max(view.count // ENOUGH, 1) if p.refine else 1,
        )
        mean, prior = np.array(known), self._track.prior(known)
        pairs, _, _ = icp(model, view.elements, view.count, mean, prior, rule, x, self._room)
        pose = Pose2(*x.tolist())
        if pairs <= p.min_known * view.count or not all(map(math.isfinite, pose)):
            return None
        return Found(pose, self._room[:3])

    def ransac(self, start: Pose2, width: float) -> list[Pose2]:
        """Poses near `start` that a pair of oriented points proposes and the field agrees with.

        Points of the model scan against elements of the scan; `width` scales the search.
        """
        p, view = self._params, self._view
        angle = min(p.search_rotation * width, math.pi)
        rule = PairRule(p.search_translation * width, math.cos(angle), p.truncation)
        stride = max(view.count // SCORED, 1)
        some = np.ascontiguousarray(view.elements[: view.count : stride])
        model = self.cast(start)
        rays = np.flatnonzero(model.points[: model.fan.rays, 4])
        trials = self._rng.permutation(rays)[: p.trials]
        best = self._best[: len(trials) + 1]
        try_pairs(
            self._field.kernel, model.points, trials, some, len(some), np.array(start), rule, best
        )
        found: list[Pose2] = []
        for *numbers, score in best[np.argsort(-best[:-1, 3], kind="stable")].tolist():
            pose = Pose2(*numbers)
            if score > 0.0 and not any(near(pose, other, APART) for other in found):
                found.append(pose)
        return found[:TAKEN]

    def _fan(self) -> Fan:
        """Rays over the laser's field of view, fewer than its beams."""
        laser = self._view.laser
        count = min(self._params.rays, laser.n_beams)
        width = abs(laser.angle_increment) * (laser.n_beams - 1)
        middle = laser.angle_min + 0.5 * laser.angle_increment * (laser.n_beams - 1)
        reach = min(laser.range_max, FARTHEST)
        if width + 1.5 * abs(laser.angle_increment) >= 2.0 * math.pi:
            gap = 2.0 * math.pi / count
            return Fan(count, middle - 0.5 * gap * (count - 1), gap, reach, count)
        gap = width / max(count - 1, 1)
        return Fan(count, middle - 0.5 * width, gap, reach, 0)
