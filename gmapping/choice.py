"""Which of several matches of one scan is believed, and which places are told apart."""

from __future__ import annotations

import math

from gmapping.match import Match
from gmapping.surfaces import FOUND, GAIN
from slams.motion.track import INDEPENDENT, Track
from slams.types import Pose2

LEAP, LEAP_TURN = 0.05, 0.02  # m, rad: no draw goes so far


def believed(tried: list[Match], track: Track) -> Match:
    """The match that costs least; the first one is the prediction's.

    ours: what contradicts the prediction has to explain more, by Student's law: along a corridor
    the ground that was seen last explains as much as any. Not so where ground of old explains the
    scan far better there: a loop closes, and it is the way around it that was wrong, not the last
    step.
    """

    def _price(match: Match) -> float:
        if not track.reachable(match.pose):
            return math.inf
        closes = match.old > max(tried[0].old + GAIN, FOUND)
        return match.cost + (0.0 if closes else INDEPENDENT * track.charge(match.pose))

    return min(tried, key=_price)


def leaps(way: Pose2) -> bool:
    """Whether no draw goes so far."""
    return math.hypot(way.x, way.y) > LEAP or abs(way.theta) > LEAP_TURN
