"""The map as a grid: the best particle's history, ray cast when asked for."""

from __future__ import annotations

import math

import numpy as np

from gmapping.beams import EndPoints
from gmapping.motion import Step
from gmapping.params import GMappingParams
from gmapping.render_kernels import draw
from slams.types import Floats, OccupancyGrid, Pose2, Scan


class Renderer:
    """Keeps the key scans; draws them at whatever poses a particle's history gives them."""

    def __init__(self, params: GMappingParams) -> None:
        self._params = params
        self._points = EndPoints(params.replace(beam_offset=0.0))
        self._scans: list[tuple[Scan, Step]] = []

    def keep(self, scan: Scan, step: Step) -> None:
        """Keep a key scan."""
        self._scans.append((scan, step))

    def grid(self, history: Floats) -> OccupancyGrid:
        """Occupancy of the cells, from hits and visits; 0.5 is the original's threshold."""
        edge = self._params.resolution
        rays = [self._ray(*kept, pose) for kept, pose in zip(self._scans, history, strict=True)]
        ends = [np.zeros((1, 2)), *(points for points, _ in rays), *(s[None] for _, s in rays)]
        cells = np.floor(np.concatenate(ends) / edge + 0.5).astype(np.int64)
        corner, far = cells.min(axis=0), cells.max(axis=0)
        width, height = (far - corner + 1).tolist()
        hits, visits = np.zeros((2, height, width), np.int32)
        for points, sensor in rays:
            draw(points, sensor, edge, corner, hits, visits)
        power = math.log(0.5) / math.log(self._params.occupied)
        with np.errstate(invalid="ignore"):
            p = ((hits / visits) ** power).astype(np.float32)
        x, y = ((corner - 0.5) * edge).tolist()
        return OccupancyGrid(p, edge, (x, y))

    def _ray(self, scan: Scan, step: Step, pose: Floats) -> tuple[Floats, Floats]:
        points, beams = self._points(scan, step)
        base = Pose2(*pose.tolist())
        sensor = base.transform(np.array([[beams.x, beams.y]]))[0]
        return base.transform(points[:, :2]), sensor
