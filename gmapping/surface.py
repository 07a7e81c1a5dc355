"""The matcher: distance-field maps, a tracked pose, Gaussian proposals."""

from __future__ import annotations

import math

import numpy as np

from gmapping.map import TileMap
from gmapping.map_kernels import LAYERS, SurfaceModel, insert
from gmapping.match_kernels import Prior
from gmapping.motion import Motion, Step
from gmapping.params import GMappingParams
from gmapping.particles import Particles
from gmapping.peaks import Belief, Peaks, climb, search
from gmapping.scan import EndPoints, Track
from gmapping.scan_kernels import Walls, surfaces
from slams.types import IDENTITY, Floats, Pose2, Scan, wrap_angle

GRAZING = 0.1  # cosine; walls seen more edge-on say nothing
RATIO = 0.1  # thickness over length of a wall, squared
LOST = 0.5  # share of the usual quality below which not even a new room explains a scan
MEMORY = 0.05  # weight of one scan in the usual quality


class SurfaceMatcher:
    """Tracks every scan against the best particle's map; proposes poses for all at key scans.

    `covariance` (3, 3) [m, rad] of the tracked pose; `quality` the share of the last scan that
    lies on known surfaces.
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
        self._buffer = np.zeros((0, 5))
        self._key, self._keyed = IDENTITY, False
        self._usual_quality = 0.0
        self.covariance: Floats = np.zeros((3, 3))
        self.quality = 1.0
        self.counts = {"searched": 0, "recovered": 0, "lost": 0}

    def points(self, scan: Scan, step: Step) -> Floats:
        """Pieces of surface (n, 5): x, y [m], nx, ny in the base frame, how many beams."""
        points, beams = self._points(scan, step)
        if len(points) > len(self._buffer):
            self._buffer = np.zeros((len(scan.ranges), 5))
        return self._buffer[: surfaces(points, beams, self._walls, self._buffer)]

    def track(self, pose: Pose2, step: Step, scan: Scan, rng: np.random.Generator) -> Track:
        """Pose of greatest posterior in the best particle's map."""
        belief, points = _predict(pose, self.covariance, step), self.points(scan, step)
        peak = self._climb(points, belief, belief.pose)
        if self._keyed and len(points) > 0:
            peak = self._judged(points, pose, step, belief, peak)
        if self._points.sweeps:  # seen again with the motion that was found
            step = step._replace(sweep=pose.between(_pose(peak)))
            points = self.points(scan, step)
            peak = self._climb(points, belief, peak.poses[0])
        self.covariance = np.asarray(np.linalg.inv(peak.information[0]), np.float64)
        return Track(_pose(peak), points, step)

    def place(self, pose: Pose2) -> None:
        """The pose is given, and is sure."""
        self.covariance = np.zeros((3, 3))
        self.start_way(pose)

    def due(self, pose: Pose2, step: Step) -> bool:
        """Whether the tracked pose has left the last key scan far enough behind."""
        way = self._key.between(pose)
        far = math.hypot(way.x, way.y) >= self._params.linear_update
        return far or abs(way.theta) >= self._params.angular_update or not self._keyed

    def propose(self, pose: Pose2, points: Floats, rng: np.random.Generator) -> Floats:
        """Move every particle by the tracked way, then draw it around its own peak; log weights.

        [Grisetti07] improved proposal; ours: the Gaussian is Laplace's at the peak instead of a
        fit to samples, so the weight is the peak's posterior x sqrt(det 2 pi H^-1).
        """
        particles, way, n = self._particles, self._key.between(pose), len(self._particles)
        particles.move(np.array(way))
        noise = _turned(self._motion.noise(way), particles.poses[:, 2] - way.theta)
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

    def _climb(self, points: Floats, belief: Belief, start: Floats) -> Peaks:
        best = np.array([self._particles.best])
        return climb(self._tiles.tiles, best, points, belief.prior(), start[None], self._model)

    def _judged(
        self, points: Floats, pose: Pose2, step: Step, belief: Belief, peak: Peaks
    ) -> Peaks:
        """The peak, or a better one if it explains less of the scan than usual."""
        beams = float(points[:, 4].sum())
        if peak.close[0] < self._params.poor_match * self._usual_quality * beams:
            peak = self._recover(points, pose, step, belief, peak)
        self.quality = float(peak.close[0]) / beams
        self.counts["lost"] += self.quality < LOST * self._usual_quality
        if self.quality >= self._params.poor_match * self._usual_quality:
            weight = MEMORY if self._usual_quality > 0.0 else 1.0
            self._usual_quality += weight * (self.quality - self._usual_quality)
        return peak

    def _recover(
        self, points: Floats, pose: Pose2, step: Step, belief: Belief, peak: Peaks
    ) -> Peaks:
        """Try wider starts: odometry may have slipped, or lag behind the robot."""
        self.counts["searched"] += 1
        slip = belief.covariance + np.eye(3) * (self._params.slip * step.seconds) ** 2
        tighter = 0.5 * (_log_det(slip) - _log_det(belief.covariance))
        peaks = [peak._replace(cost=peak.cost - tighter)]
        for mean in (belief.pose, np.array(pose @ step.velocity)):
            wide = Belief(mean, slip)
            tiles, best = self._tiles.tiles, self._particles.best
            peaks.append(self._climb(points, wide, search(tiles, best, points, wide, self._model)))
        best_peak = min(peaks, key=lambda p: float(p.cost[0]))
        self.counts["recovered"] += best_peak is not peaks[0]
        return best_peak


def _pose(peak: Peaks) -> Pose2:
    x, y, theta = peak.poses[0].tolist()
    return Pose2(x, y, float(wrap_angle(theta)))


def _predict(pose: Pose2, covariance: Floats, step: Step) -> Belief:
    """What is believed after a step, in the map frame."""
    moved = pose @ step.pose
    lever = np.array([[1.0, 0.0, pose.y - moved.y], [0.0, 1.0, moved.x - pose.x], [0.0, 0.0, 1.0]])
    noise = _turned(step.deviation, np.array([pose.theta]))[0]
    return Belief(np.array(moved), lever @ covariance @ lever.T + noise)


def _turned(deviation: Floats, headings: Floats) -> Floats:
    """Covariances (n, 3, 3) in the map of a step with deviations (3,) along the body's axes."""
    c, s = np.cos(headings), np.sin(headings)
    turned = np.zeros((len(headings), 3, 3))
    turned[:, 0, 0] = turned[:, 1, 1] = c
    turned[:, 0, 1], turned[:, 1, 0], turned[:, 2, 2] = -s, s, 1.0
    turned *= deviation
    covariances: Floats = turned @ turned.transpose(0, 2, 1)
    return covariances


def _log_det(matrix: Floats) -> float:
    return float(np.linalg.slogdet(matrix)[1])
