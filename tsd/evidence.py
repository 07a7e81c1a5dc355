"""Evidence: how much of a scan the field explains at a pose."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.motion.track import Track
from slams.types import Floats, Pose2
from slams.usual import Usual
from tsd.map import TileField
from tsd.match_kernels import explain
from tsd.params import TsdParams
from tsd.ransac_kernels import AGAINST
from tsd.view import View

GAIN = 0.02  # another pose must explain this share of the elements more: less is noise
ENOUGH = 300  # elements of which that holds; the noise of fewer is larger by the root

MEMORY = 1.0  # s over which agreement is usual: some steps of the robot
AT_ONCE = 0.5  # share that a match counts by when nothing better was found
CHANCE = 2.0  # deviations of a share that elements agree with by chance
SURE = 0.1  # m, deviation of a prediction from which registrations do not go astray


class Match(NamedTuple):
    """A pose that a registration found, and what speaks for it.

    `known` and `close` are shares of the elements that the field knows and agrees with, `worth`
    the evidence, `residual` [m] the rms distance of those known; `information` (3, 3) [1/m2,
    1/(m rad), 1/rad2] is what the scan alone says of the pose.
    """

    pose: Pose2
    known: float
    close: float
    worth: float
    residual: float
    information: Floats


class Evidence:
    """Weighs poses of the last scan; all registrations are judged by the same measure.

    Args:
        params: parameters.
        view: the last scan.
        field: the map.
        track: what is known of the pose before the scan.
    """

    def __init__(self, params: TsdParams, view: View, field: TileField, track: Track) -> None:
        self._params, self._view, self._field, self._track = params, view, field, track
        self.usual, self.residual = Usual(MEMORY, 0.7), Usual(2.0 * MEMORY, params.range_noise)

    @property
    def robust(self) -> float:
        """Distance [m] at which an element is half in agreement, at the noise that is measured."""
        p = self._params
        return p.robust * self._view.noise / p.range_noise

    @property
    def map_noise(self) -> float:
        """Error [m] of the field, by the usual residual."""
        return max(self._params.map_noise * self.residual.value, 0.001)

    @property
    def gain(self) -> float:
        """Worth that a pose must have more than one that was there before it."""
        return GAIN * math.sqrt(max(ENOUGH / max(self._view.count, 1), 1.0))

    def weigh(self, pose: Pose2, information: Floats) -> Match:
        """What speaks for a pose: explained, less contradicted, less odd by the prediction."""
        view, total = self._view, max(self._view.count, 1)
        known, close, against, residual = explain(
            self._field.kernel, view.elements, view.count, np.array(pose), self.robust
        )
        charge = self._track.charge(pose) * self.gain / GAIN
        worth = (close - AGAINST * against) / total - charge
        worth -= not self._track.reachable(pose)
        return Match(pose, known / total, close / total, worth, residual, information.copy())

    def best(self, matches: list[Match]) -> Match:
        """The first, unless another is elsewhere and explains clearly more."""
        best = matches[0]
        for match in matches[1:]:
            elsewhere = not near(match.pose, matches[0].pose, SAME)
            if elsewhere and match.worth > best.worth + self.gain:
                best = match
        return best

    def good(self, match: Match) -> bool:
        """Whether a match is to be believed; of a robot that is lost not any that may be."""
        p, track = self._params, self._track
        if track.state == "lost" and not track.adrift and not self.plausible(match):
            return False
        agrees = match.close > p.min_close * match.known and match.known > p.min_known
        return agrees and track.reachable(match.pose)

    def plausible(self, match: Match) -> bool:
        """Whether most elements are known and most of those agree."""
        return match.close > 0.7 * match.known and match.known > 0.4

    def as_usual(self, match: Match) -> bool:
        """Whether elements agree with the field as well as in the scans before.

        Where the prediction is sure, what may be chance is no reason to look elsewhere.
        """
        usual = self.usual.value
        chance = CHANCE * math.sqrt(usual * (1.0 - usual) / max(self._view.count, 1))
        enough = match.close > self._params.convincing * usual
        if not enough and match.close > usual - chance:
            enough = self._track.uncertain < SURE
        return enough and self.plausible(match)

    def learn(self, match: Match, searched: bool, t: float) -> None:
        """The usual agreement and the usual residual, from a match at time `t` [s].

        Where a search found nothing better the usual falls at once: the scans after are alike, and
        searching at each of them finds no more.
        """
        at_once = searched and match.close < self.usual.value
        self.usual.learn(match.close, t, AT_ONCE if at_once else 0.0)
        self.residual.learn(match.residual, t)


SAME = 0.03, 0.02  # a pose so near [m], [rad] is no other answer: only noise prefers it


def near(a: Pose2, b: Pose2, limits: tuple[float, float]) -> bool:
    """Whether two poses are closer than limits [m], [rad]."""
    step = a.between(b)
    return math.hypot(step.x, step.y) < limits[0] and abs(step.theta) < limits[1]
