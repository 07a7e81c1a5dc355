"""Scans as drivers record them, brought to the one geometry of a log."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats, Laser, Pose2, Ranges
from slams.validation import MAX_LASER_RANGE

DIRECTION_TOLERANCE = 0.01  # directions that differ by less than this part of a step are the same


def usable(geometry: Laser) -> bool:
    """Whether beams have directions: a step that is one, from an angle that is one."""
    turning = 1e-6 < abs(geometry.angle_increment) < 7.0 or geometry.n_beams == 1
    return geometry.n_beams > 0 and turning and abs(geometry.angle_min) < 100.0


class Sweep(NamedTuple):
    """One sweep as recorded: stamp of the first beam [s], readings (n_beams,) [m], directions.

    Of the geometry all but the mount is what the driver says.
    """

    t: float
    ranges: Ranges
    geometry: Laser


class Mounted(NamedTuple):
    """Where a laser sits: its pose in the base, whether it is upside down, its height z [m]."""

    mount: Pose2
    flipped: bool = False
    z: float = 0.0


class Fan(NamedTuple):
    """All sweeps of one laser: stamps (n,) [s], ranges (n, b) [m], its geometry and mount."""

    t: Floats
    ranges: Ranges
    laser: Laser


def merged(fans: Sequence[Fan]) -> tuple[Floats, Ranges, NDArray[np.intp] | None]:
    """Stamps (n,), ranges (n, b) and numbers of lasers (n,), in the order of stamps.

    The scans of a single laser stay in the order of the file, without numbers.
    """
    if len(fans) == 1:
        return fans[0].t, fans[0].ranges, None
    t, sizes = np.concatenate([fan.t for fan in fans]), [len(fan.t) for fan in fans]
    order, width = np.argsort(t, kind="stable"), max(fan.laser.n_beams for fan in fans)
    wide = [
        np.pad(fan.ranges, ((0, 0), (0, width - fan.laser.n_beams)), constant_values=np.nan)
        for fan in fans
    ]
    return t[order], np.concatenate(wide)[order], np.repeat(np.arange(len(fans)), sizes)[order]


def common(sweeps: Sequence[Sweep], mounted: Mounted, notes: list[str]) -> Fan:
    """All sweeps, in the most common geometry.

    A sweep of another geometry gives each direction its nearest reading, at most half a step away.
    The beams of a laser that is mounted upside down turn the other way round.
    """
    geometry = _most_common(sweeps)
    rows, changed = np.empty((len(sweeps), geometry.n_beams), np.float32), 0
    for row, sweep in zip(rows, sweeps, strict=True):
        if same_directions(sweep.geometry, geometry):
            row[:] = sweep.ranges
        else:
            row[:] = _resampled(sweep, geometry)
            changed += 1
    if changed:
        notes.append(
            f"{changed} of {len(sweeps)} scans have other beams and are resampled to the most "
            f"common {geometry.n_beams}"
        )
    t = np.array([sweep.t for sweep in sweeps])
    range_min, range_max = _limits(geometry, rows, notes)
    sign = -1.0 if mounted.flipped else 1.0
    laser = replace(
        geometry,
        angle_min=sign * geometry.angle_min,
        angle_increment=sign * geometry.angle_increment,
        range_min=range_min,
        range_max=range_max,
        mount=mounted.mount,
        mount_z=mounted.z,
        time_increment=_time_increment(geometry, t, notes),
    )
    return Fan(t, rows, laser)


def _most_common(sweeps: Sequence[Sweep]) -> Laser:
    """The geometry most sweeps have; the drivers' rounding of angles set aside, the first wins."""
    rounded = Counter(_rounded(sweep.geometry) for sweep in sweeps)
    best = rounded.most_common(1)[0][0]
    exact = Counter(sweep.geometry for sweep in sweeps if _rounded(sweep.geometry) == best)
    return exact.most_common(1)[0][0]


def _rounded(geometry: Laser) -> tuple[int, float, float]:
    return geometry.n_beams, round(geometry.angle_min, 4), round(geometry.angle_increment, 6)


def same_directions(a: Laser, b: Laser) -> bool:
    """Whether the beams of both point the same way, drivers' rounding of angles set aside."""
    if a.n_beams != b.n_beams:
        return False
    tolerance = DIRECTION_TOLERANCE * abs(b.angle_increment)
    spread = (a.n_beams - 1) * abs(a.angle_increment - b.angle_increment)
    return abs(a.angle_min - b.angle_min) <= tolerance and spread <= tolerance


def _resampled(sweep: Sweep, target: Laser) -> Ranges:
    """Readings in the target's directions; nan where the sweep has none."""
    source = sweep.geometry
    row = np.full(target.n_beams, np.nan, np.float32)
    if source.n_beams == 1 or target.n_beams == 1:
        return row
    turn = 2.0 * math.pi / abs(source.angle_increment)
    place = (target.angles - source.angle_min) / source.angle_increment
    nearest = np.floor((place + 0.5) % turn).astype(np.intp)  # a whole turn on is the same beam
    inside = nearest < source.n_beams
    row[inside] = sweep.ranges[nearest[inside]]
    return row


def _limits(geometry: Laser, rows: Ranges, notes: list[str]) -> tuple[float, float]:
    """The driver's range limits, or what the readings say where it gives none."""
    low, high = geometry.range_min, geometry.range_max
    if not 0.0 <= low < MAX_LASER_RANGE:
        low = 0.0
    if not low < high <= MAX_LASER_RANGE:
        seen = rows[(rows > low) & (rows < MAX_LASER_RANGE)]
        high = min(float(seen.max()) * 1.001, MAX_LASER_RANGE) if seen.size else low + 1.0
        notes.append(f"range_max is {geometry.range_max:g}; {high:.2f} m are taken instead")
    return low, high


def _time_increment(geometry: Laser, t: Floats, notes: list[str]) -> float:
    """The driver's time from beam to beam, 0 where it cannot be true."""
    increment = geometry.time_increment
    if not math.isfinite(increment) or increment < 0.0:
        return 0.0
    period = float(np.median(np.abs(np.diff(t)))) if len(t) > 1 else math.inf
    if increment * (geometry.n_beams - 1) > 1.5 * period > 0.0:
        notes.append(
            f"time_increment {increment:g} s does not fit a scan every {period:.3g} s; "
            "scans are taken as instantaneous"
        )
        return 0.0
    return increment
