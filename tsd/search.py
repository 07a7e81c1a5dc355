"""Search: when poses away from the prediction are looked for, and when to rest from it."""

from __future__ import annotations

from slams.motion.track import Track
from slams.patience import Patience
from tsd.evidence import Evidence, Match

UNCERTAIN = 0.15  # m, deviation of a prediction beyond what ICP comes back from surely
SHORTEST, LONGEST = 0.1, 1.0  # s of rest after a fruitless search; doubled each time
WIDTHS = 1.0, 2.0  # of the search: the wider one if the map hardly knows the scan


class Search:
    """Decides on RANSAC, so that a search that finds nothing is not repeated at every scan.

    Args:
        track: what is known of the pose before the scan.
        evidence: what weighs the poses found.
    """

    def __init__(self, track: Track, evidence: Evidence) -> None:
        self._track, self._evidence = track, evidence
        self._patience = Patience(SHORTEST, LONGEST)
        self._poor = False
        self.fruitless = False  # the last scan was searched for in vain

    def begin(self, dt: float) -> None:
        """The next scan, `dt` [s] later."""
        self._patience.wait(dt)

    def wanted(self, match: Match, width: float) -> bool:
        """Whether a search as wide as that is due, after what was found so far."""
        if not self._patience.over:
            return False
        if width > WIDTHS[0]:
            return not self._evidence.plausible(match)
        return self._poor or self._unsure() or not self._evidence.as_usual(match)

    def end(self, match: Match, searched: bool, better: bool) -> None:
        """What came of it: `better`, something was found that nothing else had led to."""
        self._poor = not self._evidence.as_usual(match)
        self.fruitless = searched and not better
        if better or not (searched or self._poor or not self._patience.over):
            self._patience.forget()
        elif searched:
            self._patience.tried()

    def _unsure(self) -> bool:
        """Whether ICP may not come back from where the prediction is."""
        most = float(self._track.expected.trace())  # with what no scan tells: seldom so much
        return most > UNCERTAIN**2 and self._track.uncertain > UNCERTAIN
