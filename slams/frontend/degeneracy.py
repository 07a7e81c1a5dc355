"""Degeneracy: the direction in which a scan does not observe the position [Zhang16].

The errors of normals and small or moving objects give a match in a bare corridor some information
along the corridor, which is only noise. So an eigenvalue counts only above a noise floor. Surfaces
count by their length, not by the number of beams on them.

[Zhang16] J. Zhang, M. Kaess, S. Singh: On Degeneracy of Optimization-based State Estimation
Problems. ICRA 2016.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.frontend.degeneracy_kernels import scatter
from slams.scan.end_points import EndPoints
from slams.types import Floats

ISOTROPIC_LENGTH = 0.05  # m of surface that may have any normal, as the edge of a door
MOVABLE_LENGTH = 0.9  # m of surface that may move, as two persons
MAP_NORMAL_STD = 0.02  # rad, of the normals of a map
MIN_OBSERVED_SHARE = 0.9  # of an eigenvalue above the noise floor, to count as observed


class Observability(NamedTuple):
    """Unit vector (x, y) in the map along the direction observed worst, and the share observed.

    `share` is 1 where the direction is observed, 0 where its eigenvalue is within the noise floor.
    """

    x: float
    y: float
    share: float


FULLY_OBSERVED = Observability(1.0, 0.0, 1.0)


def observability(
    xx: float, xy: float, yy: float, normal_std: float, isotropic: float = ISOTROPIC_LENGTH
) -> Observability:
    """Smaller eigenvalue of the scatter of unit normals against its noise floor [Zhang16].

    xx, xy, yy [m]: integrals of n n^T over the surfaces with normals n; `normal_std` [rad] of a
    normal; `isotropic` [m] of surface that may have any normal.
    """
    total = xx + yy
    if not total > 3.0 * isotropic:
        return FULLY_OBSERVED
    radius, middle = math.hypot(0.5 * (xx - yy), xy), 0.5 * total
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi
    least, greatest = middle - radius, middle + radius
    noise_floor = (normal_std**2 + isotropic / total) * greatest
    share = 1.0 - noise_floor / least if least > noise_floor else 0.0
    if share >= MIN_OBSERVED_SHARE:
        return FULLY_OBSERVED
    return Observability(math.cos(angle), math.sin(angle), share)


def match_observability(information: Floats) -> Observability:
    """Observability by a match with `information` (3, 3) about the pose in the map.

    The errors of the map's normals add information along a direction that no surface observes.
    """
    (xx, xy, _), (_, yy, _), _ = information.tolist()
    return observability(xx, xy, yy, MAP_NORMAL_STD, 0.0)


def scan_observability(
    points: EndPoints, theta: float, position_measured: bool = False
) -> Observability:
    """Observability by the normals of a scan taken at the heading `theta` [rad].

    `position_measured`, by wheels or a pose graph: surfaces that may move are not needed.
    """
    xx, xy, yy = scatter(points.rough_normals, points.n)
    isotropic = MOVABLE_LENGTH if position_measured else ISOTROPIC_LENGTH
    worst = observability(xx, xy, yy, points.rough_normal_error, isotropic)
    c, s = math.cos(theta), math.sin(theta)
    return Observability(c * worst.x - s * worst.y, s * worst.x + c * worst.y, worst.share)
