"""Sight: in which direction a scan sees nothing, whatever a matcher makes of it.

Along a bare corridor a match means nothing, yet its normal equations claim that it does: normals of
straight walls that noise has turned, or steps of the cells, add up to a fraction of what is said
across, with as much certainty as there are beams [Zhang16]. What can be seen at all is told by the
scan itself, by the same measure for all matchers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.motion import belief_kernels as kernels
from slams.motion.sight_kernels import N_FACES, bends, faces
from slams.types import Floats, Pose2, Scan

TILT = math.radians(1.8)  # by which walls are not quite straight
LONE = 1.0  # beams that face along a corridor by chance
QUARTER, EXPECTED = 4, 0.3186  # the best quarter of all errors is less, in deviations
FEWEST = 8  # beams beside others that tell the noise
UNKNOWN = 0.02  # m, noise of a scan that does not tell
ENOUGH = 360  # beams of a scan that are looked at
MARGIN = 2.0  # times as much as there is to see is what a matcher may claim
TELLING = 0.5  # share of the beams that have to be on walls, or nothing is known of them


class Sight(NamedTuple):
    """The direction (x, y) that a scan sees worst, in the map's frame, and how well it sees it.

    `share` of what it says there counts: 1 where walls face all ways, 0 where nothing is seen
    beyond what noise says. `even` is what there is to see, as a share of the other direction, and
    `chance` what noise makes of that.
    """

    x: float
    y: float
    share: float
    even: float
    chance: float

    def judging(self, seen: Floats, rough: bool) -> Sight:
        """The same, with the share that counts of what a matcher's information (3, 3) claims.

        Either the walls bear it out, or it is more than chance makes of what is said across. A
        rough match takes the steps of its cells for walls: of that chance makes anything.
        """
        said = self.along(seen)
        if said <= 0.0:
            return self
        across = float(seen[0, 0] + seen[1, 1]) - said
        by_walls = min(self.share * said, MARGIN * self.even * across)
        by_match = 0.0 if rough else said - self.chance * across
        share = max(by_walls, by_match, 0.0) / said
        return Sight(self.x, self.y, share, self.even, self.chance)

    def of(self, seen: Floats) -> Floats:
        """What is left of the information (3, 3) of a scan."""
        return self.stretched(seen, math.sqrt(self.share))

    def stretched(self, of: Floats, by: float) -> Floats:
        """A covariance or information (3, 3), so many times as long in that direction."""
        return of if by == 1.0 else kernels.stretched(of, self.x, self.y, by)

    def after(self, before: Sight) -> Sight:
        """The same, but no better than the one before: what one scan alone sees may be noise."""
        share, even = min(self.share, before.share), min(self.even, before.even)
        return Sight(self.x, self.y, share, even, self.chance)

    def along(self, of: Floats) -> float:
        """What a covariance or information (3, 3) has in that direction."""
        return kernels.along(of, self.x, self.y)

    def widened(self, of: Floats, more: float) -> Floats:
        """A covariance or information (3, 3) with so much [m^2], [1/m^2] more in that direction."""
        x, y = self.x, self.y
        xx, xy, yy = more * x * x, more * x * y, more * y * y
        return np.asarray(of + np.array(((xx, xy, 0.0), (xy, yy, 0.0), (0.0, 0.0, 0.0))))


CLEAR = Sight(1.0, 0.0, 1.0, 1.0, 0.0)


def sight(scan: Scan, pose: Pose2) -> Sight | None:
    """What a scan sees from a pose of the base; None if too little of it lies on walls to tell."""
    laser, out = scan.laser, np.zeros(N_FACES)
    every, far = max(1, laser.n_beams // ENOUGH), laser.range_max
    faces(scan.ranges, laser.directions, every, far, noise_of(scan, every), out)
    xx, xy, yy, beams, hits = out.tolist()
    if beams <= TELLING * hits:
        return None
    middle, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    least, most = middle - half, middle + half
    chance = (math.tan(TILT) ** 2 + LONE / (every * beams)) * most
    share = 1.0 - chance / least if least > chance else 0.0
    along = 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi + pose.theta + laser.mount.theta
    return Sight(math.cos(along), math.sin(along), share, share * least / most, chance / most)


def noise_of(scan: Scan, every: int = 1) -> float:
    """Noise [m] of a scan, by the quarter of its beams that is most in line with others."""
    laser, errors = scan.laser, np.empty(scan.laser.n_beams // every + 1)
    turn = every * laser.angle_increment
    m = bends(scan.ranges, every, turn, laser.range_max, errors)
    if m < FEWEST:
        return UNKNOWN
    return float(np.partition(errors[:m], m // QUARTER)[m // QUARTER]) / EXPECTED
