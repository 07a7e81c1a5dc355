"""Registration to the ray cast of the grid: RANSAC pre-registration, then ICP."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slams.types import Floats, Pose2
from tsd.original.map_kernels import Grid, cast_rays
from tsd.original.match_kernels import Buckets, Gate, Links, fill_buckets, icp, move
from tsd.original.params import OriginalParams
from tsd.original.ransac_kernels import Scans, ransac_tsd
from tsd.original.scan import View
from tsd.original.scan_kernels import compact, oriented_normals

BUCKET = 0.08  # least edge of the buckets for nearest neighbors [m]
MOST_BUCKETS = 256  # along an axis
ALL = 0.99  # a share of points from which on all are kept


class Match(NamedTuple):
    """A step of the laser: whether the program accepts it, share of the points with a partner."""

    step: Pose2
    good: bool
    quality: float


NO_MATCH = Match(Pose2(0.0, 0.0, 0.0), False, 0.0)


class Registration:
    """Registers what a view sees; `params.registration` names the mode.

    Args:
        params: parameters.
        rng: source of every random draw.
        view: the scan at hand, looked at anew at every registration.
    """

    def __init__(self, params: OriginalParams, rng: np.random.Generator, view: View) -> None:
        n = view.laser.n_beams
        self._params, self._rng, self._view = params, rng, view
        self._gate = Gate(params.icp_iterations, params.widest_gate, params.narrowest_gate)
        self._model, self._model_mask = np.zeros((n, 2)), np.zeros(n, np.bool_)
        self._scene_phi, self._model_phi = np.zeros(n), np.zeros(n)
        self._beam_of_model = np.zeros(n, np.int64)
        self._links = Links(
            np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n), np.zeros(n), np.zeros((n, 2))
        )
        self._buckets = Buckets(
            np.zeros((MOST_BUCKETS, MOST_BUCKETS), np.int32),
            np.zeros(n, np.int64),
            np.zeros((n, 2)),
            np.zeros(3),
            BUCKET,
        )

    def register(self, grid: Grid, pose: Floats) -> Match:
        """The step from `pose` (3,) of the laser, from where the model scan is cast."""
        view, model, mask = self._view, self._model, self._model_mask
        if cast_rays(grid, pose, view.sensor, model, mask) == 0:
            return NO_MATCH
        n_model = compact(model, mask, self._buckets.points, self._beam_of_model)
        fill_buckets(self._buckets, n_model)
        motion = self._pre_register(grid, pose)
        points, n = view.found, view.n_found
        move(points, n, *motion.tolist())
        pairs = icp(self._buckets, n_model, points, n, self._gate, self._links, motion)
        turn = abs(float(np.sin(motion[2])))
        p = self._params
        plausible = np.hypot(*motion[:2]) <= p.max_translation and turn <= np.sin(p.max_rotation)
        return Match(Pose2(*motion.tolist()), bool(plausible), pairs / max(n, 1))

    def _pre_register(self, grid: Grid, pose: Floats) -> Floats:
        """Start of the ICP: the best random hypothesis, or no motion."""
        motion, p = np.zeros(3), self._params
        if p.registration == "icp":
            return motion
        scans, control = self._draw()
        if len(control) >= 3 and len(scans.trials) >= 3:
            ransac_tsd(grid, scans, control, pose, p.z_random, motion)
        return motion

    def _draw(self) -> tuple[Scans, Floats]:
        """Random subsets: scene points kept, model points tried, control points that score."""
        p, rng, view = self._params, self._rng, self._view
        oriented_normals(self._model, self._model_mask, self._model_phi)
        oriented_normals(view.scene, view.valid, self._scene_phi)
        share = p.scene_points / max(view.n_found, 1)
        drawn = rng.random(len(view.mask)) < share if share < ALL else True
        kept = view.valid & drawn & np.isfinite(self._scene_phi)
        model = np.flatnonzero(np.isfinite(self._model_phi))
        trials = rng.permutation(model)[: p.trials]
        index = rng.permutation(np.flatnonzero(kept))[: p.control_set]
        control = np.column_stack([view.scene[index], self._scene_phi[index]])
        span = max(int(p.phi_max / view.sensor.angle_increment), 1)
        scans = Scans(
            self._model, self._model_phi, view.scene, self._scene_phi, kept, trials, span, p.phi_max
        )
        return scans, np.ascontiguousarray(control)
