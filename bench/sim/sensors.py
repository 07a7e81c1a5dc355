"""Laser scanners as constants with their source."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slams.types import Laser


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

    def half(self) -> Sensor:
        """A scanner of the same kind with a field of view of 180 degrees."""
        n = min(self.n_beams, round(math.pi / abs(self.angle_increment)) + 1)
        step = abs(self.angle_increment)
        first, share = -0.5 * (n - 1) * step, self.sweep * n / self.n_beams
        return replace(self, n_beams=n, angle_min=first, angle_increment=step, sweep=share)

    def laser(self, moving: bool = False) -> Laser:
        """The fan's geometry; `moving` beams are measured one after the other."""
        from slams.types import Laser

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
    """A scanner with a full turn in steps of one degree."""
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
