"""Ours, behind ICP: direct alignment to the field, exact to a fraction of a cell."""

from __future__ import annotations

import math

import numpy as np

from slams.motion.track import Track
from slams.types import Floats, Pose2
from tsd.evidence import Evidence, Match
from tsd.map import TileField
from tsd.match_kernels import MatchRule, agreement_along, align
from tsd.params import TsdParams
from tsd.view import View

STOP = 1e-4, 1e-5  # steps [m], [rad] that are none
UNSEEN = 0.01  # a direction seen worse than this [m] is looked along
UNEVEN = 0.1  # and this much worse than the other: all beams of a poor laser are not exact
NEEDED = 30  # elements that must speak of it; fewer prefer one place or another by chance
DOUBTED = 0.05  # m, deviation of a prediction by wheels that is looked behind
SHIFTS = np.linspace(-0.4, 0.4, 17)  # along it [m]


class Direct:
    """Gauss-Newton of the scan on the field itself.

    Args:
        params: parameters.
        view: the last scan.
        field: the map.
        track: what is known of the pose before the scan.
        evidence: what weighs the poses found.
    """

    def __init__(
        self, params: TsdParams, view: View, field: TileField, track: Track, evidence: Evidence
    ) -> None:
        self._params, self._view, self._field = params, view, field
        self._track, self._evidence = track, evidence
        self._room = np.zeros((5, 3))
        self._counts = np.zeros((len(SHIFTS), 2))

    def align(self, start: Pose2, known: Pose2) -> Match:
        """Gauss-Newton from `start`; a pose known beforehand holds it where the scan does not."""
        view, x = self._view, np.array(start)
        mean, prior = np.array(known), self._track.prior(known)
        align(
            self._field.kernel, view.elements, view.count, mean, prior, self._rule(), x, self._room
        )
        return self._evidence.weigh(Pose2(*x.tolist()), self._room[:3])

    def slipped(self, match: Match, by_wheels: bool) -> tuple[Pose2, Floats]:
        """Where the scan sees one direction badly, the mean of all poses along it by likelihood.

        In a corridor the few elements that face along it are beyond the reach of Gauss-Newton
        once the robot has slipped, and what noise turned that way holds the pose where it is. Where
        wheels tell the way along it well, they are better than what few elements seem to say.
        Returns the pose and the variance (2, 2) [m2] of the slip.
        """
        pose, (xx, xy, yy) = match.pose, match.information[(0, 0, 1), (0, 1, 1)].tolist()
        middle, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
        if middle - half > min(UNSEEN**-2, UNEVEN * (middle + half)):
            return pose, np.zeros((2, 2))
        across = 0.5 * math.atan2(2.0 * xy, xx - yy)
        axis = np.array([-math.sin(across), math.cos(across)])
        seen, agree = self._agreement(pose, SHIFTS[:, None] * axis).T
        here = len(SHIFTS) // 2
        doubt2 = float(axis @ self._track.predicted[:2, :2] @ axis)
        if seen[here] < NEEDED or (by_wheels and doubt2 < DOUBTED**2):
            return pose, np.zeros((2, 2))
        evidence = agree - seen * agree[here] / max(seen[here], 1.0)
        evidence -= 0.5 * SHIFTS**2 / doubt2
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

    def _rule(self) -> MatchRule:
        evidence = self._evidence
        return MatchRule(self._params.iterations, *STOP, evidence.robust, evidence.map_noise)

    def _agreement(self, pose: Pose2, offsets: Floats) -> Floats:
        """Elements seen and agreeing (n, 2) at a pose moved by offsets (n, 2) [m]."""
        view, counts = self._view, self._counts[: len(offsets)]
        agreement_along(
            self._field.kernel,
            view.elements,
            view.count,
            view.beams,
            np.array(pose),
            offsets,
            self._rule(),
            counts,
        )
        return counts
