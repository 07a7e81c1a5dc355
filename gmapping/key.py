"""KeyScans: the scans at which the filter runs, and the noise of the way between two of them."""

from __future__ import annotations

import math

import numpy as np

from gmapping.params import GMappingParams
from slams.types import IDENTITY, Floats, Pose2

OLD = 15.0  # m of way, after which ground is old: no robot sees a room that long without a loop
NEAR = 3.0  # m from where the robot was then: what it saw there, it sees from here
SELDOM = 1.0  # m of way between two places that are noted, and between two looks for them
GAPLESS = 360.0  # beams of a scan, below which the map that is made of them has gaps
FEW = 144.0  # beams of a scan, one every 2.5 degrees: of one with fewer a map is mostly its noise
SETTLE = 20  # looks, at whatever rate, over which that noise is a mean
MARK = 0.001  # m by which two key scans differ in `driven`, however near they are


class KeyScans:
    """When the next one is due, and how sure the tracked way there is.

    `n` so far; `driven` [m] the way along them, a millimeter more at each; never 0, which is
    what cells have that nobody saw.
    """

    def __init__(self, params: GMappingParams) -> None:
        self.n = 0
        self.driven = 1.0
        self._places: list[tuple[float, float, float]] = []  # x, y, driven
        self._params = params
        self._at = IDENTITY
        self._blind = False  # a scan since then was not matched

    def due(self, pose: Pose2, beams: float = math.inf, gaps: bool = False) -> bool:
        """Whether the tracked pose has left the last key scan far enough behind.

        A map that few `beams` began holds the robot there: its first scans are due however near.
        Where the map has `gaps` a scan of few fills them by as little: the next one is due as much
        sooner.
        """
        if beams < FEW and self.n < SETTLE:
            return True
        way, near = self._at.between(pose), min(beams / GAPLESS, 1.0) if gaps else 1.0
        far = math.hypot(way.x, way.y) >= near * self._params.linear_update
        return far or abs(way.theta) >= near * self._params.angular_update or self.n == 0

    def way(self, pose: Pose2) -> Pose2:
        """The tracked way since the last key scan, in the reported particle's map."""
        return self._at.between(pose)

    def information(self, way: Pose2, headings: Floats, predicted: Floats) -> Floats:
        """Of particles moved by `way`, with headings (n,): (n, 3, 3) [1/m^2, 1/(m rad), 1/rad^2].

        One noise for the whole way, whatever the rate of the scans; after scans that were not
        matched also that of the prediction (3, 3).
        """
        covariance = _turned(self._deviation(way), headings - way.theta)
        if self._blind:
            covariance += predicted
        return np.asarray(np.linalg.inv(covariance), np.float64)

    def missed(self) -> None:
        """A scan was not matched: the way is not tracked."""
        self._blind = True

    def done(self, pose: Pose2) -> None:
        """The scan at hand is a key scan; the reported particle is at `pose`."""
        self.n += 1
        noted, way = self._looks, self._at.between(pose)
        self.driven += math.hypot(way.x, way.y) + MARK
        if noted:
            self._places.append((pose.x, pose.y, self.driven))
        self.place(pose)

    def returns(self, pose: Pose2) -> bool:
        """Whether the robot may be on ground that it left long ago, and this is a scan to look."""
        if not self._looks:
            return False
        places = np.array(self._places).reshape(-1, 3)
        long_ago = places[places[:, 2] < self.driven - OLD]
        return bool((np.hypot(long_ago[:, 0] - pose.x, long_ago[:, 1] - pose.y) < NEAR).any())

    @property
    def _looks(self) -> bool:
        """Whether the last place that was noted is far enough behind."""
        return not self._places or self.driven - self._places[-1][2] >= SELDOM

    def place(self, pose: Pose2) -> None:
        """Measure the way to the next one from here."""
        self._at, self._blind = pose, False

    def _deviation(self, way: Pose2) -> Floats:
        """Of a tracked way ahead, aside [m] and of its turn [rad], after odometry's of old."""
        p, far, turn = self._params, math.hypot(way.x, way.y), abs(way.theta)
        xy = p.tracked_noise * (p.way_per_way * far + p.way_per_turn * turn) + p.key_noise
        theta = p.tracked_noise * (p.turn_per_way * far + p.turn_per_turn * turn) + p.key_noise
        return np.array([xy, xy, theta])


def _turned(deviation: Floats, headings: Floats) -> Floats:
    """Covariances (n, 3, 3) in the map of a way with deviations (3,) along the body's axes."""
    c, s = np.cos(headings), np.sin(headings)
    turned = np.zeros((len(headings), 3, 3))
    turned[:, 0, 0] = turned[:, 1, 1] = c
    turned[:, 0, 1], turned[:, 1, 0], turned[:, 2, 2] = -s, s, 1.0
    turned *= deviation
    covariances: Floats = turned @ turned.transpose(0, 2, 1)
    return covariances
