"""Two baselines behind the same protocol: odometry alone, and kiss-icp on planar points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from slams.params import Params, param
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan

KEY_STEP = 0.2  # m, rad: way or turn between two scans drawn into the map


@dataclass(frozen=True)
class BaselineParams(Params):
    """How a baseline's scans become a picture; the pose does not depend on it."""

    resolution: float = param(0.05, "m", "cell of the map", source="hector's", low=0.005)


def hits(scan: Scan) -> Floats:
    """End points (n, 2) [m] of the beams with a return, in the base frame."""
    valid = np.isfinite(scan.ranges)
    points = scan.laser.directions[valid] * scan.ranges[valid, None]
    return scan.laser.mount.transform(points)


class HitMap:
    """A map of end points alone: cells that were hit, the rest never observed.

    Scans are kept and drawn when asked for: a baseline is timed for its poses.
    """

    def __init__(self, params: BaselineParams) -> None:
        self.params = params
        self._keys: list[tuple[Scan, Pose2]] = []

    def insert(self, scan: Scan, pose: Pose2) -> None:
        """Keep a scan for the map, if the robot moved since the last one kept."""
        if self._keys:
            step = self._keys[-1][1].between(pose)
            if math.hypot(step.x, step.y) < KEY_STEP and abs(step.theta) < KEY_STEP:
                return
        self._keys.append((scan, pose))

    def grid(self) -> OccupancyGrid:
        """Hit cells with p = 1, all others nan."""
        resolution = self.params.resolution
        points = [pose.transform(hits(scan)) for scan, pose in self._keys]
        cells = np.floor(np.concatenate([np.zeros((1, 2)), *points]) / resolution).astype(np.int64)
        low = cells.min(axis=0)
        width, height = cells.max(axis=0) - low + 1
        p = np.full((height, width), np.nan, np.float32)
        p[cells[1:, 1] - low[1], cells[1:, 0] - low[0]] = 1.0
        x, y = (low * resolution).tolist()
        return OccupancyGrid(p, resolution, (x, y))


class Odometry:
    """The log's odometry from the first scan on; stands still where there is none."""

    Params: ClassVar[type[Params]] = BaselineParams

    def __init__(self, params: BaselineParams) -> None:
        self._start: Pose2 | None = None
        self._pose = IDENTITY
        self._used = 0
        self._map = HitMap(params)

    def update(self, scan: Scan) -> Pose2:
        """Compose the pose at the first odometry with the way since."""
        if scan.odometry is not None:
            if self._start is None:
                self._start = scan.odometry @ self._pose.inverse()
            self._pose = self._start.between(scan.odometry)
            self._used += 1
        self._map.insert(scan, self._pose)
        return self._pose

    def map(self) -> OccupancyGrid:
        """End points drawn at the odometry's poses."""
        return self._map.grid()

    def report(self) -> dict[str, Any]:
        """How many scans came with odometry; none was looked at."""
        return {"odometry": self._used, "laser": 0}


FINE_VOXEL, COARSE_VOXEL = 0.1, 0.3  # [m] for lasers with many beams and with few
MAX_FINE_INCREMENT = math.radians(0.6)  # [rad] between two beams, up to where the fine one is taken


@dataclass(frozen=True)
class KissParams(BaselineParams):
    """kiss-icp 1.3 set for indoor 2D scans; every value goes in explicitly.

    One voxel does not suit every laser, so the gap between the beams of the first scan chooses one
    of two. On a simulated UTM-30LX (0.25 deg) the fine one has an ATE of 6 mm and the coarse one
    22; of the same log every fourth beam (1 deg) the fine one 154 and the coarse one 20. Intel
    (1 deg) the fine one loses at 4.3 m, the coarse one has 0.20 m. On simulated turning lasers
    (1 deg) in a small arena the fine one would be better: an LDS-01 89 mm for 126, an LDS-02 40
    for 56. CSAIL (0.5 deg, 5 Hz) it loses with every voxel from 0.05 to 1 m.
    """

    voxel: float = param(
        0.0,
        "m",
        "voxel of the map, 0 = by the laser: 0.1 up to 0.6 deg between beams, else 0.3",
        source="ours: fine ones lose sparse scans, coarse ones accuracy",
        low=0.0,
    )


class Kiss:
    """kiss-icp (Vizzo et al. 2023) on the scan's points at z = 0: laser only, one thread.

    A general laser odometry for 3D, set for planar scans by one of two voxels; not tuned further.
    """

    Params: ClassVar[type[Params]] = KissParams

    def __init__(self, params: KissParams) -> None:
        from kiss_icp.kiss_icp import KissICP

        self.params = params
        self._new = KissICP
        self._icp: Any = None
        self._map = HitMap(params)
        self._pose = IDENTITY
        self._empty = 0

    def update(self, scan: Scan) -> Pose2:
        """Register one frame; a scan without a return leaves the pose as it is."""
        points = hits(scan)
        if len(points) == 0:
            self._empty += 1
            return self._pose
        if self._icp is None:
            sparse = abs(scan.laser.angle_increment) > MAX_FINE_INCREMENT
            voxel = self.params.voxel or (COARSE_VOXEL if sparse else FINE_VOXEL)
            self._icp = self._new(_kiss_config(voxel))
        frame = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
        self._icp.register_frame(frame, np.zeros(len(points)))
        T = self._icp.last_pose
        if np.isfinite(T).all():
            self._pose = Pose2(float(T[0, 3]), float(T[1, 3]), math.atan2(T[1, 0], T[0, 0]))
        self._map.insert(scan, self._pose)
        return self._pose

    def map(self) -> OccupancyGrid:
        """End points drawn at kiss-icp's poses."""
        return self._map.grid()

    def report(self) -> dict[str, Any]:
        """How many scans had no return at all."""
        return {"empty": self._empty, "odometry": 0}


def _kiss_config(voxel: float) -> Any:
    """The whole configuration by hand: `KISSConfig()` would read environment variables.

    Five points in a voxel are enough in a plane; the thresholds of kiss-icp are for cars.
    """
    from kiss_icp.config import parser

    return parser.KISSConfig.model_construct(
        out_dir="",
        data=parser.DataConfig(max_range=30.0, min_range=0.0, deskew=False),
        registration=parser.RegistrationConfig(
            max_num_iterations=500, convergence_criterion=1e-4, max_num_threads=1
        ),
        mapping=parser.MappingConfig(voxel_size=voxel, max_points_per_voxel=5),
        adaptive_threshold=parser.AdaptiveThresholdConfig(
            fixed_threshold=None, initial_threshold=0.3, min_motion_th=0.02
        ),
    )
