"""Measurements of a sensor on a drive through the world."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from bench.sim.drive import Drive
from bench.sim.people import LEG_RADIUS, legs
from bench.sim.ramps import Ramps
from bench.sim.range_errors import Errors
from bench.sim.rays import SCANS_PER_BLOCK, rays_of
from bench.sim.sensors import Sensor
from bench.sim.setting import Setting
from bench.sim.swing import LASER_HEIGHT, Swing, ranges_of, rise, sway
from bench.sim.world import World
from slams import cli
from slams.types import Floats, Ranges

if TYPE_CHECKING:
    from numpy.random import Generator


class Measuring:
    """The sensor on its drive."""

    def __init__(
        self,
        setting: Setting,
        sensor: Sensor,
        world: World,
        true: Drive,
        chance: dict[str, Generator],
        body: Swing | Ramps | None,
    ) -> None:
        self.world, self.true, self.rng, self.sensor = world, true, chance["ranges"], sensor
        self.laser, self.body = sensor.laser(setting.sweep), body
        if body is not None:
            self.laser = dataclasses.replace(self.laser, mount_z=LASER_HEIGHT)
        self.errors = errors_of(setting, sensor, world)
        self.legs = legs(world, true, setting.people, chance["people"]) if setting.people else None

    def scans(self, t: Floats, quiet: bool) -> Ranges:
        """Ranges (n, b) [m] from the stamps t (n,) on; with a progress bar unless `quiet`."""
        ranges = np.empty((len(t), self.laser.n_beams), np.float32)
        starts = range(0, len(t), SCANS_PER_BLOCK)
        for start in cli.progress(starts, len(starts), "simulating", quiet, unit="block"):
            block = t[start : start + SCANS_PER_BLOCK]
            distances = self._distances(block).reshape(len(block), -1)
            ranges[start : start + SCANS_PER_BLOCK] = self.errors.apply(distances, self.rng)
        return ranges

    def _distances(self, t: Floats) -> Floats:
        """True distances (n * b,) [m], each beam at its own time and pose."""
        delays = self.laser.time_increment * np.arange(self.laser.n_beams)
        stamps = (t[:, None] + delays).ravel()
        rays = self.true.poses_at(stamps)
        if self.body is None:
            return self._cast(rays_of(self.laser, rays.reshape(len(t), -1, 3)), stamps)
        directions = np.tile(self.laser.directions, (len(t), 1))
        attitudes, base = self.body.stand(stamps, rays)
        along, rotation, slope = rise(directions, attitudes)
        height = base + sway(rays, attitudes)
        rays[:, 2] += np.tile(self.laser.angles, len(t)) + rotation
        walls = self._cast(rays, stamps)
        max_ranges = np.minimum(walls, self.laser.range_max)
        floor = self.body.meet(rays, max_ranges, slope / along, height)
        return ranges_of(walls, floor, along, slope, height)

    def _cast(self, rays: Floats, stamps: Floats) -> Floats:
        """Distances (m,) [m] over ground along rays (..., 3) to walls and legs."""
        rays = np.ascontiguousarray(rays.reshape(-1, 3))
        distances = self.world.cast(rays)
        if self.legs is not None:
            from bench.sim.world_kernels import occlude

            now = np.round(stamps / self.true.t[1]).astype(np.int32)
            occlude(rays, np.minimum(now, len(self.legs) - 1), self.legs, LEG_RADIUS, distances)
        return distances


def errors_of(setting: Setting, sensor: Sensor, world: World) -> Errors:
    """Range errors of the sensor, or those of the setting."""
    noise, share, step = sensor.noise, sensor.noise_share, sensor.step
    if setting.stdr:
        noise, share, step = 0.0, 0.0, world.resolution
    if setting.noise is not None:
        noise, share = setting.noise, 0.0
    return Errors(noise, share, step, setting.dropout)
