"""Bounds of the numbers in a recording; larger ones are invalid or in another unit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slams.types import Floats, Laser

MAX_STAMP = 2.0**32  # s, the range of a ROS time: the year 2106
MAX_POSE_VALUE = 1e7  # m, rad, rad/s of poses and rates; UTM coordinates are smaller
MAX_LASER_RANGE = 1e3  # m; drivers write larger ones for "no limit"
MAX_SWEEP_TIME = 60.0  # s from the first beam of a scan to the last
MAX_MOUNT_OFFSET = 100.0  # m from the base to a laser
MAX_FAN = 7.0  # rad from the first beam to the last: a revolution and some overlap, not degrees
MAX_BEAMS = 1 << 16
UNITS_PER_SECOND = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
MIN_UNIX_STAMP = 1e8  # s since 1970, the year 1973: before any recording of a laser


def expect(condition: bool, what: str, given: object, expected: str) -> None:
    """Refuse a value of a log or an option, in one sentence.

    Raises:
        ValueError: the condition does not hold.
    """
    if not condition:
        raise ValueError(f"{what}: got {given}, expected {expected}")


def check_stamps(what: str, t: Floats) -> None:
    """Refuse stamps (n,), n >= 1, that cannot be seconds.

    Raises:
        ValueError: the sentence names their probable unit.
    """
    expect(bool((abs(t) < math.inf).all()), what, "stamps that are not finite", "seconds")
    latest = float(abs(t).max())
    units = UNITS_PER_SECOND.items()
    fits = [(unit, n) for unit, n in units if MIN_UNIX_STAMP < latest / n < MAX_STAMP]
    hint = f" (they look like {fits[0][0]}: divide by {fits[0][1]:g})" if fits else ""
    expect(latest < MAX_STAMP, what, f"stamps as great as {latest:g}", f"seconds{hint}")


def check_series(what: str, t: Floats, values: Floats) -> None:
    """Refuse poses (n, 3) [m, rad] or rates (n,) [rad/s] that no robot can have.

    Raises:
        ValueError: a value is not finite, or a value or a stamp is too large.
    """
    expect(bool((abs(values) < math.inf).all()), what, "values that are not finite", "numbers")
    check_stamps(f"{what}_t", t)
    greatest = float(abs(values).max())
    given = f"values as great as {greatest:g}"
    expect(greatest < MAX_POSE_VALUE, what, given, f"less than {MAX_POSE_VALUE:g}")


def check_laser(laser: Laser) -> None:
    """Refuse an impossible geometry of a laser.

    Raises:
        ValueError: the sentence names the field.
    """
    numbers: Any = (laser.angle_min, laser.angle_increment, laser.range_min, laser.range_max)
    numbers = (*numbers, laser.time_increment, *laser.mount)
    expect(all(map(math.isfinite, numbers)), "the laser's geometry", numbers, "finite numbers")
    beams = f"at least one and at most {MAX_BEAMS}"
    expect(1 <= laser.n_beams <= MAX_BEAMS, "ranges", f"{laser.n_beams} beams", beams)
    expect(abs(laser.angle_min) < 100.0, "angle_min", laser.angle_min, "radians")
    step, n = abs(laser.angle_increment), laser.n_beams
    valid = n == 1 or (step > 1e-6 and step * (n - 1) < MAX_FAN)
    fan = f"a step between the beams in radians, not 0, and a fan below {MAX_FAN:g} rad"
    expect(valid, "angle_increment", laser.angle_increment, fan)
    limits = (laser.range_min, laser.range_max)
    bounds = f"0 <= min < max <= {MAX_LASER_RANGE:g} m"
    expect(0.0 <= limits[0] < limits[1] <= MAX_LASER_RANGE, "range_min, range_max", limits, bounds)
    duration = laser.time_increment * laser.n_beams
    sweep = f">= 0 s, and a sweep of at most {MAX_SWEEP_TIME:g} s"
    expect(0.0 <= duration <= MAX_SWEEP_TIME, "time_increment", laser.time_increment, sweep)
    most = MAX_MOUNT_OFFSET
    near = math.hypot(laser.mount.x, laser.mount.y) <= most
    high = abs(laser.mount_z) <= most and (laser.height is None or 0.0 < laser.height <= most)
    heights = (laser.mount_z, laser.height)
    expect(high, "mount_z, height", heights, f"at most {most:g} m, height > 0")
    near = near and abs(laser.mount.theta) < MAX_POSE_VALUE
    expect(near, "mount", tuple(laser.mount), f"at most {most:g} m from the base")


def is_plausible(*values: float) -> bool:
    """Whether numbers of a pose, heading or rate are finite and below `MAX_POSE_VALUE`."""
    return all(abs(value) < MAX_POSE_VALUE for value in values)
