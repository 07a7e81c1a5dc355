"""CARMEN log files (.log, .clf): one message per line, metres and radians, time at the end.

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
from slams.formats.sweep import Mounted, Sweep, common, usable
from slams.scanlog import ScanLog, TimeSeries
from slams.types import Floats, Laser, Pose2, Ranges
from slams.validation import MAX_POSE_VALUE, MAX_STAMP

LASER = re.compile(r"(FLASER|RLASER|RAWLASER\d|ROBOTLASER\d)$")
FRONT = ("ROBOTLASER1", "FLASER", "RAWLASER1")  # one laser's; the first tells most
N_TAIL_WORDS = 3
RANGE_MIN, RANGE_MAX = 0.1, 81.0  # of a SICK, where no line tells it
RIGID_TOLERANCE = 2e-3  # [m, rad] that a laser on its robot seems to move by rounding
NO_RETURN_FREQUENCY = 10  # times as frequent as any reading near it: the code for "nothing seen"


def read(path: Path, options: SourceOptions) -> ScanLog:
    """The scans of one laser with odometry and truth.

    Raises:
        OSError: the file cannot be opened.
        ValueError: no such laser, or a line is not whole; the sentence says which.
    """
    notes: list[str] = []
    text = text_of(path)
    message = _chosen(text, options.scan_topic)
    lines = Lines(message)
    bad = _parse(text, lines, options.salvage)
    if bad:
        notes.append(f"{bad} lines are not whole and left out")
    if not lines.sweeps:
        raise ValueError(f"no {message} line is whole")
    if "\nNEFF " in text:
        notes.append("NEFF lines: the poses of this log are the result of another SLAM")
    t, ranges, laser = common(lines.sweeps, Mounted(_mount(lines, notes)), notes)
    odom, odometry = _odometry(t, lines, options.odom)
    source = {"format": "CARMEN", "file": path.name, "scans": message, "odometry": odometry}
    return ScanLog(
        t,
        ranges,
        replace(laser, range_max=_no_return(ranges, laser)),
        odom=odom,
        truth=_track(lines.truth),
        meta={"name": name_of(path), "source": source},
        notes=tuple(notes),
    )


def laser_messages(text: str) -> dict[str, int]:
    """Laser messages of a log, and how many lines each has."""
    words = Counter(line.split(maxsplit=1)[0] for line in text.split("\n") if line.strip())
    return {word: n for word, n in words.items() if LASER.match(word)}


def _chosen(text: str, wanted: str | None) -> str:
    """The laser message to read: the one asked for, else the front laser, else the only one."""
    counts = laser_messages(text)
    found = ", ".join(f"{name} ({n})" for name, n in sorted(counts.items())) or "none"
    if wanted is not None and wanted not in counts:
        raise ValueError(f"no {wanted} lines; its laser messages: {found}")
    if not counts:
        raise ValueError("no laser lines; expected FLASER, RAWLASER1 or ROBOTLASER1")
    front = [name for name in FRONT if name in counts]
    if wanted is None and not front and len(counts) > 1:
        raise ValueError(f"{len(counts)} lasers, --scan-topic picks one: {found}")
    return wanted or (front or list(counts))[0]


def _parse(text: str, lines: Lines, salvage: bool) -> int:
    """Go through all lines; the number of those that are not whole."""
    bad = 0
    for number, line in enumerate(text.split("\n"), 1):
        words = line.split()
        take = lines.parsers.get(words[0]) if words else None
        if take is None:
            continue
        try:
            take(words)
        except (ValueError, IndexError, OverflowError) as error:
            if not salvage:
                what = f"line {number} ({words[0]}) is not whole; --salvage leaves such lines out"
                raise DamagedError(what) from error
            bad += 1
    return bad


class Lines:
    """What the lines of a log say, by message; `poses` are those of laser and robot, or empty."""

    def __init__(self, message: str) -> None:
        self.message = message
        self.params: dict[str, str] = {}
        self.odom: list[list[float]] = []
        self.truth: list[list[float]] = []
        self.sweeps: list[Sweep] = []
        self.poses: list[tuple[Pose2, Pose2]] = []
        laser = self._old_laser if message in ("FLASER", "RLASER") else self._new_laser
        self.parsers: dict[str, Callable[[list[str]], None]] = {
            "PARAM": self._param,
            "ODOM": lambda words: self.odom.append(_pose_row(words)),
            "TRUEPOS": lambda words: self.truth.append(_pose_row(words)),
            message: laser,
        }

    def number(self, name: str, default: float) -> float:
        """A parameter that is a positive number, or what stands for it."""
        try:
            value = float(self.params[name])
        except (KeyError, ValueError):
            return default
        return value if math.isfinite(value) and value > 0.0 else default

    def _param(self, words: list[str]) -> None:
        if len(words) > 2:  # a parameter can be empty
            self.params[words[1]] = words[2]

    def _old_laser(self, words: list[str]) -> None:
        """FLASER n r1..rn laser pose, robot pose.

        The lines do not tell the angles: the parameters do, or else 180 degrees it is.
        """
        n = int(words[1])
        _expect(n >= 1 and len(words) == 2 + n + 6 + N_TAIL_WORDS)
        usual = 180.0 / max(n - n % 2, 1)  # as a SICK's 180, 181, 360 or 361
        step = self.number("laser_front_laser_resolution", usual)
        if step * (n - 1) > 360.0:  # the parameter is of another laser
            step = usual
        first = -90.0 if step == usual else -0.5 * step * (n - 1)
        high = self.number("robot_front_laser_max", RANGE_MAX)
        geometry = Laser(math.radians(first), math.radians(step), n, RANGE_MIN, high)
        self._take(words, words[2 : 2 + n], geometry, _numbers(words[2 + n : 8 + n]))

    def _new_laser(self, words: list[str]) -> None:
        """RAWLASERn and ROBOTLASERn; the number of words tells what stands at their end.

        That are remissions, or none, and in a ROBOTLASERn the poses of laser and robot.
        """
        n = int(words[8])
        _expect(n >= 1 and len(words) >= 9 + n + N_TAIL_WORDS)
        rest, numbers = words[9 + n : -N_TAIL_WORDS], 11 if words[0].startswith("ROBOT") else 0
        if len(rest) != numbers:
            remissions = int(rest[0])
            _expect(remissions >= 0 and len(rest) == 1 + remissions + numbers)
        poses = _numbers(rest[len(rest) - numbers :][:6])
        first, fov, step, high = _numbers(words[2:6])
        even = fov / (n - 1) if n > 1 else step
        if step <= 0.0 or abs(step - even) * n < 1e-3:  # six decimals are few for a step
            step = even
        self._take(words, words[9 : 9 + n], Laser(first, step, n, RANGE_MIN, high), poses)

    def _take(
        self, words: list[str], readings: list[str], geometry: Laser, poses: list[float]
    ) -> None:
        _expect(usable(geometry))
        with np.errstate(over="ignore"):  # beyond float32 is nothing seen
            ranges = np.array(readings, np.float64).astype(np.float32)
        self.sweeps.append(Sweep(_stamp(words), ranges, geometry))
        if poses:
            self.poses.append((Pose2(*poses[:3]), Pose2(*poses[3:])))


def _pose_row(words: list[str]) -> list[float]:
    """Stamp and first pose of an ODOM or TRUEPOS line."""
    _expect(len(words) == 7 + N_TAIL_WORDS)
    return [_stamp(words), *_numbers(words[1:4])]


def _stamp(words: list[str]) -> float:
    stamp = float(words[-N_TAIL_WORDS])
    _expect(abs(stamp) < MAX_STAMP)
    return stamp


def _numbers(words: list[str]) -> list[float]:
    numbers = [float(word) for word in words]
    _expect(all(abs(number) < MAX_POSE_VALUE for number in numbers))
    return numbers


def _expect(whole: bool) -> None:
    if not whole:
        raise ValueError("the line is not whole")


def _mount(lines: Lines, notes: list[str]) -> Pose2:
    """The laser on the robot: its pose seen from the robot's, where that stays the same."""
    seen = [robot.between(laser) for laser, robot in lines.poses]
    offset = Pose2(lines.number("robot_frontlaser_offset", 0.0), 0.0, 0.0)
    if not seen:
        return offset
    middle = Pose2(*np.median(np.array(seen), axis=0).tolist())
    apart = np.abs([middle.between(pose) for pose in seen])
    if np.median(apart, axis=0).max() > RIGID_TOLERANCE:
        notes.append("laser and robot poses do not move together; the laser is taken at the robot")
        return offset
    return middle


def _odometry(t: Floats, lines: Lines, wanted: str | None) -> tuple[TimeSeries | None, str | None]:
    """The robot's poses in the laser lines, else the ODOM lines; and where they are from."""
    found: dict[str, TimeSeries | None] = {}
    if lines.poses:
        found[lines.message] = TimeSeries(t, np.array(lines.poses)[:, 1])
    if lines.odom:
        found["ODOM"] = _track(lines.odom)
    if wanted not in (None, "none", *found):
        raise ValueError(f"no odometry {wanted}; it has {', '.join(found) or 'none'}")
    name = next(iter(found), "none") if wanted is None else wanted
    return found.get(name), None if name == "none" else name


def _track(rows: list[list[float]]) -> TimeSeries | None:
    table = np.array(rows, np.float64)
    return TimeSeries(table[:, 0].copy(), table[:, 1:].copy()) if rows else None


def _no_return(ranges: Ranges, laser: Laser) -> float:
    """The range limit: the greatest reading, if it is so frequent that it means nothing seen."""
    readings = ranges[np.isfinite(ranges) & (ranges > 0.0)]
    if not readings.size:
        return laser.range_max
    values, counts = np.unique(readings[readings > 0.8 * readings.max()], return_counts=True)
    others = counts[:-1].max() if len(counts) > 1 else 1
    if counts[-1] <= NO_RETURN_FREQUENCY * others or values[-1] <= laser.range_min:
        return laser.range_max
    return min(laser.range_max, float(values[-1]))
