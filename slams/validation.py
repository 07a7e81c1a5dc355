"""What a recording can say at most: a number beyond that is broken, or of another unit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slams.types import Floats, Laser

LATEST = 2.0**32  # [s] all that a ROS time holds: until the year 2106
FAR = 1e7  # [m, rad, rad/s] nothing drives so far, UTM coordinates included, or turns so fast
LONGEST_RANGE = 1e3  # [m] that a laser sees; drivers write more for "no limit"
LONGEST_SWEEP = 60.0  # [s]
REACH = 100.0  # [m] from a robot's base to its laser
MOST_BEAMS = 1 << 16
PER_SECOND = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
LATELY = 1e8  # [s] since 1970: 1973, before which nobody recorded a laser


def expect(condition: bool, what: str, given: object, expected: str) -> None:
    """Refuse what a log says, in one sentence.

    Raises:
        ValueError: the condition does not hold.
    """
    if not condition:
        raise ValueError(f"{what}: got {given}, expected {expected}")


def check_stamps(what: str, t: Floats) -> None:
    """Refuse stamps (n,), n >= 1, that cannot be seconds.

    Raises:
        ValueError: the sentence names the unit that they look like.
    """
    expect(bool((abs(t) < math.inf).all()), what, "stamps that are not finite", "seconds")
    latest = float(abs(t).max())
    fits = [(n, per) for n, per in PER_SECOND.items() if LATELY < latest / per < LATEST]
    hint = f" (they look like {fits[0][0]}: divide by {fits[0][1]:g})" if fits else ""
    expect(latest < LATEST, what, f"stamps as great as {latest:g}", f"seconds{hint}")


def check_track(what: str, t: Floats, values: Floats) -> None:
    """Refuse poses (n, 3) [m, rad] or rates (n,) [rad/s] that no robot can have.

    Raises:
        ValueError: a value is not finite, or one or a stamp is too great.
    """
    expect(bool((abs(values) < math.inf).all()), what, "values that are not finite", "numbers")
    check_stamps(f"{what}_t", t)
    greatest = float(abs(values).max())
    expect(greatest < FAR, what, f"values as great as {greatest:g}", f"less than {FAR:g}")


def check_laser(laser: Laser) -> None:
    """Refuse a geometry that no laser has.

    Raises:
        ValueError: the sentence names the field.
    """
    numbers: Any = (laser.angle_min, laser.angle_increment, laser.range_min, laser.range_max)
    numbers = (*numbers, laser.time_increment, *laser.mount)
    expect(
        all(map(math.isfinite, numbers)),
        "the laser's geometry",
        numbers,
        "finite numbers",
    )
    beams = f"at least one and at most {MOST_BEAMS}"
    expect(1 <= laser.n_beams <= MOST_BEAMS, "ranges", f"{laser.n_beams} beams", beams)
    expect(abs(laser.angle_min) < 100.0, "angle_min", laser.angle_min, "radians")
    turns = 1e-6 < abs(laser.angle_increment) < 7.0 or laser.n_beams == 1
    step = "a step between the beams in radians, not 0"
    expect(turns, "angle_increment", laser.angle_increment, step)
    limits = (laser.range_min, laser.range_max)
    room = f"0 <= min < max <= {LONGEST_RANGE:g} m"
    expect(0.0 <= limits[0] < limits[1] <= LONGEST_RANGE, "range_min, range_max", limits, room)
    lasts = laser.time_increment * laser.n_beams
    sweep = f">= 0 s, and a sweep of at most {LONGEST_SWEEP:g} s"
    expect(0.0 <= lasts <= LONGEST_SWEEP, "time_increment", laser.time_increment, sweep)
    near = math.hypot(laser.mount.x, laser.mount.y) <= REACH and abs(laser.mount.theta) < FAR
    high = abs(laser.mount_z) <= REACH and (laser.height is None or 0.0 < laser.height <= REACH)
    heights = (laser.mount_z, laser.height)
    expect(high, "mount_z, height", heights, f"at most {REACH:g} m, height > 0")
    expect(near, "mount", tuple(laser.mount), f"at most {REACH:g} m from the base")


def can_be(*values: float) -> bool:
    """Whether a robot on this earth has such a pose, heading or rate; nan and inf are none."""
    return all(abs(value) < FAR for value in values)
