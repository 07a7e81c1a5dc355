"""Which of several matches of one scan is believed, and which places are told apart."""

from __future__ import annotations

import math

from gmapping.match import FIRM, Match, Matcher, with_prior
from gmapping.scan import View
from gmapping.surfaces import FOUND, GAIN
from slams.geometry import Prior
from slams.motion.track import INDEPENDENT, Track
from slams.types import Pose2

LEAP, LEAP_TURN = 0.05, 0.02  # m, rad: no draw goes so far


def foreseen(matcher: Matcher, view: View, owner: int, known: Prior, room: float) -> Match:
    """The match from what is known of the pose, near which it stays where that costs less.

    ours: asked farther off than `room` [m], where no robot accelerates to. Along a bare corridor
    people who walk there explain a scan as well as the few beams at its end.
    """
    match = matcher.match(view, owner, known, known.pose)
    if math.dist(match.pose[:2], known.pose[:2]) <= room:
        return match
    held = matcher.match(view, owner, Prior(known.pose, FIRM * known.information), known.pose)
    return min((match, held), key=lambda found: with_prior(found, known))


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
