"""The original's matcher: end-point maps, poses from odometry, a hill climb per particle."""

from __future__ import annotations

import math

import numpy as np

from gmapping.beams import EndPoints, Track
from gmapping.climb_kernels import ClimbModel, climb_all, insert_hits
from gmapping.motion import Motion, Step
from gmapping.params import GMappingParams
from gmapping.particles import Particles
from gmapping.tiles import TileMap
from slams.types import IDENTITY, Floats, Pose2, Scan

ACROSS = 0.3  # share of a motion's noise along one axis that the other axis gets


class ClimbMatcher:
    """Adds noise to every particle at every scan; matches and weighs them at key scans."""

    layers = 1

    def __init__(
        self, params: GMappingParams, motion: Motion, particles: Particles, tiles: TileMap
    ) -> None:
        p = self._params = params
        self._particles, self._tiles = particles, tiles
        self._points = EndPoints(params)
        self._model = ClimbModel(
            p.score_sigma,
            p.likelihood_sigma,
            p.linear_step,
            p.angular_step,
            p.iterations,
            p.missed,
        )
        self._way = self._turn = math.inf
        self.temper = p.gain * len(particles)
        self.covariance = np.zeros((3, 3))
        self.quality = 1.0
        self.counts = {"failed": 0}

    def points(self, scan: Scan, step: Step) -> Floats:
        """End points (n, 3) [m] in the base frame."""
        return self._points(scan, step)[0]

    def track(self, pose: Pose2, step: Step, scan: Scan, rng: np.random.Generator) -> Track:
        """Odometry alone, as the original publishes; every particle gets noise of its own."""
        way = step.pose if step.measured else IDENTITY
        draws = rng.standard_normal((len(self._particles), 3))
        self._particles.move(np.array(way) + draws * self._noise(way))
        self._way += math.hypot(way.x, way.y)
        self._turn += abs(way.theta)
        return Track(pose @ way, self.points(scan, step), step)

    def due(self, pose: Pose2, step: Step) -> bool:
        """Whether the odometry has gone far enough; without odometry every scan is a key scan."""
        far = self._way >= self._params.linear_update
        return far or self._turn >= self._params.angular_update or not step.measured

    def propose(self, pose: Pose2, points: Floats, rng: np.random.Generator) -> Floats:
        """Move every particle to the peak of its score; log likelihoods there."""
        p, poses = self._params, self._particles.poses
        log_w = np.zeros(len(poses))
        tiles = self._tiles.tiles
        failed = climb_all(tiles, points, self._model, p.minimum_score, poses, log_w)
        self.counts["failed"] += failed
        self.quality = 1.0 - failed / len(poses)
        return log_w

    def insert(self, points: Floats, poses: Floats) -> bool:
        """Write the points into the particles' maps, at these poses; False if there was no room."""
        return insert_hits(self._tiles.tiles, poses, points) == 0

    def start_way(self, pose: Pose2) -> None:
        """Measure the way to the next key scan from here."""
        self._way = self._turn = 0.0

    def _noise(self, step: Pose2) -> Floats:
        """Deviation of the motion model (3,): [Grisetti07] original code, linear in the step."""
        p = self._params
        x, y, turn = abs(step.x), abs(step.y), abs(step.theta)
        sideways = p.way_per_turn * turn
        return np.array(
            [
                p.way_per_way * (x + ACROSS * y) + sideways,
                p.way_per_way * (y + ACROSS * x) + sideways,
                p.turn_per_turn * turn + p.turn_per_way * math.hypot(x, y),
            ]
        )
