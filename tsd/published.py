"""Registration of the original code: ray cast, RANSAC pre-registration, point-to-point ICP."""

from __future__ import annotations

import numpy as np

from slams.types import Floats, Laser, OccupancyGrid, Pose2, Scan
from tsd.fix import Fix, Start
from tsd.grid import Picture, TsdGrid
from tsd.grid_kernels import Sensor, cast_rays, clear_box, mask_scan
from tsd.icp_kernels import Buckets, Gate, Links, compact, fill_buckets, icp, move
from tsd.params import TsdParams
from tsd.ransac_kernels import (
    BeamModel,
    Scans,
    closest_beams,
    oriented_normals,
    ransac_exp,
    ransac_pdf,
    ransac_tsd,
)

NO_STEP = 1e-6  # between the beams of a laser that has one [rad]
BUCKET = 0.08  # least edge of the buckets for nearest neighbors [m]


class Published:
    """The steps of ohm_tsd_slam on the published grid.

    Args:
        params: parameters; `registration` names the mode.
        rng: source of every random draw.
    """

    def __init__(self, params: TsdParams, rng: np.random.Generator) -> None:
        self._params = params
        self._rng = rng
        self._grid = TsdGrid(params.cell, params.truncation, 2**params.map_size, params.grows)
        self._gate = Gate(params.icp_iterations, params.widest_gate, params.narrowest_gate)
        self._pushes = 0
        self._laser: Laser | None = None

    def see(self, scan: Scan, twist: Pose2) -> int:
        """Mask the scan and place its points; returns how many are valid. Nothing is deskewed."""
        if scan.laser is not self._laser and scan.laser != self._laser:
            self._take(scan.laser)
        p = self._params
        mask_scan(scan.ranges, self._sensor, p.shortest, p.jump_angle, self._ranges, self._mask)
        if scan.laser.angle_increment < 0.0:  # turned around like its angles
            self._ranges[:], self._mask[:] = self._ranges[::-1].copy(), self._mask[::-1].copy()
        self._valid = self._mask & np.isfinite(self._ranges)
        self._scene[:] = np.where(self._valid, self._ranges, 0.0)[:, None] * self._directions
        self._n_scene = compact(self._scene, self._valid, self._moved, self._beam_of_scene)
        return self._n_scene

    def register(self, start: Start) -> Fix:
        """Ray cast from the last pose, pre-register, ICP. Nothing else of `start` is used."""
        pose = np.array(start.pose @ self._mount)
        if cast_rays(self._grid.kernel, pose, self._sensor, self._model, self._model_mask) == 0:
            return Fix.none(start.pose)
        n_model = compact(self._model, self._model_mask, self._buckets.points, self._beam_of_model)
        fill_buckets(self._buckets, n_model)
        motion = self._pre_register(pose)
        move(self._moved, self._n_scene, *motion.tolist())
        pairs = icp(
            self._buckets, n_model, self._moved, self._n_scene, self._gate, self._links, motion
        )
        step = self._mount @ Pose2(*motion.tolist()) @ self._mount.inverse()
        turn = abs(float(np.sin(motion[2])))
        p = self._params
        plausible = np.hypot(*motion[:2]) <= p.max_translation and turn <= np.sin(p.max_rotation)
        share = pairs / max(self._n_scene, 1)
        return Fix(start.pose @ step, bool(plausible), share, np.zeros((3, 3)))

    def push(self, pose: Pose2) -> None:
        """Enter the scan last seen at `pose` of the base."""
        mask = self._mask
        laser = np.array(pose @ self._mount)
        if self._pushes == 0:
            self._free_start(laser)
        else:
            mask = mask | np.isinf(self._ranges)  # nan counts as free space from now on (D8)
        self._pushes += 1
        self._grid.push(laser, self._ranges, mask, self._sensor)

    def occupancy(self) -> OccupancyGrid:
        """The map for the outside."""
        return self._grid.occupancy()

    def picture(self) -> Picture:
        """The field itself."""
        return self._grid.picture()

    def _take(self, laser: Laser) -> None:
        """Memory and constants for a new scanner; clockwise ones are turned around."""
        p, n = self._params, laser.n_beams
        angles = np.sort(laser.angles)
        step = abs(laser.angle_increment) or NO_STEP
        self._laser, self._mount = laser, laser.mount
        self._sensor = Sensor(
            float(angles[0]),
            step,
            0.001,
            p.longest,
            p.low_reflectivity,
            p.max_weight,
            p.weight_unit,
        )
        self._directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self._ranges, self._mask = np.zeros(n), np.zeros(n, np.bool_)
        self._model_mask = np.zeros(n, np.bool_)
        self._scene, self._model, self._moved = (np.zeros((n, 2)) for _ in range(3))
        self._scene_phi, self._model_phi = np.zeros(n), np.zeros(n)
        self._closest = np.zeros((n, 2))
        self._beam_of_scene, self._beam_of_model = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self._links = Links(
            np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n), np.zeros(n), np.zeros((n, 2))
        )
        self._buckets = Buckets(
            np.zeros((256, 256), np.int32),
            np.zeros(n, np.int64),
            np.zeros((n, 2)),
            np.zeros(3),
            BUCKET,
        )

    def _free_start(self, laser: Floats) -> None:
        half, ahead = 0.5 * self._params.footprint, self._params.footprint_offset
        x, y = float(laser[0]) + ahead, float(laser[1])
        clear_box(self._grid.kernel, x - half, y - half, x + half, y + half)

    def _pre_register(self, pose: Floats) -> Floats:
        """Start of the ICP: the best random hypothesis, or no motion."""
        motion = np.zeros(3)
        if self._params.registration == "icp":
            return motion
        scans, control = self._draw()
        if len(control) < 3 or len(scans.trials) < 3:
            return motion
        p, sensor = self._params, self._sensor
        if p.registration == "tsd":
            ransac_tsd(self._grid.kernel, scans, control, pose, p.z_random, motion)
        elif p.registration == "pdf":
            closest_beams(self._model, self._model_mask, sensor.angle_increment, self._closest)
            angles = np.array([sensor.angle_min, sensor.angle_increment])
            ransac_pdf(self._closest, angles, scans, control, self._beam_model(), motion)
        else:
            n_model = int(self._model_mask.sum())
            first, last = self._buckets.points[0], self._buckets.points[n_model - 1]
            frustum = np.array([np.arctan2(first[1], first[0]), np.arctan2(last[1], last[0])])
            phi = self._model_phi[self._beam_of_model]
            ransac_exp(self._buckets, phi, frustum, scans, control, p.hit_distance, motion)
        return motion

    def _draw(self) -> tuple[Scans, Floats]:
        """Random subsets: scene points kept, model points tried, control points that score."""
        p, rng = self._params, self._rng
        oriented_normals(self._model, self._model_mask, self._model_phi)
        oriented_normals(self._scene, self._valid, self._scene_phi)
        share = p.scene_points / max(self._n_scene, 1)
        drawn = rng.random(len(self._mask)) < share if share < 0.99 else True
        kept = self._valid & drawn & np.isfinite(self._scene_phi)
        model = np.flatnonzero(np.isfinite(self._model_phi))
        trials = rng.permutation(model)[: p.trials]
        index = rng.permutation(np.flatnonzero(kept))[: p.control_set]
        control = np.column_stack([self._scene[index], self._scene_phi[index]])
        span = max(int(p.phi_max / self._sensor.angle_increment), 1)
        scans = Scans(
            self._model,
            self._model_phi,
            self._scene,
            self._scene_phi,
            kept,
            trials,
            span,
            p.phi_max,
        )
        return scans, np.ascontiguousarray(control)

    def _beam_model(self) -> BeamModel:
        p = self._params
        return BeamModel(
            p.z_hit,
            p.z_short,
            p.z_max,
            p.z_random,
            p.sigma_hit,
            p.decay_short,
            p.longest,
            p.max_angle,
            p.paired_share,
            p.hit_distance,
        )
