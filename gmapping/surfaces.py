"""The default's matcher: Gauss-Newton on the distances to surfaces."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gmapping import match_kernels as kernels
from gmapping.key import OLD, KeyScans
from gmapping.map import TileMap
from gmapping.map_kernels import DEPTH, LAYERS, Splat, insert
from gmapping.match import FIRM, Match, Proposals, far_off, lattice, strange, with_prior
from gmapping.match_kernels import Climb
from gmapping.params import GMappingParams
from gmapping.scan import View
from slams.geometry import Prior, inverse3, unlikely
from slams.motion.track import Track
from slams.types import Floats, Pose2, wrap_angle

SOFT = 3.0  # deviations of the noise at which a distance counts as an outlier
ODD = 4.0  # deviations from what is known, from which a match has to prove itself
SPARSE = 100  # pieces that the search looks at
STEP = np.array([0.1, 0.1, 0.03])  # m, m, rad, of the search; within the reach of Gauss-Newton

PLACES = 0.2  # of the independent beams tell one place from another like it
CHANCE = 0.2  # share of the beams that fits anywhere in a building of parallel walls
EXPLAINED = 0.9  # share of the beams on old ground from which none goes through its walls
AGAINST = 3.0  # beams elsewhere that one through a wall is worth, where a particle looks around
KNOWN = 0.5  # share of the beams on it from which a particle need not look around
GAIN, FOUND = 0.2, 0.6  # share that a place explains more than that, and at least
DRIFT = np.array([1.0, 1.0, 0.08])  # m, m, rad that it looks to either side
PRICE = 0.05  # share of the beams that the farthest offset has to explain more
OLD_STEP = np.array([0.15, 0.15, 0.04])  # m, m, rad
OLD_PIECES = 60  # pieces that it looks at
BLIND = 0.01  # of the information across, below which there is none along a corridor
WALL = 0.5  # m between two pieces, at most, with a wall between them
HEADINGS = np.radians(np.arange(90.0))  # that walls are looked for to face
FOCUS = 20.0  # of a vote for a heading: it counts half 4 degrees away
FOUND_THERE = np.diag(1.0 / np.array([0.2, 0.2, 0.05]) ** 2)  # information of a place found so


class SurfaceMatcher:
    """Distances of a scan's pieces from the mean lines in the cells."""

    def __init__(self, params: GMappingParams, keys: KeyScans) -> None:
        p = self._params = params
        self._keys = keys
        self.tiles = TileMap(p.n_particles, LAYERS, p.resolution, p.max_tiles, p.max_cells, DEPTH)

    def match(self, view: View, owner: int, prior: Prior, start: Pose2) -> Match:
        """The peak near `start` in the map of one particle.

        A turn that was not foreseen may throw the first steps far along a corridor. Where they end
        against all that is known the heading is found first, and the better of both is taken.
        """
        how = self._how(view, _least(prior.information))
        match = self._peak(view, owner, prior, start, how)
        if strange(match, prior) > ODD * ODD:
            narrow = how._replace(wide=how.width)
            firm = Prior(prior.pose, FIRM * prior.information)
            turned = self._peak(view, owner, firm, start, narrow)
            near = self._peak(view, owner, prior, turned.pose, narrow)
            if with_prior(near, prior) < with_prior(match, prior):
                return near
        return match

    def _peak(self, view: View, owner: int, prior: Prior, start: Pose2, how: Climb) -> Match:
        """One climb."""
        poses = np.array([start])
        means = kernels.Prior(np.array([prior.pose]), prior.information[None])
        h, out = self._climb(view.pieces, np.array([owner]), means, poses, how)
        variance = max(float(out[0, 5]), view.noise**2)
        x, y, theta = poses[0].tolist()
        pose = Pose2(x, y, float(wrap_angle(theta)))
        old, quality = out[0, 6] / (how.width**2 * view.beams), out[0, 4] / view.beams
        cost = self._cost(view, how, out[:, 3])[0]
        return Match(pose, float(quality), h[0] / variance, float(cost), float(old))

    def _cost(self, view: View, how: Climb, missing: Floats) -> Floats:
        """Of what the map does not explain, (n,) of `linearize`: no more than some beams tell."""
        told: Floats = missing * (min(self._params.independent, view.beams) / how.width**2)
        return told / view.beams

    def search(self, view: View, owner: int, center: Pose2, half: Floats) -> Pose2:
        """The best pose of a lattice, after one step of Gauss-Newton from each of its points."""
        starts = np.array(center) + lattice(half, STEP)
        n, known = len(starts), np.diag(1.0 / np.maximum(half, STEP) ** 2)
        means = kernels.Prior(np.tile(np.array(center), (n, 1)), np.tile(known, (n, 1, 1)))
        sparse = np.ascontiguousarray(view.pieces[:: max(1, len(view.pieces) // SPARSE)])
        how = self._how(view, math.inf)._replace(steps=2)
        _, out = self._climb(sparse, np.full(n, owner), means, starts, how)
        x, y, theta = starts[np.argmin(out[:, 3])].tolist()
        return Pose2(x, y, theta)

    def propose(self, view: View, means: Floats, information: Floats, track: Track) -> Proposals:
        """[Grisetti07] improved proposal; ours: Laplace's at the peak instead of a fit to samples.

        Of the beams only some are `independent`: the others say the same, and share the errors of
        the same walls. The weight is the likelihood of the beams on ground of old: where a particle
        has just come from its scan fits whatever the way before, and chance alone would choose.
        """
        n, peaks = len(means), means.copy()
        prior = kernels.Prior(means, information)
        how = self._how(view, _least(inverse3(track.expected)))
        h, out = self._climb(view.pieces, np.arange(n), prior, peaks, how)
        self._hold(view, how, prior, peaks, h, out, track.room)
        if self._keys.returns(Pose2(*means.mean(axis=0).tolist())):
            self._from_old_ground(view, how, peaks, h, out)
        worth = self._worth(view)
        factors = np.asarray(np.linalg.cholesky(worth * h + information), np.float64)
        log_w: Floats = 0.5 * PLACES * worth * self._for_old_ground(view, how, peaks, out[:, 6])
        return Proposals(peaks, factors, log_w)

    def _hold(
        self,
        view: View,
        how: Climb,
        prior: kernels.Prior,
        peaks: Floats,
        h: Floats,
        out: Floats,
        room: float,
    ) -> None:
        """Let particles whose peak is far from where the way led go back where that costs less.

        That is farther than `room` [m]. Not on ground of old: there a loop may close.
        """
        beyond = np.hypot(*(peaks - prior.poses)[:, :2].T) > room
        far = far_off(peaks, prior.poses, prior.information)
        owners = np.flatnonzero(beyond & (far > ODD * ODD) & (out[:, 6] == 0.0))
        if len(owners) == 0:
            return
        known = kernels.Prior(prior.poses[owners], prior.information[owners])
        firm, others = known._replace(information=FIRM * known.information), known.poses.copy()
        h2, out2 = self._climb(view.pieces, owners, firm, others, how)
        less_far = far_off(others, *known)
        stays = self._cost(view, how, out2[:, 3]) + _unlikely(less_far)
        held = stays < self._cost(view, how, out[owners, 3]) + _unlikely(far[owners])
        back = owners[held]
        peaks[back], h[back], out[back] = others[held], h2[held], out2[held]

    def _for_old_ground(self, view: View, how: Climb, poses: Floats, spared: Floats) -> Floats:
        """What old ground explains of the scan beyond chance, less what goes through it: (n,)."""
        full = how.width**2 * view.beams
        through, owners = np.zeros(len(poses)), np.flatnonzero(spared < EXPLAINED * full)
        if spared.any():
            through[owners] = self._through(view, how, owners, poses[owners])
        most = (EXPLAINED - CHANCE) * full
        told: Floats = np.clip(spared - CHANCE * full, 0.0, most) - through * full
        return told

    def _through(self, view: View, how: Climb, owners: NDArray[np.int64], poses: Floats) -> Floats:
        """Share (k,) of the beams that go through walls of old ground, from poses (k, 3)."""
        out, every = np.zeros(len(poses)), max(1, len(view.pieces) // OLD_PIECES)
        laser = kernels.Beams(view.mount.x, view.mount.y, every)
        kernels.crossed(self.tiles.tiles, owners, view.pieces, laser, how.old, poses, out)
        return out / view.beams

    def _from_old_ground(
        self, view: View, how: Climb, peaks: Floats, h: Floats, out: Floats
    ) -> None:
        """Let particles whose ground of old explains more of the scan elsewhere go there."""
        k2 = how.width**2 * view.beams
        owners = np.flatnonzero(out[:, 6] < KNOWN * k2)
        n, others = len(owners), peaks[owners]
        if n == 0:
            return
        off, share, tiles = lattice(DRIFT, OLD_STEP), np.zeros(n), self.tiles.tiles
        price = PRICE * ((off / DRIFT) ** 2).sum(axis=1)
        around = kernels.Around(off, price, max(1, len(view.pieces) // OLD_PIECES))
        kernels.search_old(tiles, owners, view.pieces, around, how, others, share)
        h2, out2 = self._climb_freely(view, owners, others, how)
        blind = _blind(others - peaks[owners], h2)
        if blind.any():
            others -= blind
            h2, out2 = self._climb_freely(view, owners, others, how)
        against = AGAINST * self._through(view, how, owners, others)
        better = out2[:, 6] / k2 - against > np.maximum(out[owners, 6] / k2 + GAIN, FOUND)
        moved = owners[better]
        peaks[moved], h[moved], out[moved] = others[better], h2[better], out2[better]

    def _climb_freely(
        self, view: View, owners: NDArray[np.int64], poses: Floats, how: Climb
    ) -> tuple[Floats, Floats]:
        """Poses (k, 3) found on ground of old climb from there, as `_climb`."""
        known = kernels.Prior(poses.copy(), np.tile(FOUND_THERE, (len(poses), 1, 1)))
        return self._climb(view.pieces, owners, known, poses, how)

    def insert(self, view: View, poses: Floats) -> bool:
        """Write the scan into the particles' maps, at these poses; False if there was no room."""
        p, laser = self._params, view.mount
        if self.tiles.used == 0:
            self.tiles.face(_heading(view.pieces) + float(poses[0, 2]))
        splat = Splat(p.band, p.cap, self._keys.driven, laser.x, laser.y)
        return insert(self.tiles.tiles, poses, view.pieces, splat) == 0

    def _worth(self, view: View) -> float:
        """Of a square distance [1/m^2]: only some beams are `independent`, others say the same.

        However quiet the beams: walls are not straight, and maps were drawn by poses that err.
        """
        deviation = max(self._params.range_noise, view.noise)
        return min(1.0, self._params.independent / view.beams) / deviation**2

    def _how(self, view: View, known: float) -> Climb:
        p = self._params
        width = max(p.width, SOFT * view.noise)
        old = self._keys.driven - OLD
        wide, wait = max(p.wide, width), 0
        if known * width**2 < 1.0:  # else the start is as near as that
            wait = p.steps - 1 - math.ceil(math.log2(wide / width))
        return Climb(wide, width, p.steps, view.noise**2, old, wait)

    def _climb(
        self,
        pieces: Floats,
        owners: NDArray[np.int64],
        prior: kernels.Prior,
        poses: Floats,
        how: Climb,
    ) -> tuple[Floats, Floats]:
        """Poses (k, 3) climb to their peaks in place; information (k, 3, 3), out (k, 7) there."""
        h, out = np.zeros((len(poses), 3, 3)), np.zeros((len(poses), 7))
        kernels.register(self.tiles.tiles, owners, pieces, prior, how, poses, h, out)
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


def _unlikely(squares: Floats) -> Floats:
    """Negative log of what is known (k,), at squared distances (k,) from it."""
    return np.array([unlikely(square) for square in squares.tolist()])


def _least(information: Floats) -> float:
    """The least that is known of a place in any direction [1/m^2], by information (3, 3)."""
    (xx, xy, _), (_, yy, _), _ = information.tolist()
    return float(0.5 * (xx + yy) - math.hypot(0.5 * (xx - yy), xy))


def _blind(ways: Floats, seen: Floats) -> Floats:
    """The part (n, 3) of ways (n, 3) along which scans say nothing, by their information (n, 3, 3).

    In a bare corridor a place farther along explains more of a scan only because more of the ground
    there is old: nobody looked back from where the map begins.
    """
    values, axes = np.linalg.eigh(seen[:, :2, :2])
    along = axes[:, :, 0] * (values[:, 0] < BLIND * values[:, 1])[:, None]
    parts = np.zeros_like(ways)
    parts[:, :2] = along * (along * ways[:, :2]).sum(axis=1)[:, None]
    return parts
