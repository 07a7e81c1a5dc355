"""The default's matcher: Gauss-Newton on the distances to surfaces."""

from __future__ import annotations

import math

import numpy as np

from gmapping import match_kernels as kernels
from gmapping.map import TileMap
from gmapping.map_kernels import DEPTH, LAYERS, Splat, insert
from gmapping.match_kernels import Climb, Posterior
from gmapping.params import GMappingParams
from gmapping.particles import Proposals
from gmapping.render_kernels import Counts
from gmapping.scan import View
from slams.frontend.degeneracy import scan_observability
from slams.frontend.motion_filter import Prediction
from slams.refine.lines import Match
from slams.types import Floats, Pose2, wrap_angle

OLD = 15.0  # m of way after which a surface is old: no robot sees a room that long without a loop
SOFT = 3.0  # deviations of the noise at which a distance counts as an outlier
CHANCE, EXPLAINED = 0.3, 0.9  # share of the beams that parallel walls explain anywhere; all
GAIN, FOUND = 0.2, 0.45  # share on old ground where a loop closes: more than here; at least
IN_CONFLICT = 0.05  # share of the beams there, at most: the place is another one, like it
REVISITED = np.diag(1.0 / np.array([0.2, 0.2, 0.05]) ** 2)  # information of a place found so
PLACES = 0.2  # of the independent beams tell one place from another like it
WALL = 0.5  # m between two pieces, at most, with a wall between them
HEADINGS = np.radians(np.arange(90.0))  # that walls are looked for to face
FOCUS = 20.0  # of a vote for a heading: it counts half 4 degrees away


class SurfaceMatcher:
    """Distances of a scan's pieces from the mean lines in the cells."""

    def __init__(self, params: GMappingParams) -> None:
        p = self._params = params
        self.tiles = TileMap(p.n_particles, LAYERS, p.resolution, p.max_tiles, p.max_cells, DEPTH)
        self._way = 0.0

    def match(self, view: View, owner: int, prior: Prediction, start: Pose2) -> Match:
        """The peak near `start` in the map of one particle."""
        how, poses = self._how(view, prior.information), np.array([start])
        owners, means = np.array([owner]), np.array([prior.pose])
        of = Posterior(self.tiles.tiles, owners, view.pieces, means, prior.information)
        h, out = _climb(of, how, poses)
        variance = max(float(out[0, 5]), view.noise**2)
        x, y, theta = poses[0].tolist()
        pose = Pose2(x, y, float(wrap_angle(theta)))
        return Match(pose, float(out[0, 4]) / view.beams, variance, h[0] / variance)

    def propose(
        self, view: View, means: Floats, information: Floats, places: list[Pose2], seen: Counts
    ) -> Proposals:
        """[Grisetti07] improved proposal; ours: Laplace's at the peak instead of a fit to samples.

        Of the beams only some are `independent`: the others say the same, and share the errors of
        the same walls. The weight is the likelihood of the beams on old ground: where a particle
        has just come from its scan fits whatever the way before, and chance alone would choose, as
        it would among the parallel walls of a building.
        Particles go to one of the `places` if their old ground agrees more with the scan there, and
        little of it ends where beams came by long ago, as `seen` then.
        """
        n, peaks, how = len(means), means.copy(), self._how(view, information)
        of = Posterior(self.tiles.tiles, np.arange(n), view.pieces, means, information)
        h, out = _climb(of, how, peaks)
        blind = _unseen(view, float(means[0, 2]))
        peaks -= (peaks - means) @ blind
        full, closes = how.width**2 * view.beams, np.zeros(n, np.bool_)
        for place in places:
            owners = np.flatnonzero(out[:, 6] < (CHANCE + GAIN) * full)
            others = np.tile(np.array(place), (len(owners), 1))
            there = of._replace(owners=owners, means=others.copy(), information=REVISITED)
            h2, out2 = _climb(there, how, others)
            on = zip(owners.tolist(), others, strict=True)
            conflicts = [self.evaluate(view, owner, at, seen)[1] for owner, at in on]
            better = out2[:, 6] > np.maximum(out[owners, 6] + GAIN * full, FOUND * full)
            better &= np.array(conflicts) <= IN_CONFLICT * view.beams
            moved = owners[better]
            peaks[moved], h[moved], out[moved] = others[better], h2[better], out2[better]
            closes[moved] = True
        worth, sees = self._worth(view), np.eye(3) - blind
        h = sees @ h @ sees
        factors = np.asarray(np.linalg.cholesky(worth * h + information), np.float64)
        evidence = np.clip(out[:, 6] - CHANCE * full, 0.0, (EXPLAINED - CHANCE) * full)
        return Proposals(peaks, factors, 0.5 * PLACES * worth * evidence, closes)

    def insert(self, view: View, poses: Floats, way: float) -> bool:
        """Write the scan into the particles' maps, at these poses; False if there was no room."""
        p, laser = self._params, view.mount
        self._way = way
        if self.tiles.used == 0:
            self.tiles.face(_heading(view.pieces) + float(poses[0, 2]))
        splat = Splat(p.band, p.cap, way, laser.x, laser.y)
        return insert(self.tiles.tiles, poses, view.pieces, splat) == 0

    def evaluate(self, view: View, owner: int, pose: Floats, seen: Counts) -> tuple[float, float]:
        """Beams that are inliers in one map, and that end where `seen` is free; pose (3,)."""
        width = self._width(view)
        return kernels.evaluate(self.tiles.tiles, owner, view.pieces, pose, width, seen)

    def _variance(self, view: View) -> float:
        """Of the distance of a beam [m^2].

        However quiet the beams: walls are not straight, and maps were drawn by poses that err.
        """
        return max(self._params.range_noise, view.noise) ** 2

    def _worth(self, view: View) -> float:
        """Of a square distance [1/m^2]: only some beams are `independent`, others say the same."""
        return min(1.0, self._params.independent / view.beams) / self._variance(view)

    def _width(self, view: View) -> float:
        return max(self._params.width, SOFT * view.noise)

    def _how(self, view: View, information: Floats) -> Climb:
        p = self._params
        width = self._width(view)
        wide, wait = max(p.band * p.resolution, width), 0
        known = np.linalg.eigvalsh(information[:2, :2])  # of a place, in its two main directions
        if known[0] * width**2 < 1.0:  # else the start is as near as that
            wait = p.steps - 1 - math.ceil(math.log2(wide / width))
        return Climb(wide, width, p.steps, self._variance(view), self._way - OLD, wait)


def _climb(of: Posterior, how: Climb, poses: Floats) -> tuple[Floats, Floats]:
    """Poses (k, 3) climb to their peaks in place; information (k, 3, 3), out (k, 7) there."""
    h, out = np.zeros((len(poses), 3, 3)), np.zeros((len(poses), 7))
    kernels.register(of, how, poses, h, out)
    return h, out


def _heading(pieces: Floats) -> float:
    """Which way [rad], up to right angles, most of the length of walls faces; pieces (k, 5).

    The mode, not the mean: things that stand askew are to turn nothing. Nor do beams count, of
    which small things near the laser have many.
    """
    facing, gaps = np.arctan2(pieces[:, 3], pieces[:, 2]), np.hypot(*np.diff(pieces[:, :2].T))
    lengths = np.where(gaps < WALL, gaps, 0.0)
    alike = np.exp(FOCUS * (np.cos(4.0 * (facing[:-1, None] - HEADINGS)) - 1.0))
    return float(HEADINGS[np.argmax(lengths @ alike)])


def _unseen(view: View, theta: float) -> Floats:
    """Projection (3, 3) on what a scan at a heading does not observe of a pose [Zhang16]."""
    seen = scan_observability(view, theta)
    direction = np.array((seen.x, seen.y, 0.0))
    return (1.0 - seen.share) * np.outer(direction, direction)
