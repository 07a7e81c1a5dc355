"""The matcher: distance-field maps, a tracked pose, Gaussian proposals."""

from __future__ import annotations

import math

import numpy as np

from gmapping.map import TileMap
from gmapping.map_kernels import LAYERS, SurfaceModel, insert
from gmapping.match_kernels import Prior
from gmapping.params import GMappingParams
from gmapping.particles import Particles
from gmapping.peaks import Belief, Peaks, climb, search
from gmapping.scan import EndPoints, Track
from gmapping.scan_kernels import Walls, surfaces
from slams.motion.chord import FLOOR
from slams.motion.model import Motion, Prediction
from slams.motion.trust import Limits
from slams.types import IDENTITY, Floats, Pose2, Scan, wrap_angle

GRAZING = 0.1  # cosine; walls seen more edge-on say nothing
RATIO = 0.1  # thickness over length of a wall, squared
ACCEPTED = 0.5  # share of the usual quality below which not even a new room explains a scan
MEMORY = 0.05  # weight of one scan in the usual quality
MOST_SURPRISE, SURPRISE_MEMORY = 1000.0, 0.02  # of a match, its weight in the usual surprise
LOST_AFTER = 1.0  # s without a scan that the map explains: a robot is elsewhere by then
NEW_GROUND = 0.5  # m on wheels without a match: what is seen there is new, not foreign
EASED = 400.0  # of a prior's covariance that matches made, not wheels: it would confirm itself
BLIND = 10.0  # m, rad, deviation of a match along a way it does not see
PAUSE = 0.5  # s between two searches of a lost robot, which reach far


class SurfaceMatcher:
    """Tracks every scan against the best particle's map; proposes poses for all at key scans.

    `state` "matched", "predicted" or, after `LOST_AFTER`, "lost"; `covariance` (3, 3) [m, rad] of
    the tracked pose; `quality` the share of the last scan that lies on known surfaces.
    """

    layers = LAYERS
    temper = 1.0

    def __init__(
        self, params: GMappingParams, motion: Motion, particles: Particles, tiles: TileMap
    ) -> None:
        p = self._params = params
        self._motion, self._particles, self._tiles = motion, particles, tiles
        self._points = EndPoints(params, p.grain)
        self._walls = Walls(p.reach, p.flatness, RATIO, GRAZING)
        self._model = SurfaceModel(p.band, p.cap, p.sigma, p.wide, p.width, p.steps, p.independent)
        self._limits = Limits(params)
        self._buffer = np.zeros((0, 5))
        self._key, self._keyed = IDENTITY, False
        self._way_covariance: Floats = np.zeros((3, 3))
        self._usual_quality = 0.0
        self._unmatched = self._unsearched = self._carried = 0.0  # s, s, m
        self._eased = self._surprise = 1.0
        self.state = "predicted"
        self.covariance: Floats = FLOOR * np.eye(3)  # the first pose is the map's frame
        self.match_covariance = self.covariance  # of the match alone, without the prediction
        self.quality = 0.0
        self.counts = {"searched": 0, "recovered": 0, "lost": 0}

    def points(self, scan: Scan, velocity: Pose2) -> Floats:
        """Pieces of surface (n, 5): x, y [m], nx, ny in the base frame, how many beams."""
        points, beams = self._points(scan, velocity)
        if len(points) > len(self._buffer):
            self._buffer = np.zeros((len(scan.ranges), 5))
        return self._buffer[: surfaces(points, beams, self._walls, self._buffer)]

    def track(self, prediction: Prediction, scan: Scan) -> Track:
        """Pose of greatest posterior in the best particle's map, else the prediction."""
        p, velocity = prediction, prediction.velocity
        points = self.points(scan, velocity)
        self.covariance, self.quality = p.pose_covariance(self.covariance), 0.0
        self._way_covariance = p.pose_covariance(self._way_covariance)
        if len(points) == 0 or not self._keyed:
            self._judge(p, len(points) > 0)
            return Track(p.pose, points, velocity)
        eased = self._eased = self._surprise if "wheels" in p.used else EASED
        belief = Belief(np.array(p.pose), eased * self.covariance)
        peak, belief = self._best(points, p, belief)
        if self._points.sweeps:  # seen again with the motion that was found
            velocity = self._motion.velocity_to(_pose(peak))
            points = self.points(scan, velocity)
            peak = self._climb(points, belief, peak.poses[0])
        if not self._judge(p, self._explains(points, p, peak)):
            return Track(p.pose, points, velocity)
        prior = np.asarray(np.linalg.inv(belief.covariance))
        match: Floats = peak.information[0] - prior
        self.covariance = np.asarray(np.linalg.inv(match + eased * prior))
        self.match_covariance = np.asarray(np.linalg.inv(match + BLIND**-2 * np.eye(3)))
        self._learn_surprise(peak, belief, prior, eased)
        return Track(_pose(peak), points, velocity)

    def _learn_surprise(self, peak: Peaks, belief: Belief, prior: Floats, eased: float) -> None:
        """By how much predictions miss the matches more than both say, as a ratio of variances."""
        off = peak.poses[0] - belief.pose
        apart = off + self.match_covariance @ prior @ off
        both = belief.covariance / eased + self.match_covariance
        surprise = min(float(apart @ np.linalg.solve(both, apart)) / 3.0, MOST_SURPRISE)
        usual = self._surprise + SURPRISE_MEMORY * (surprise - self._surprise)
        self._surprise = max(usual, 1.0)

    def due(self, pose: Pose2) -> bool:
        """Whether the tracked pose has left the last key scan far enough behind."""
        way = self._key.between(pose)
        far = math.hypot(way.x, way.y) >= self._params.linear_update
        return far or abs(way.theta) >= self._params.angular_update or not self._keyed

    def propose(self, pose: Pose2, points: Floats, rng: np.random.Generator) -> Floats:
        """Move every particle by the tracked way, then draw it around its own peak; log weights.

        [Grisetti07] improved proposal; ours: the Gaussian is Laplace's at the peak instead of a
        fit to samples, so the weight is the peak's posterior x sqrt(det 2 pi H^-1).
        """
        particles, n = self._particles, len(self._particles)
        particles.move(np.array(self._key.between(pose)))
        noise = _turned(self._way_covariance, particles.poses[:, 2] - pose.theta)
        noise *= self._eased
        prior = Prior(particles.poses, np.asarray(np.linalg.inv(noise), np.float64))
        tiles = self._tiles.tiles
        peaks = climb(tiles, np.arange(n), points, prior, particles.poses, self._model)
        factor = np.linalg.cholesky(peaks.information)
        draws = self._params.spread * rng.standard_normal((n, 3))[..., None]
        off: Floats = np.linalg.solve(factor.transpose(0, 2, 1), draws)[..., 0]
        particles.poses[:] = peaks.poses + off
        log_w: Floats = -peaks.cost - np.log(np.diagonal(factor, 0, 1, 2)).sum(axis=1)
        return log_w

    def insert(self, points: Floats, poses: Floats) -> bool:
        """Write the scan into the particles' maps, at these poses; False if there was no room."""
        return insert(self._tiles.tiles, poses, points, self._model) == 0

    def start_way(self, pose: Pose2) -> None:
        """Measure the way to the next key scan from here."""
        self._key, self._keyed = pose, True
        self._way_covariance = np.zeros((3, 3))

    def _climb(self, points: Floats, belief: Belief, start: Floats) -> Peaks:
        best = np.array([self._particles.best])
        return climb(self._tiles.tiles, best, points, belief.prior(), start[None], self._model)

    def _best(self, points: Floats, p: Prediction, belief: Belief) -> tuple[Peaks, Belief]:
        """The peak, or a better one if it explains less of the scan than usual; its prior."""
        peak, dt = self._climb(points, belief, belief.pose), p.dt
        self._unsearched += dt
        poor = _share(points, peak) < self._params.poor_match * self._usual_quality
        if not poor or (self.state == "lost" and self._unsearched < PAUSE):
            return peak, belief
        self._unsearched = 0.0
        return self._recover(points, p, belief, peak)

    def _recover(
        self, points: Floats, p: Prediction, belief: Belief, peak: Peaks
    ) -> tuple[Peaks, Belief]:
        """Try wider starts: odometry may have slipped, or lag behind the robot.

        What they find is charged by its distance from the prediction, in units of a covariance
        that a slip is part of, and for how wide that is.
        """
        self.counts["searched"] += 1
        slip = belief.covariance + np.eye(3) * (self._params.slip * p.dt) ** 2
        tighter = 0.5 * (_log_det(slip) - _log_det(belief.covariance))
        wide = Belief(belief.pose, slip)
        goes_on = p.pose @ p.step.inverse() @ p.continued
        tiles, best = self._tiles.tiles, self._particles.best
        starts = (search(tiles, best, points, wide, self._model), _near(goes_on, p.pose))
        peaks = [peak._replace(cost=peak.cost - tighter)]
        usual = self._params.poor_match * self._usual_quality  # else they explain nothing either
        others = (self._climb(points, wide, start) for start in starts)
        peaks += [other for other in others if _share(points, other) >= usual]
        best_peak = min(peaks, key=lambda one: float(one.cost[0]))
        found = best_peak is not peaks[0]
        self.counts["recovered"] += found
        return best_peak, wide if found else belief

    def _explains(self, points: Floats, prediction: Prediction, peak: Peaks) -> bool:
        """Whether the map explains a scan from a pose that the robot can have driven to."""
        self.quality = _share(points, peak)
        usual, seconds = self._usual_quality, self._unmatched + prediction.dt
        off = prediction.pose.between(_pose(peak))
        if self.quality < ACCEPTED * usual or not self._limits.allow(*off, seconds):
            return False
        if self.quality >= self._params.poor_match * usual:
            self._usual_quality += (MEMORY if usual > 0.0 else 1.0) * (self.quality - usual)
        return True

    def _judge(self, prediction: Prediction, matched: bool) -> bool:
        """Keep account of whether the scans are explained, or wheels lead to where none can be."""
        if matched:
            self.state, self._unmatched, self._carried = "matched", 0.0, 0.0
            return True
        self._unmatched += prediction.dt
        if "wheels" in prediction.used:
            self._carried += math.hypot(prediction.step.x, prediction.step.y)
        if self._carried > NEW_GROUND:
            self._unmatched = self._carried = 0.0
        self.state = "lost" if self._unmatched > LOST_AFTER else "predicted"
        self.counts["lost"] += self.state == "lost"
        return False


def _pose(peak: Peaks) -> Pose2:
    x, y, theta = peak.poses[0].tolist()
    return Pose2(x, y, float(wrap_angle(theta)))


def _near(pose: Pose2, other: Pose2) -> Floats:
    """A pose with its heading on the same turn as another's, so that they can be compared."""
    turn = wrap_angle(pose.theta - other.theta)
    return np.array([pose.x, pose.y, other.theta + turn])


def _share(points: Floats, peak: Peaks) -> float:
    """Share of a scan's beams that lie close to surfaces."""
    return float(peak.close[0]) / max(float(points[:, 4].sum()), 1.0)


def _turned(covariance: Floats, angles: Floats) -> Floats:
    """Covariances (n, 3, 3) of a step that is turned by n angles [rad]."""
    c, s = np.cos(angles), np.sin(angles)
    turn = np.zeros((len(angles), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = c
    turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = -s, s, 1.0
    turned: Floats = turn @ covariance @ turn.transpose(0, 2, 1)
    return turned


def _log_det(matrix: Floats) -> float:
    return float(np.linalg.slogdet(matrix)[1])
