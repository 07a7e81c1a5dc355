"""View: what of a scan the particles' maps are made of and matched with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gmapping.params import GMappingParams
from gmapping.scan_kernels import Walls, merged, surfaces
from slams.scan.end_points import EndPoints
from slams.types import Floats, Pose2, Scan

GRAZING = 0.1  # cosine; walls seen more edge-on say nothing
RATIO = 0.1  # thickness over length of a wall, squared
SOFT = 3.0  # deviations of the noise that a wall may be thick


class View:
    """The pieces of surface of the scan at hand; the buffers serve every scan.

    `pieces` (n, 5): x, y [m], nx, ny in the base frame at the middle of the sweep, how many beams;
    `beams` of all of them together; `noise` [m] of the ranges; `sweeps` if the beams follow one
    another in time; `mount` of the laser.
    """

    def __init__(self, params: GMappingParams) -> None:
        self._points = EndPoints(params)
        self._params = params
        self._means, self._buffer = np.zeros((0, 3)), np.zeros((0, 5))
        self._n = 0
        self.beams = 0.0

    def take(self, scan: Scan, velocity: Pose2) -> View:
        """Read a scan; `velocity` of the base [m/s, rad/s] takes out the motion of the sweep."""
        ends, p = self._points.take(scan, velocity), self._params
        if ends.n > len(self._buffer):
            self._means, self._buffer = np.zeros((ends.n, 3)), np.zeros((ends.n, 5))
        n = merged(ends.points, ends.n, p.grain, self._means)
        flatness = max(p.flatness, SOFT * ends.noise)
        walls = Walls(max(p.reach, 2.0 * flatness), flatness, RATIO, GRAZING)
        self._n = surfaces(self._means, n, ends.mount, ends.step, walls, self._buffer)
        self.beams = float(self.pieces[:, 4].sum())
        return self

    @property
    def pieces(self) -> Floats:
        """The pieces of surface (n, 5), valid until the next scan."""
        return self._buffer[: self._n]

    @property
    def ends(self) -> NDArray[np.float32]:
        """A copy of the pieces' x, y [m] (n, 2), for the picture of the map."""
        return self.pieces[:, :2].astype(np.float32)

    @property
    def n(self) -> int:
        """How many pieces."""
        return self._n

    @property
    def far(self) -> float:
        """The farthest end from the base [m]."""
        return self._points.far

    @property
    def noise(self) -> float:
        """Noise of the ranges [m]."""
        return self._points.noise

    @property
    def sweeps(self) -> bool:
        """Whether the beams follow one another in time."""
        return self._points.sweeps

    @property
    def mount(self) -> Pose2:
        """Where the laser is on the base."""
        return self._points.mount

    def at_stamp(self, pose: Pose2) -> Pose2:
        """The base's pose at the stamp of the scan that was matched at `pose`."""
        return self._points.at_stamp(pose)
