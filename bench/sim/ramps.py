"""A floor of ramps: attitude of a body on it, and intersection with beams.

Ridges and valleys cross at right angles, as on the crossing ramps of a rescue arena.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.swing import WALL_HEIGHT
from bench.sim.world_kernels import floor_heights, meet_floor
from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

RAMP_LENGTH = 1.2  # m, horizontal, from a valley to the next ridge
WHEEL_OFFSET = 0.2  # m from the middle of the body to its wheels, in x and y


class Ramps:
    """Two crossing triangle waves with random phases; the steepest places have `level` [deg]."""

    def __init__(self, level: float, rng: Generator) -> None:
        self.slope = math.tan(math.radians(level)) / math.sqrt(2.0)
        self.phases = rng.uniform(0.0, 2.0, 2)
        self._waves = np.array((self.slope, RAMP_LENGTH, *self.phases))

    def heights(self, points: Floats) -> Floats:
        """Floor heights (m,) [m] at points (m, 2) [m]; 0 in the lowest valley."""
        out = np.empty(len(points))
        floor_heights(points, self._waves, out)
        return out

    def stand(self, t: Floats, poses: Floats) -> tuple[Floats, Floats]:
        """Roll and pitch (m, 2) [rad] of a body at poses (m, 3), and its base's height (m,) [m]."""
        c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        front = WHEEL_OFFSET * np.stack([c, s], axis=1)
        left = WHEEL_OFFSET * np.stack([-s, c], axis=1)
        wheels = [poses[:, :2] + a * front + b * left for a in (-1, 1) for b in (-1, 1)]
        (rear_right, rear_left, front_right, front_left) = map(self.heights, wheels)
        rise = 0.5 * (front_left + front_right - rear_left - rear_right)
        pitch = -np.arctan2(rise, 2.0 * WHEEL_OFFSET)
        lift = 0.5 * (front_left + rear_left - front_right - rear_right)
        roll = np.arctan2(lift * np.cos(pitch), 2.0 * WHEEL_OFFSET)
        base = 0.25 * (rear_right + rear_left + front_right + front_left)
        return np.stack([roll, pitch], axis=1), base

    def meet(self, rays: Floats, walls: Floats, rise: Floats, height: Floats) -> Floats:
        """Horizontal distances (m,) [m] to the floor, inf beyond the `walls`.

        The rays (m, 3) start at `height` [m] and rise by `rise` for each horizontal meter.
        """
        over = WALL_HEIGHT / np.maximum(np.abs(rise), 1e-9)  # beyond, rays meet no floor
        out = np.empty(len(rays))
        meet_floor(rays, np.minimum(walls, over), rise, height, self._waves, out)
        return out
