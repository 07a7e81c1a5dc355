"""Laser scanners as constants with their source, and what a real one makes of true distances."""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slams.types import Floats, Laser

if TYPE_CHECKING:
    from numpy.random import Generator


@dataclass(frozen=True)
class Sensor:
    """A scanner: fan [rad], scan rate [Hz], limits [m], errors [m].

    The standard deviation of a range is `noise` + `noise_share` times the range; ranges come in
    multiples of `step`. `sweep` is the share of the scan period in which the beams are measured.
    """

    name: str
    n_beams: int
    angle_min: float
    angle_increment: float
    rate: float
    range_min: float
    range_max: float
    noise: float
    noise_share: float
    step: float
    sweep: float
    source: str

    def laser(self, moving: bool = False) -> Laser:
        """The fan's geometry; `moving` beams follow one another in time."""
        return Laser(
            self.angle_min,
            self.angle_increment,
            self.n_beams,
            self.range_min,
            self.range_max,
            time_increment=self.sweep / self.rate / self.n_beams if moving else 0.0,
        )


def _turning(
    name: str, rate: float, limits: tuple[float, float], share: float, source: str
) -> Sensor:
    """A scanner that turns all round in steps of one degree."""
    step = math.radians(1.0)
    return Sensor(name, 360, -math.pi, step, rate, *limits, 0.0, share, 0.001, 1.0, source)


SENSORS = {
    sensor.name: sensor
    for sensor in (
        Sensor(
            "utm30lx",
            n_beams=1081,
            angle_min=-0.75 * math.pi,
            angle_increment=1.5 * math.pi / 1080,
            rate=40.0,
            range_min=0.1,
            range_max=30.0,
            noise=0.01,
            noise_share=0.0,
            step=0.001,
            sweep=1081 / 1440,
            source="Hokuyo UTM-30LX, SCIP 2.0: 1440 steps a turn, steps 0 to 1080, 2400 rpm; data"
            " sheet: +-30 mm below 10 m (taken as 3 sigma)",
        ),
        _turning(
            "rplidar-a1",
            5.5,
            (0.15, 12.0),
            0.005,
            "Slamtec RPLIDAR A1M8 data sheet: 1 deg at 5.5 Hz, error < 1 % (taken as 2 sigma)",
        ),
        _turning(
            "lds01",
            5.0,
            (0.12, 3.5),
            0.0175,
            "Robotis LDS-01 e-manual: 5 Hz, precision +-3.5 % (taken as 2 sigma)",
        ),
        _turning(
            "lds02",
            5.0,
            (0.16, 8.0),
            0.015,
            "Robotis LDS-02 e-manual: 5 Hz, accuracy +-3 % below 6 m (taken as 2 sigma)",
        ),
    )
}


def find_sensor(name: str) -> Sensor:
    """The scanner of that name.

    Raises:
        LookupError: there is none.
    """
    if name in SENSORS:
        return SENSORS[name]
    near = difflib.get_close_matches(name.lower(), SENSORS, 1, 0.4)
    hint = f"; did you mean {near[0]}?" if near else ""
    raise LookupError(f"unknown sensor {name!r}; expected one of {', '.join(SENSORS)}{hint}")


@dataclass(frozen=True)
class Errors:
    """What a scanner does to true distances.

    `noise` [m] + `noise_share` * range is the standard deviation; `step` [m] the rounding, 0 for
    none. `dropout` is the share of beams lost, every other of them reported as "nothing there"
    (inf), the rest as invalid (nan). `mixed` is the share of beams beside an edge that fall
    between the near and the far surface.
    """

    noise: float
    noise_share: float = 0.0
    step: float = 0.001
    dropout: float = 0.0
    mixed: float = 0.0

    def apply(self, distances: Floats, rng: Generator) -> Floats:
        """Ranges (n, b) as measured, from true distances (n, b) [m], inf = nothing."""
        ranges = _mix(distances, self.mixed, rng) if self.mixed else distances.copy()
        if self.noise or self.noise_share:
            deviation = self.noise + self.noise_share * np.where(np.isinf(ranges), 0.0, ranges)
            ranges += deviation * rng.standard_normal(ranges.shape)
        if self.step:
            ranges = np.round(ranges / self.step) * self.step
        if self.dropout:
            chance = rng.random(ranges.shape)
            ranges[chance < self.dropout] = np.nan
            ranges[chance < 0.5 * self.dropout] = np.inf
        return ranges


def _mix(distances: Floats, share: float, rng: Generator) -> Floats:
    """Beams at an edge of more than 0.1 m, by chance, somewhere between the two surfaces."""
    near, far = distances[:, :-1], distances[:, 1:]
    chance, place = rng.random(near.shape), rng.random(near.shape)
    edge = np.isfinite(near) & np.isfinite(far) & (np.abs(far - near) > 0.1) & (chance < share)
    mixed = distances.copy()
    mixed[:, :-1][edge] += (place * (far - near))[edge]
    return mixed
