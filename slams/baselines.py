"""Two baselines as `slams.types.Slam`: odometry alone, and kiss-icp on planar points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from slams.params import Params, param
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan

MIN_KEYFRAME_MOTION = 0.2  # m, rad between two scans that are drawn into the map


@dataclass(frozen=True)
class BaselineParams(Params):
    """How the map of a baseline is drawn; the poses do not depend on it."""

    resolution: float = param(0.05, "m", "cell of the map", source="hector's", low=0.005)


def hits(scan: Scan) -> Floats:
    """End points (n, 2) [m] of the beams with a return, in the base frame."""
    valid = np.isfinite(scan.ranges)
    points = scan.laser.directions[valid] * scan.ranges[valid, None]
    return scan.laser.mount.transform(points)


class HitMap:
    """A map of end points: hit cells are occupied, all others unobserved.

    Scans are kept and drawn on request, so that the CPU time of a baseline is that of its poses.
    """

    def __init__(self, params: BaselineParams) -> None:
        self.params = params
        self._keyframes: list[tuple[Scan, Pose2]] = []

    def insert(self, scan: Scan, pose: Pose2) -> None:
        """Keep a scan for the map, if the robot has moved since the last kept scan."""
        if self._keyframes:
            step = self._keyframes[-1][1].between(pose)
            if max(math.hypot(step.x, step.y), abs(step.theta)) < MIN_KEYFRAME_MOTION:
                return
        self._keyframes.append((scan, pose))

    def grid(self) -> OccupancyGrid:
        """Hit cells with p = 1, all others nan."""
        resolution = self.params.resolution
        points = [pose.transform(hits(scan)) for scan, pose in self._keyframes]
        cells = np.floor(np.concatenate([np.zeros((1, 2)), *points]) / resolution).astype(np.int64)
        low = cells.min(axis=0)
        width, height = cells.max(axis=0) - low + 1
        p = np.full((height, width), np.nan, np.float32)
        p[cells[1:, 1] - low[1], cells[1:, 0] - low[0]] = 1.0
        x, y = (low * resolution).tolist()
        return OccupancyGrid(p, resolution, (x, y))


class Odometry:
    """The odometry from the first scan on; the pose stays constant without odometry."""

    Params: ClassVar[type[Params]] = BaselineParams

    def __init__(self, params: BaselineParams) -> None:
        self._start: Pose2 | None = None
        self._pose = IDENTITY
        self._used = 0
        self._map = HitMap(params)

    def update(self, scan: Scan) -> Pose2:
        """The motion of the odometry since its first pose."""
        if scan.odometry is not None:
            if self._start is None:
                self._start = scan.odometry @ self._pose.inverse()
            self._pose = self._start.between(scan.odometry)
            self._used += 1
        self._map.insert(scan, self._pose)
        return self._pose

    def map(self) -> OccupancyGrid:
        """End points at the poses of the odometry."""
        return self._map.grid()

    def report(self) -> dict[str, Any]:
        """The number of scans with odometry; 0 scans were matched."""
        return {"odometry": self._used, "laser": 0}


FINE_VOXEL, COARSE_VOXEL = 0.1, 0.3  # m, for small and large beam spacing
MAX_FINE_VOXEL_INCREMENT = math.radians(0.6)  # rad between beams; above it the coarse voxel


@dataclass(frozen=True)
class KissParams(BaselineParams):
    """Parameters of kiss-icp 1.3 for indoor 2D scans; every value is set explicitly.

    No voxel suits every laser: the beam spacing of the first scan selects one of two. ATE with the
    fine and the coarse voxel: 6 and 22 mm on a simulated UTM-30LX (0.25 deg), 154 and 20 mm with
    every fourth beam of the same log (1 deg), 4.3 and 0.20 m on Intel (1 deg), 89 and 126 mm on a
    simulated LDS-01, 40 and 56 mm on an LDS-02 (1 deg, a small arena). CSAIL (0.5 deg, 5 Hz) fails
    with every voxel from 0.05 to 1 m.
    """

    voxel: float = param(
        0.0,
        "m",
        "voxel of the map; 0: 0.1 for beams up to 0.6 deg apart, else 0.3",
        source="ours: sparse scans fail in small voxels, large ones are less accurate",
        low=0.0,
    )


class Kiss:
    """kiss-icp (Vizzo et al. 2023), a 3D laser odometry, on the scan's points at z = 0.

    Laser only, one thread; the voxel is set for planar scans, nothing else is tuned.
    """

    Params: ClassVar[type[Params]] = KissParams

    def __init__(self, params: KissParams) -> None:
        from kiss_icp.kiss_icp import KissICP

        self.params = params
        self._icp_class = KissICP
        self._icp: Any = None
        self._map = HitMap(params)
        self._pose = IDENTITY
        self._empty = 0

    def update(self, scan: Scan) -> Pose2:
        """Register one scan; without any return the pose stays unchanged."""
        points = hits(scan)
        if len(points) == 0:
            self._empty += 1
            return self._pose
        if self._icp is None:
            is_sparse = abs(scan.laser.angle_increment) > MAX_FINE_VOXEL_INCREMENT
            voxel = self.params.voxel or (COARSE_VOXEL if is_sparse else FINE_VOXEL)
            self._icp = self._icp_class(_kiss_config(voxel))
        frame = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
        self._icp.register_frame(frame, np.zeros(len(points)))
        T = self._icp.last_pose
        if np.isfinite(T).all():
            self._pose = Pose2(float(T[0, 3]), float(T[1, 3]), math.atan2(T[1, 0], T[0, 0]))
        self._map.insert(scan, self._pose)
        return self._pose

    def map(self) -> OccupancyGrid:
        """End points at the poses of kiss-icp."""
        return self._map.grid()

    def report(self) -> dict[str, Any]:
        """The number of scans without any return."""
        return {"empty": self._empty, "odometry": 0}


def _kiss_config(voxel: float) -> Any:
    """The complete configuration; `KISSConfig()` would read environment variables.

    Five points in a voxel suffice in a plane. The thresholds of kiss-icp are for cars.
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
