"""Scans as drivers record them, resampled to the common geometry of a log."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from statistics import median_low
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats, Laser, Pose2, Ranges
from slams.validation import MAX_LASER_RANGE

DIRECTION_TOLERANCE = 0.01  # of the angle increment; closer directions are the same


def has_directions(geometry: Laser) -> bool:
    """Whether there are beams, with a plausible start angle and increment."""
    has_step = 1e-6 < abs(geometry.angle_increment) < 7.0 or geometry.n_beams == 1
    return geometry.n_beams > 0 and has_step and abs(geometry.angle_min) < 100.0


class Sweep(NamedTuple):
    """One sweep as recorded: stamp of the first beam [s], readings (n_beams,) [m], geometry.

    The geometry is the driver's, without the mount.
    """

    t: float
    ranges: Ranges
    geometry: Laser


class LaserMount(NamedTuple):
    """A laser's pose in the base, whether it is upside down, and its height z [m]."""

    pose: Pose2
    flipped: bool = False
    z: float = 0.0


class LaserScans(NamedTuple):
    """All sweeps of one laser: stamps (n,) [s], ranges (n, b) [m], its geometry and mount."""

    t: Floats
    ranges: Ranges
    laser: Laser


def merged(scans: Sequence[LaserScans]) -> tuple[Floats, Ranges, NDArray[np.intp] | None]:
    """Stamps (n,), ranges (n, b) and laser numbers (n,) of all lasers, in the order of stamps.

    The scans of a single laser keep the order of the file and have no numbers.
    """
    if len(scans) == 1:
        return scans[0].t, scans[0].ranges, None
    t, sizes = np.concatenate([one.t for one in scans]), [len(one.t) for one in scans]
    order, width = np.argsort(t, kind="stable"), max(one.laser.n_beams for one in scans)
    padded = [
        np.pad(one.ranges, ((0, 0), (0, width - one.laser.n_beams)), constant_values=np.nan)
        for one in scans
    ]
    return t[order], np.concatenate(padded)[order], np.repeat(np.arange(len(scans)), sizes)[order]


def resampled(sweeps: Sequence[Sweep], mount: LaserMount, notes: list[str]) -> LaserScans:
    """All sweeps in their most common geometry.

    A sweep of another geometry gives each direction the nearest reading within half a step.
    The angles of a laser that is mounted upside down change their sign.
    """
    geometry = _most_common(sweeps)
    rows, changed = np.empty((len(sweeps), geometry.n_beams), np.float32), 0
    for row, sweep in zip(rows, sweeps, strict=True):
        if same_directions(sweep.geometry, geometry):
            row[:] = sweep.ranges
        else:
            row[:] = _readings_at(sweep, geometry)
            changed += 1
    if changed:
        notes.append(
            f"{changed} of {len(sweeps)} scans have other beams and are resampled to the most "
            f"common {geometry.n_beams}"
        )
    t = np.array([sweep.t for sweep in sweeps])
    range_min, range_max = range_limits(geometry, rows, notes)
    sign = -1.0 if mount.flipped else 1.0
    laser = replace(
        geometry,
        angle_min=sign * geometry.angle_min,
        angle_increment=sign * geometry.angle_increment,
        range_min=range_min,
        range_max=range_max,
        mount=mount.pose,
        mount_z=mount.z,
        time_increment=_time_increment(geometry, t, notes),
    )
    return LaserScans(t, rows, laser)


def _most_common(sweeps: Sequence[Sweep]) -> Laser:
    """The most frequent geometry, up to the drivers' rounding of angles; else the first one."""
    rounded = Counter(_rounded(sweep.geometry) for sweep in sweeps)
    best = rounded.most_common(1)[0][0]
    same = [sweep.geometry for sweep in sweeps if _rounded(sweep.geometry) == best]
    increment = median_low([one.time_increment for one in same])  # some drivers measure each sweep
    exact = Counter(replace(one, time_increment=increment) for one in same)
    return exact.most_common(1)[0][0]


def _rounded(geometry: Laser) -> tuple[int, float, float]:
    return geometry.n_beams, round(geometry.angle_min, 4), round(geometry.angle_increment, 6)


def same_directions(a: Laser, b: Laser) -> bool:
    """Whether the beams of both have the same directions, up to the drivers' rounding."""
    if a.n_beams != b.n_beams:
        return False
    tolerance = DIRECTION_TOLERANCE * abs(b.angle_increment)
    spread = (a.n_beams - 1) * abs(a.angle_increment - b.angle_increment)
    return abs(a.angle_min - b.angle_min) <= tolerance and spread <= tolerance


def _readings_at(sweep: Sweep, target: Laser) -> Ranges:
    """Readings (n_beams,) in the target's directions; nan where the sweep has none."""
    source = sweep.geometry
    row = np.full(target.n_beams, np.nan, np.float32)
    if source.n_beams == 1 or target.n_beams == 1:
        return row
    revolution = 2.0 * math.pi / abs(source.angle_increment)
    index = (target.angles - source.angle_min) / source.angle_increment
    nearest = np.floor((index + 0.5) % revolution).astype(np.intp)  # angles repeat after 2 pi
    inside = nearest < source.n_beams
    row[inside] = sweep.ranges[nearest[inside]]
    return row


def range_limits(geometry: Laser, rows: Ranges, notes: list[str]) -> tuple[float, float]:
    """The driver's range limits, or limits from the readings if those are not valid."""
    low, high = geometry.range_min, geometry.range_max
    if not 0.0 <= low < MAX_LASER_RANGE:
        low = 0.0
    if not low < high <= MAX_LASER_RANGE:
        valid = rows[(rows > low) & (rows < MAX_LASER_RANGE)]
        high = min(float(valid.max()) * 1.001, MAX_LASER_RANGE) if valid.size else low + 1.0
        notes.append(f"range_max is {geometry.range_max:g}; {high:.2f} m is used instead")
    return low, high


def _time_increment(geometry: Laser, t: Floats, notes: list[str]) -> float:
    """The driver's time from beam to beam [s], 0 if it is not plausible."""
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
