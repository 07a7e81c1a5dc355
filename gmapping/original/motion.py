"""Motion between two scans, by odometry; the program has no input for a gyro."""

from __future__ import annotations

import math

import numpy as np

from gmapping.original.params import OriginalParams
from slams.types import IDENTITY, Floats, Pose2, Scan

MAX_ODOMETRY_STEP = 10.0  # m between two scans; beyond it the odometry has jumped
CROSS_AXIS_NOISE = 0.3  # of the noise by motion along one axis, on the other axis


class Motion:
    """Odometry, where a scan has it."""

    def __init__(self, params: OriginalParams) -> None:
        self.used = {"odometry": 0, "odometry_jumps": 0}
        self._params = params
        self._last: Scan | None = None

    def step(self, scan: Scan) -> Pose2 | None:
        """The motion since the previous scan; None without odometry."""
        last, self._last = self._last, scan
        if last is None:
            return None if scan.odometry is None else IDENTITY
        step = self._odometry(last, scan)
        self.used["odometry"] += step is not None
        return step

    def noise(self, step: Pose2) -> Floats:
        """Standard deviations of a step (3,): [Grisetti07] original code, linear in the step."""
        p = self._params
        x, y, rotation = abs(step.x), abs(step.y), abs(step.theta)
        sideways = p.way_per_turn * rotation
        return np.array(
            [
                p.way_per_way * (x + CROSS_AXIS_NOISE * y) + sideways,
                p.way_per_way * (y + CROSS_AXIS_NOISE * x) + sideways,
                p.turn_per_turn * rotation + p.turn_per_way * math.hypot(x, y),
            ]
        )

    def _odometry(self, last: Scan, scan: Scan) -> Pose2 | None:
        if last.odometry is None or scan.odometry is None:
            return None
        step = last.odometry.between(scan.odometry)
        if math.hypot(step.x, step.y) <= MAX_ODOMETRY_STEP:
            return step
        self.used["odometry_jumps"] += 1
        return None
