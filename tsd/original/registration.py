"""Registration to a model scan cast from the grid: RANSAC pre-registration, then ICP."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import KDTree

from slams.types import Floats, Pose2
from tsd.original.map_kernels import Grid, cast_rays
from tsd.original.match_kernels import Scans, closed_form, move, ransac_tsd
from tsd.original.params import OriginalParams
from tsd.original.scan import View
from tsd.original.scan_kernels import Ints, oriented_normals

KEEP_ALL_RATIO = 0.99  # of points to keep; from there on all points are kept


class Registration:
    """Registers the scan of a view; `params.registration` is the mode.

    Args:
        params: parameters.
        rng: source of every random draw.
        view: buffers of the present scan, read at every registration.
    """

    def __init__(self, params: OriginalParams, rng: np.random.Generator, view: View) -> None:
        n = view.laser.n_beams
        self._params, self._rng, self._view = params, rng, view
        self._model, self._model_mask = np.zeros((n, 2)), np.zeros(n, np.bool_)
        self._scene_phi, self._model_phi = np.zeros(n), np.zeros(n)

    def register(self, grid: Grid, pose: Floats) -> Pose2 | None:
        """Motion since `pose` (3,) of the laser, where the model scan is cast; None if rejected."""
        view, model, mask = self._view, self._model, self._model_mask
        if cast_rays(grid, pose, view.sensor, model, mask) == 0:
            return None
        start = Pose2(*self._pre_register(grid, pose).tolist())
        step, p = self._icp(model[mask], view.scene[view.valid], start), self._params
        rotation = abs(math.sin(step.theta))
        valid = math.hypot(step.x, step.y) <= p.max_translation
        return step if valid and rotation <= math.sin(p.max_rotation) else None

    def _icp(self, model: Floats, scene: Floats, motion: Pose2) -> Pose2:
        """Motion of the scene (n, 2) onto the model (m, 2) by ICP from a start.

        Original code: the gate shrinks by a ratio for distances, which is applied to their squares.
        """
        p, tree = self._params, KDTree(model)
        gate2, floor = p.widest_gate**2, p.narrowest_gate**2
        ratio = (p.narrowest_gate / p.widest_gate) ** (1.0 / max(p.icp_iterations - 11, 1))
        move(scene, motion)
        for _ in range(p.icp_iterations):
            paired, partners = reciprocal_pairs(tree, scene, math.sqrt(gate2))
            if len(paired) <= 2:
                break
            step = Pose2(*closed_form(model[paired], scene[partners]))
            move(scene, step)
            motion = step @ motion
            gate2 = max(gate2 * ratio, floor)
        return motion

    def _pre_register(self, grid: Grid, pose: Floats) -> Floats:
        """Start of the ICP: the best hypothesis of RANSAC, or no motion."""
        motion, p = np.zeros(3), self._params
        if p.registration == "icp":
            return motion
        scans, control = self._draw()
        if len(control) >= 3 and len(scans.trials) >= 3:
            ransac_tsd(grid, scans, control, pose, p.z_random, motion)
        return motion

    def _draw(self) -> tuple[Scans, Floats]:
        """Random subsets: scene points to keep, model points to try, control points to score."""
        p, rng, view = self._params, self._rng, self._view
        oriented_normals(self._model, self._model_mask, self._model_phi)
        oriented_normals(view.scene, view.valid, self._scene_phi)
        share = p.scene_points / max(int(view.valid.sum()), 1)
        drawn = rng.random(len(view.mask)) < share if share < KEEP_ALL_RATIO else True
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


def reciprocal_pairs(tree: KDTree, scene: Floats, gate: float) -> tuple[Ints, Ints]:
    """Indices of paired model points, and of the scene point of each.

    Original code: nearest neighbor within the gate [m]; "reciprocal": one pair per model point.
    """
    found = tree.query(scene, distance_upper_bound=gate)
    distance, nearest = (np.asarray(values) for values in found)
    closest_first = np.argsort(distance, kind="stable")[: np.isfinite(distance).sum()]
    paired, first = np.unique(nearest[closest_first], return_index=True)
    return paired, closest_first[first]
