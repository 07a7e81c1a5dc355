"""CARMEN log files (.log, .clf): one message per line, meters and radians, time at the end.

    PARAM name value
    ODOM x y theta tv rv accel
    TRUEPOS true_x true_y true_theta odom_x odom_y odom_theta
    FLASER n r1..rn  laser_x laser_y laser_theta  robot_x robot_y robot_theta
    RAWLASER1 type start fov step max_range accuracy remission_mode n r1..rn m e1..em
    ROBOTLASER1 as RAWLASER1, then laser pose, robot pose, tv rv forward side turn_axis

Each line ends with `ipc_timestamp host logger_timestamp`. Some ROBOTLASER lines have no remissions.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from slams.formats.options import DamagedError, SourceOptions
from slams.formats.packed import name_of, text_of
from slams.formats.sweep import LaserMount, Sweep, has_directions, resampled
from slams.scanlog import ScanLog, TimeSeries
from slams.types import Floats, Laser, Pose2, Ranges
from slams.validation import MAX_POSE_VALUE, MAX_STAMP

LASER_MESSAGE = re.compile(r"(FLASER|RLASER|RAWLASER\d|ROBOTLASER\d)$")
FRONT_LASERS = ("ROBOTLASER1", "FLASER", "RAWLASER1")  # the same laser; the first has most data
REAR_LASERS = ("ROBOTLASER2", "RLASER", "RAWLASER2")  # look backward
N_TRAILING_WORDS = 3
SICK_RANGE_MIN, SICK_RANGE_MAX = 0.1, 81.0  # m, of a SICK; FLASER lines have none
MOUNT_TOLERANCE = 2e-3  # [m, rad] that a laser on its robot seems to move by rounding
NO_RETURN_FREQUENCY_RATIO = 10  # to any reading near it: so frequent is only the code "no return"


def read(path: Path, options: SourceOptions) -> ScanLog:
    """The scans of one laser with odometry and truth.

    Raises:
        OSError: the file cannot be opened.
        ValueError: no such laser, or a line is incomplete; the sentence names it.
    """
    notes: list[str] = []
    text = text_of(path)
    message = _laser_message(text, options.scan_topic)
    lines = Lines(message)
    n_incomplete = _parse(text, lines, options.salvage)
    if n_incomplete:
        notes.append(f"{n_incomplete} lines are incomplete and left out")
    if not lines.sweeps:
        raise ValueError(f"no {message} line is complete")
    if "\nNEFF " in text:
        notes.append("NEFF lines: the poses of this log are the result of another SLAM")
    t, ranges, laser = resampled(lines.sweeps, LaserMount(_mount(lines, notes)), notes)
    odom, odometry = _odometry(t, lines, options.odom)
    source = {"format": "CARMEN", "file": path.name, "scans": message, "odometry": odometry}
    return ScanLog(
        t,
        ranges,
        replace(laser, range_max=_range_max(ranges, laser)),
        odom=odom,
        truth=_series(lines.truth),
        meta={"name": name_of(path), "source": source},
        notes=tuple(notes),
    )


def laser_messages(text: str) -> dict[str, int]:
    """Number of lines of each laser message in a log."""
    words = Counter(line.split(maxsplit=1)[0] for line in text.split("\n") if line.strip())
    return {word: n for word, n in words.items() if LASER_MESSAGE.match(word)}


def _laser_message(text: str, wanted: str | None) -> str:
    """The laser message to read: the chosen one, else the front laser, else the only one."""
    counts = laser_messages(text)
    found = ", ".join(f"{name} ({n})" for name, n in sorted(counts.items())) or "none"
    if wanted is not None and wanted not in counts:
        raise ValueError(f"no {wanted} lines; its laser messages: {found}")
    if not counts:
        raise ValueError("no laser lines; expected FLASER, RAWLASER1 or ROBOTLASER1")
    front = [name for name in FRONT_LASERS if name in counts]
    if wanted is None and not front and len(counts) > 1:
        raise ValueError(f"{len(counts)} lasers, --scan-topic picks one: {found}")
    return wanted or (front or list(counts))[0]


def _parse(text: str, lines: Lines, salvage: bool) -> int:
    """Parse all lines; gives the number of incomplete ones."""
    n_incomplete = 0
    for number, line in enumerate(text.split("\n"), 1):
        words = line.split()
        take = lines.parsers.get(words[0]) if words else None
        if take is None:
            continue
        try:
            take(words)
        except (ValueError, IndexError, OverflowError) as error:
            if not salvage:
                text = f"line {number} ({words[0]}) is incomplete; --salvage leaves such lines out"
                raise DamagedError(text) from error
            n_incomplete += 1
    return n_incomplete


class Lines:
    """The content of a log's lines by message; `poses` are of laser and robot, or empty."""

    def __init__(self, message: str) -> None:
        self.message = message
        self.params: dict[str, str] = {}
        self.odom: list[list[float]] = []
        self.truth: list[list[float]] = []
        self.sweeps: list[Sweep] = []
        self.poses: list[tuple[Pose2, Pose2]] = []
        laser = self._add_flaser if message in ("FLASER", "RLASER") else self._add_rawlaser
        self.parsers: dict[str, Callable[[list[str]], None]] = {
            "PARAM": self._add_param,
            "ODOM": lambda words: self.odom.append(_pose_row(words)),
            "TRUEPOS": lambda words: self.truth.append(_pose_row(words)),
            message: laser,
        }

    def number(self, name: str, default: float, above: float = 0.0) -> float:
        """A parameter that is a number greater than `above`, else the default."""
        try:
            value = float(self.params[name])
        except (KeyError, ValueError):
            return default
        return value if math.isfinite(value) and value > above else default

    def _add_param(self, words: list[str]) -> None:
        if len(words) > 2:  # a parameter can be empty
            self.params[words[1]] = words[2]

    def _add_flaser(self, words: list[str]) -> None:
        """FLASER n r1..rn laser pose, robot pose.

        The lines have no angles: they come from the parameters, or else are 180 degrees.
        """
        n = int(words[1])
        _expect(n >= 1 and len(words) == 2 + n + 6 + N_TRAILING_WORDS)
        default = 180.0 / max(n - n % 2, 1)  # degrees, for a SICK's 180, 181, 360 or 361 beams
        step = self.number("laser_front_laser_resolution", default)
        if step * (n - 1) > 360.0:  # the parameter is of another laser
            step = default
        first = -90.0 if step == default else -0.5 * step * (n - 1)
        range_max = self.number("robot_front_laser_max", SICK_RANGE_MAX)
        geometry = Laser(math.radians(first), math.radians(step), n, SICK_RANGE_MIN, range_max)
        self._add_sweep(words, words[2 : 2 + n], geometry, _numbers(words[2 + n : 8 + n]))

    def _add_rawlaser(self, words: list[str]) -> None:
        """RAWLASERn and ROBOTLASERn; the number of words decides what follows the readings.

        Remissions may follow, and in a ROBOTLASERn the poses of laser and robot.
        """
        n = int(words[8])
        _expect(n >= 1 and len(words) >= 9 + n + N_TRAILING_WORDS)
        rest, numbers = words[9 + n : -N_TRAILING_WORDS], 11 if words[0].startswith("ROBOT") else 0
        if len(rest) != numbers:
            remissions = int(rest[0])
            _expect(remissions >= 0 and len(rest) == 1 + remissions + numbers)
        poses = _numbers(rest[len(rest) - numbers :][:6])
        first, fov, step, range_max = _numbers(words[2:6])
        fov_step = fov / (n - 1) if n > 1 else step
        if step <= 0.0 or abs(step - fov_step) * n < 1e-3:  # a step of six decimals is imprecise
            step = fov_step
        geometry = Laser(first, step, n, SICK_RANGE_MIN, range_max)
        self._add_sweep(words, words[9 : 9 + n], geometry, poses)

    def _add_sweep(
        self, words: list[str], readings: list[str], geometry: Laser, poses: list[float]
    ) -> None:
        _expect(has_directions(geometry))
        with np.errstate(over="ignore"):  # beyond float32 becomes infinity: no return
            ranges = np.array(readings, np.float64).astype(np.float32)
        self.sweeps.append(Sweep(_stamp(words), ranges, geometry))
        if poses:
            self.poses.append((Pose2(*poses[:3]), Pose2(*poses[3:])))


def _pose_row(words: list[str]) -> list[float]:
    """Stamp and first pose of an ODOM or TRUEPOS line."""
    _expect(len(words) == 7 + N_TRAILING_WORDS)
    return [_stamp(words), *_numbers(words[1:4])]


def _stamp(words: list[str]) -> float:
    stamp = float(words[-N_TRAILING_WORDS])
    _expect(abs(stamp) < MAX_STAMP)
    return stamp


def _numbers(words: list[str]) -> list[float]:
    numbers = [float(word) for word in words]
    _expect(all(abs(number) < MAX_POSE_VALUE for number in numbers))
    return numbers


def _expect(complete: bool) -> None:
    if not complete:
        raise ValueError("the line is incomplete")


def _mount(lines: Lines, notes: list[str]) -> Pose2:
    """The laser's pose on the robot, from the poses of both if it is constant."""
    mounts = [robot.between(laser) for laser, robot in lines.poses]
    side, theta = ("rear", math.pi) if lines.message in REAR_LASERS else ("front", 0.0)
    offset = Pose2(lines.number(f"robot_{side}laser_offset", 0.0, -math.inf), 0.0, theta)
    if not mounts:
        return offset
    median = Pose2(*np.median(np.array(mounts), axis=0).tolist())
    deviations = np.abs([median.between(pose) for pose in mounts])
    if np.median(deviations, axis=0).max() > MOUNT_TOLERANCE:
        notes.append("laser and robot poses do not move together; the laser is taken at the robot")
        return offset
    return median


def _odometry(t: Floats, lines: Lines, wanted: str | None) -> tuple[TimeSeries | None, str | None]:
    """Odometry and its source: the robot's poses in the laser lines, else the ODOM lines."""
    found: dict[str, TimeSeries | None] = {}
    if lines.poses:
        found[lines.message] = TimeSeries(t, np.array(lines.poses)[:, 1])
    if lines.odom:
        found["ODOM"] = _series(lines.odom)
    if wanted not in (None, "none", *found):
        raise ValueError(f"no odometry {wanted}; it has {', '.join(found) or 'none'}")
    name = next(iter(found), "none") if wanted is None else wanted
    return found.get(name), None if name == "none" else name


def _series(rows: list[list[float]]) -> TimeSeries | None:
    table = np.array(rows, np.float64)
    return TimeSeries(table[:, 0].copy(), table[:, 1:].copy()) if rows else None


def _range_max(ranges: Ranges, laser: Laser) -> float:
    """The range limit; a maximum reading that is very frequent is the code for "no return"."""
    readings = ranges[np.isfinite(ranges) & (ranges > 0.0)]
    if not readings.size:
        return laser.range_max
    values, counts = np.unique(readings[readings > 0.8 * readings.max()], return_counts=True)
    others = counts[:-1].max() if len(counts) > 1 else 1
    if counts[-1] <= NO_RETURN_FREQUENCY_RATIO * others or values[-1] <= laser.range_min:
        return laser.range_max
    return min(laser.range_max, float(values[-1]))
