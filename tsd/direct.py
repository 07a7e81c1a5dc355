"""Ours, behind ICP: direct alignment to the field, exact to a fraction of a cell."""

from __future__ import annotations

import numpy as np

from slams.motion.track import Track
from slams.types import Floats, Pose2
from tsd.evidence import Evidence, Match
from tsd.map import TileField
from tsd.match_kernels import MatchRule, align, leads_along
from tsd.params import TsdParams
from tsd.view import View

STOP = 1e-4, 1e-5  # steps [m], [rad] that are none
NOWHERE = np.zeros((0, 2))


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

    def align(self, start: Pose2, known: Pose2) -> Match:
        """Gauss-Newton from `start`; a pose known beforehand holds it where the scan does not."""
        view, x = self._view, np.array(start)
        mean, prior = np.array(known), self._track.prior(known)
        align(
            self._field.kernel, view.elements, view.count, mean, prior, self._rule(), x, self._room
        )
        return self._evidence.weigh(Pose2(*x.tolist()), self._room[:3])

    def leads(self, pose: Pose2, offsets: Floats) -> Floats:
        """How many more elements agree at a pose moved by offsets (n, 2) [m]: `slip.Leads`."""
        out = np.zeros((len(offsets), 2))
        self._along(pose, offsets, out)
        return out

    def contradicts(self, pose: Pose2) -> bool:
        """Whether more elements lie where beams passed than agree with the field."""
        seen, agree = self._along(pose, NOWHERE, NOWHERE)
        return 2.0 * agree < seen

    def _rule(self) -> MatchRule:
        evidence = self._evidence
        return MatchRule(self._params.iterations, *STOP, evidence.robust, evidence.map_noise)

    def _along(self, pose: Pose2, offsets: Floats, out: Floats) -> tuple[float, float]:
        """Elements seen and agreeing at a pose; `out` is what moving it does to them."""
        view, field, at = self._view, self._field.kernel, np.array(pose)
        elements, count = view.elements, view.count
        seen, agree = leads_along(
            field, elements, count, view.beams, at, offsets, self._rule(), out
        )
        return float(seen), float(agree)
