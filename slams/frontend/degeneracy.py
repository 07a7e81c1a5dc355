"""Degeneracy: the direction in which a scan cannot tell where the robot is [Zhang16].

Along a bare corridor the normal equations of a match claim information that only noise makes:
normals that are tilted by their own error add a fraction of what is observed across. So do things
that face any way and may move: surfaces count by their length, not by the beams on them.

[Zhang16] J. Zhang, M. Kaess, S. Singh: On Degeneracy of Optimization-based State Estimation
Problems. ICRA 2016.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.frontend.degeneracy_kernels import scatter
from slams.scan.end_points import EndPoints
from slams.types import Floats

BY_CHANCE = 0.05  # m of surface in a scan that faces any way: the edge of a door
MOVABLE = 0.9  # m: of people and things that move; where nothing else is known they may be all
TILTED = 0.02  # rad: deviation of the normals of a map
OBSERVED = 0.9  # share from which a direction counts as observed


class Observability(NamedTuple):
    """Unit vector (x, y) in the map that a scan observes worst, and which share of it is no noise.

    `share` is 1 where the direction is observed, 0 where its eigenvalue is within the noise floor.
    """

    x: float
    y: float
    share: float


FULLY_OBSERVED = Observability(1.0, 0.0, 1.0)


def observability(
    xx: float, xy: float, yy: float, error: float, by_chance: float = BY_CHANCE
) -> Observability:
    """Eigenvalues of the scatter of unit normals against their noise floor [Zhang16].

    xx, xy, yy [m]: integrals over the surfaces of n n^T of their normals n; `error` of a normal
    [rad]; `by_chance` [m] of surface that faces any way.
    """
    total = xx + yy
    if not total > 3.0 * by_chance:
        return FULLY_OBSERVED
    radius, middle = math.hypot(0.5 * (xx - yy), xy), 0.5 * total
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi
    least, greatest = middle - radius, middle + radius
    floor = (error**2 + by_chance / total) * greatest
    share = 1.0 - floor / least if least > floor else 0.0
    if share >= OBSERVED:
        return FULLY_OBSERVED
    return Observability(math.cos(angle), math.sin(angle), share)


def match_observability(information: Floats) -> Observability:
    """That of a match, by its information (3, 3) about the pose in the map.

    Lines of the map that are tilted by their error seem to observe a direction that none faces.
    """
    (xx, xy, _), (_, yy, _), _ = information.tolist()
    return observability(xx, xy, yy, TILTED, 0.0)


def scan_observability(
    points: EndPoints, theta: float, known_otherwise: bool = False
) -> Observability:
    """That of a scan taken at the heading `theta` [rad], by which way its surfaces face.

    `known_otherwise`: wheels or a graph know the position, too: what may move counts as chance.
    """
    xx, xy, yy = scatter(points.rough_normals, points.n)
    by_chance = MOVABLE if known_otherwise else BY_CHANCE
    seen = observability(xx, xy, yy, points.rough_normal_error, by_chance)
    c, s = math.cos(theta), math.sin(theta)
    return Observability(c * seen.x - s * seen.y, s * seen.x + c * seen.y, seen.share)
