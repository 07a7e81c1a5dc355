"""The default matcher: distance-field maps, a tracked pose, Gaussian proposals."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gmapping.beams import EndPoints
from gmapping.motion import Motion, Step
from gmapping.params import GMappingParams
from gmapping.particles import Particles
from gmapping.register_kernels import propose, register, search
from gmapping.scan_kernels import Walls, surfaces
from gmapping.surface_kernels import LAYERS, SurfaceModel, insert, reserve
from gmapping.tiles import TileMap
from slams.types import IDENTITY, Floats, Pose2, Scan, wrap_angle

UPPER = np.triu_indices(3)
GRAZING = 0.1  # cosine; walls seen more edge-on say nothing
RATIO = 0.1  # thickness over length of a wall, squared
SPARSE = 100  # points the lattice search looks at
WIDEST = 0.6  # m, rad; the search goes no farther
LATTICE = (0.1, 0.1, 0.03)  # m, m, rad; within the reach of Gauss-Newton


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
        self._points = EndPoints(params)
        self._walls = Walls(p.reach, p.flatness, RATIO, GRAZING)
        self._model = SurfaceModel(p.band, p.cap, p.sigma, p.wide, p.width, p.steps, p.independent)
        self._buffer = np.zeros((0, 4))
        self._key, self._keyed = IDENTITY, False
        self.covariance: Floats = np.zeros((3, 3))
        self.quality = 1.0
        self.counts = {"lost": 0, "recovered": 0}

    def points(self, scan: Scan, step: Step) -> Floats:
        """Pieces of surface (n, 4): x, y [m], nx, ny in the base frame."""
        points, beams = self._points(scan, step)
        if len(points) > len(self._buffer):
            self._buffer = np.zeros((len(scan.ranges), 4))
        return self._buffer[: surfaces(points, beams, self._walls, self._buffer)]

    def track(self, pose: Pose2, step: Step, points: Floats, rng: np.random.Generator) -> Pose2:
        """Pose of greatest posterior in the best particle's map."""
        prior = _predict(pose, self.covariance, step)
        fit = self._register(points, prior, prior.pose)
        if self._keyed and 0.0 < len(points) * self._params.poor_match > fit.close:
            fit = self._recover(points, pose, step, prior, fit)
        self.covariance = _inverse(fit.information)
        self.quality = fit.close / max(len(points), 1)
        x, y, theta = fit.pose.tolist()
        return Pose2(x, y, float(wrap_angle(theta)))

    def due(self, pose: Pose2, step: Step) -> bool:
        """Whether the tracked pose has left the last key scan far enough behind."""
        way = self._key.between(pose)
        far = math.hypot(way.x, way.y) >= self._params.linear_update
        return far or abs(way.theta) >= self._params.angular_update or not self._keyed

    def propose(self, pose: Pose2, points: Floats, rng: np.random.Generator) -> Floats:
        """Move every particle by the tracked way, then draw it around its own peak; log weights."""
        particles, way = self._particles, self._key.between(pose)
        particles.move(np.array(way))
        information = _turned(self._motion.noise(way) ** -2.0, particles.poses[:, 2] - way.theta)
        draws = self._params.spread * rng.standard_normal((len(particles), 3))
        log_w = np.zeros(len(particles))
        propose(self._tiles.tiles, points, information, self._model, draws, particles.poses, log_w)
        return log_w

    def reserve(self, points: Floats, poses: Floats) -> bool:
        """Make room for the scan in the maps of the first particles; False if there is none."""
        band = self._params.band
        return self._tiles.write(lambda tiles: reserve(tiles, poses, points, band))

    def insert(self, points: Floats, poses: Floats) -> None:
        """Write the scan into the maps of the first particles, at these poses."""
        insert(self._tiles.tiles, poses, points, self._model)

    def start_way(self, pose: Pose2) -> None:
        """Measure the way to the next key scan from here."""
        self._key, self._keyed = pose, True

    def _register(self, points: Floats, prior: Prior, start: Floats) -> Fit:
        pose, found = start.copy(), np.zeros(12)
        upper = _inverse(prior.covariance)[UPPER]
        tiles, best = self._tiles.tiles, self._particles.best
        cost = register(tiles, best, points, prior.pose, upper, self._model, pose, found)
        return Fit(pose, cost, _symmetric(found), found[11])

    def _recover(self, points: Floats, pose: Pose2, step: Step, prior: Prior, fit: Fit) -> Fit:
        """Try wider starts: odometry may have slipped, or lag behind the robot."""
        self.counts["lost"] += 1
        slip = prior.covariance + np.eye(3) * (self._params.slip * step.seconds) ** 2
        tighter = 0.5 * (_log_det(slip) - _log_det(prior.covariance))
        fits = [fit._replace(cost=fit.cost - tighter)]
        for mean in (prior.pose, np.array(pose @ step.velocity)):
            wide = Prior(mean, slip)
            fits.append(self._register(points, wide, self._search(points, wide)))
        best = min(fits, key=lambda f: f.cost)
        self.counts["recovered"] += best is not fits[0]
        return best

    def _search(self, points: Floats, prior: Prior) -> Floats:
        sparse = np.ascontiguousarray(points[:: max(1, len(points) // SPARSE)])
        half = np.minimum(2.0 * np.sqrt(np.diag(prior.covariance)), WIDEST)
        window = np.concatenate([half, LATTICE])
        upper, start = _inverse(prior.covariance)[UPPER], prior.pose.copy()
        tiles, best = self._tiles.tiles, self._particles.best
        search(tiles, best, sparse, prior.pose, upper, window, self._model, start)
        return start


class Prior(NamedTuple):
    """What is believed of a pose (3,) before the scan, and its covariance (3, 3)."""

    pose: Floats
    covariance: Floats


class Fit(NamedTuple):
    """A peak: pose (3,), negative log posterior, information (3, 3), how many points lie close."""

    pose: Floats
    cost: float
    information: Floats
    close: float


def _predict(pose: Pose2, covariance: Floats, step: Step) -> Prior:
    """The prior after a step, in the map frame."""
    moved = pose @ step.pose
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    lever = np.array([[1.0, 0.0, pose.y - moved.y], [0.0, 1.0, moved.x - pose.x], [0.0, 0.0, 1.0]])
    noise = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) * step.deviation
    return Prior(np.array(moved), lever @ covariance @ lever.T + noise @ noise.T)


def _log_det(matrix: Floats) -> float:
    return float(np.linalg.slogdet(matrix)[1])


def _inverse(matrix: Floats) -> Floats:
    inverse: Floats = np.asarray(np.linalg.inv(matrix), np.float64)
    return inverse


def _turned(information: Floats, headings: Floats) -> Floats:
    """A diagonal information of the body frame (3,) seen from the map: upper triangles (n, 6)."""
    c, s = np.cos(headings), np.sin(headings)
    along, across, heading = information
    upper = np.zeros((len(headings), 6))
    upper[:, 0] = c * c * along + s * s * across
    upper[:, 1] = c * s * (along - across)
    upper[:, 3] = s * s * along + c * c * across
    upper[:, 5] = heading
    return upper


def _symmetric(upper: Floats) -> Floats:
    """The symmetric matrix (3, 3) of an upper triangle (>= 6,)."""
    h = np.zeros((3, 3))
    h[UPPER] = upper[:6]
    full: Floats = h + np.triu(h, 1).T
    return full
