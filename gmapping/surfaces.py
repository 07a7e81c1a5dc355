"""The default's matcher: Gauss-Newton on the distances to surfaces."""

from __future__ import annotations

import math

import numpy as np

from gmapping import match_kernels as kernels
from gmapping.map import TileMap
from gmapping.map_kernels import N_SURFACE_LAYERS, N_SURFACE_VALUES, SurfaceUpdate, insert
from gmapping.match_kernels import GaussNewton, Posterior
from gmapping.params import GMappingParams
from gmapping.particles import Proposals
from gmapping.render_kernels import BeamCounts
from gmapping.scan import View
from slams.frontend.degeneracy import scan_observability
from slams.frontend.motion_filter import Prediction
from slams.refine.lines import Match
from slams.scan.end_points import ROBUST_SCALE_DEVIATIONS
from slams.types import Floats, Pose2, wrap_angle

MIN_LOOP_PATH_LENGTH = 15.0  # m after which a surface is old: longer than any room
CHANCE_SHARE = 0.3  # of the beams that parallel walls explain at any pose
COMPLETE_SHARE = 0.9  # of the beams that a complete match explains
MIN_LOOP_GAIN = 0.2  # share of the beams by which old surfaces explain more at a candidate
MIN_LOOP_SHARE = 0.45  # of the beams that old surfaces explain at a candidate
MAX_LOOP_CONFLICT_SHARE = 0.05  # of the beams; a similar place has more conflicts
CANDIDATE_INFORMATION = np.diag(1.0 / np.array([0.2, 0.2, 0.05]) ** 2)  # 1/m^2, 1/rad^2
PLACE_SHARE = 0.2  # of the independent beams that distinguish a place from a similar one
MAX_PIECE_GAP = 0.5  # m between two neighboring pieces of one wall
HEADING_CONCENTRATION = 20.0  # von Mises: a vote counts half at 4 degrees


class SurfaceMatcher:
    """Matches the pieces of a scan to the mean lines in the cells."""

    def __init__(self, params: GMappingParams) -> None:
        p = self._params = params
        size = p.n_particles, N_SURFACE_LAYERS, p.resolution
        self.tiles = TileMap(*size, p.max_tiles, p.max_cells, N_SURFACE_VALUES)
        self._path_length = 0.0

    def match(self, view: View, owner: int, prior: Prediction, start: Pose2) -> Match:
        """The peak of the posterior near `start`, in the map of the particle `owner`."""
        settings, poses = self._settings(view, prior.information), np.array([start])
        owners, means = np.array([owner]), np.array([prior.pose])
        target = Posterior(self.tiles.tiles, owners, view.pieces, means, prior.information)
        h, out = _register(target, settings, poses)
        variance = max(float(out[0, 5]), view.noise**2)
        x, y, theta = poses[0].tolist()
        pose = Pose2(x, y, float(wrap_angle(theta)))
        return Match(pose, float(out[0, 4]) / view.beams, variance, h[0] / variance)

    def propose(
        self, view: View, means: Floats, information: Floats, loops: list[Pose2], counts: BeamCounts
    ) -> Proposals:
        """Gaussian and weight of every particle, from predicted poses `means` (n, 3).

        [Grisetti07] improved proposal; ours: Laplace's approximation at the peak in place of a fit
        to samples. Along a degenerate direction a particle keeps its predicted position. The weight
        is the likelihood of the beams on old surfaces: recent ones match whatever the drift of the
        particle's path. A particle moves to one of the loop closure candidates `loops` if its old
        surfaces match more of the scan there, and few beams end in free space of `counts`.
        """
        n, peaks, settings = len(means), means.copy(), self._settings(view, information)
        target = Posterior(self.tiles.tiles, np.arange(n), view.pieces, means, information)
        h, out = _register(target, settings, peaks)
        degenerate = _degenerate_projection(view, float(means[0, 2]))
        peaks -= (peaks - means) @ degenerate
        complete, closes_loop = settings.last_scale**2 * view.beams, np.zeros(n, np.bool_)
        min_gain, min_score = MIN_LOOP_GAIN * complete, MIN_LOOP_SHARE * complete
        for candidate in loops:
            owners = np.flatnonzero(out[:, 6] < (CHANCE_SHARE + MIN_LOOP_GAIN) * complete)
            poses = np.tile(np.array(candidate), (len(owners), 1))
            target = target._replace(owners=owners, means=poses.copy())
            target = target._replace(information=CANDIDATE_INFORMATION)
            h2, out2 = _register(target, settings, poses)
            pairs = zip(owners.tolist(), poses, strict=True)
            conflicts = [self.evaluate(view, owner, pose, counts)[1] for owner, pose in pairs]
            verified = out2[:, 6] > np.maximum(out[owners, 6] + min_gain, min_score)
            verified &= np.array(conflicts) <= MAX_LOOP_CONFLICT_SHARE * view.beams
            moved = owners[verified]
            peaks[moved], h[moved], out[moved] = poses[verified], h2[verified], out2[verified]
            closes_loop[moved] = True
        beam_information, observed = self._beam_information(view), np.eye(3) - degenerate
        h = observed @ h @ observed
        factors = np.asarray(np.linalg.cholesky(beam_information * h + information), np.float64)
        chance = CHANCE_SHARE * complete
        score = np.clip(out[:, 6] - chance, 0.0, (COMPLETE_SHARE - CHANCE_SHARE) * complete)
        return Proposals(peaks, factors, 0.5 * PLACE_SHARE * beam_information * score, closes_loop)

    def insert(self, view: View, poses: Floats, path_length: float) -> bool:
        """Insert the scan into the particles' maps at these poses; False if no tile was free."""
        p, laser = self._params, view.mount
        self._path_length = path_length
        if self.tiles.used == 0:
            self.tiles.set_axis(_wall_heading(view.pieces) + float(poses[0, 2]))
        update = SurfaceUpdate(p.band, p.cap, path_length, laser.x, laser.y)
        return insert(self.tiles.tiles, poses, view.pieces, update) == 0

    def evaluate(
        self, view: View, owner: int, pose: Floats, counts: BeamCounts
    ) -> tuple[float, float]:
        """Inlier beams in one map, and beams in conflict with `counts`, at a pose (3,)."""
        scale = self._last_scale(view)
        return kernels.evaluate(self.tiles.tiles, owner, view.pieces, pose, scale, counts)

    def _variance(self, view: View) -> float:
        """Variance of a beam's distance [m^2]: at least that of walls and of the map's poses."""
        return max(self._params.range_noise, view.noise) ** 2

    def _beam_information(self, view: View) -> float:
        """Information of a beam's distance [1/m^2], scaled to the `independent` beams."""
        return min(1.0, self._params.independent / view.beams) / self._variance(view)

    def _last_scale(self, view: View) -> float:
        """Robust scale of the last step [m]."""
        return max(self._params.width, ROBUST_SCALE_DEVIATIONS * view.noise)

    def _settings(self, view: View, information: Floats) -> GaussNewton:
        """Settings for a prior's information (3, 3)."""
        p = self._params
        last = self._last_scale(view)
        first, hold_steps = max(p.band * p.resolution, last), 0
        position_information = np.linalg.eigvalsh(information[:2, :2])
        if position_information[0] * last**2 < 1.0:  # the start may be off by the last scale
            hold_steps = p.steps - 1 - math.ceil(math.log2(first / last))
        old_path_length = self._path_length - MIN_LOOP_PATH_LENGTH
        return GaussNewton(first, last, p.steps, self._variance(view), old_path_length, hold_steps)


def _register(target: Posterior, settings: GaussNewton, poses: Floats) -> tuple[Floats, Floats]:
    """Move poses (k, 3) to their peaks in place; information (k, 3, 3) and out (k, 7) there."""
    h, out = np.zeros((len(poses), 3, 3)), np.zeros((len(poses), 7))
    kernels.register(target, settings, poses, h, out)
    return h, out


def _wall_heading(pieces: Floats) -> float:
    """Mode of the normals' headings [rad], modulo right angles, by length of wall; pieces (k, 5).

    The mode, as walls at odd angles would bias a mean. The length, as small things near the laser
    have many beams.
    """
    normals, gaps = np.arctan2(pieces[:, 3], pieces[:, 2]), np.hypot(*np.diff(pieces[:, :2].T))
    lengths, headings = np.where(gaps < MAX_PIECE_GAP, gaps, 0.0), np.radians(np.arange(90.0))
    cosines = np.cos(4.0 * (normals[:-1, None] - headings))
    return float(headings[np.argmax(lengths @ np.exp(HEADING_CONCENTRATION * (cosines - 1.0)))])


def _degenerate_projection(view: View, theta: float) -> Floats:
    """Projection (3, 3) of a pose on the direction that a scan does not observe [Zhang16]."""
    observed = scan_observability(view, theta)
    direction = np.array((observed.x, observed.y, 0.0))
    return (1.0 - observed.share) * np.outer(direction, direction)
