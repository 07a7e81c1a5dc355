"""ScanLog: one recorded drive in memory, and its file format, the npz "scanlog-1".

Keys of the file: `format`; `t` (n,) s, stamp of the first beam; `ranges` (n, b) m; `angle_min`,
`angle_increment` rad; `range_min`, `range_max` m; `time_increment` s per beam; `mount` (3,) pose of
the laser in the base frame; optional `mount_z` m, its height there, and `height` m above the floor;
optional `odom` (k, 3), `truth` (k, 3), `yaw_rate` (k,), `attitude` (k, 2), each with its stamps
`odom_t`, `truth_t`, `yaw_rate_t`, `attitude_t` (default: those of the scans); `meta` JSON text.
Other keys are ignored.

A log of several lasers is a "scanlog-2". Instead of the keys of one laser it has `lasers` (k, 11),
rows of `slams.laser_table.LASER_COLUMNS`, and `laser` (n,), the row of each scan. Rows of `ranges`
end in nan where a laser has fewer beams than another.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slams.formats.npz import read_npz, write_npz
from slams.laser_table import (
    HEIGHT_KEYS,
    LASER_KEYS,
    REQUIRED_KEYS,
    SCANLOG_1,
    SCANLOG_2,
    as_float32,
    laser_fields,
    number_array,
    rep117,
    to_table,
)
from slams.time_series import TimeSeries as TimeSeries
from slams.types import Attitude, Floats, Laser, Pose2, Ranges, Scan
from slams.validation import check_laser, check_series, check_stamps, expect

SERIES_SHAPES = {"odom": (3,), "truth": (3,), "yaw_rate": (), "attitude": (2,)}  # of one value
FILE_KEYS = (
    *("format", *REQUIRED_KEYS, "time_increment", "mount", *HEIGHT_KEYS, "laser", "lasers", "meta"),
    *(key for name in SERIES_SHAPES for key in (name, f"{name}_t")),
)


@dataclass(frozen=True)
class ScanLog:
    """Scans of one or several lasers with other recorded signals; iteration yields `Scan`s.

    `t` (n,) [s]; `ranges` (n, b) float32 [m], inf = nothing up to range_max, nan = not valid.
    `laser` has number 0, `others` follow; `laser_of` (n,) is the number of each scan's laser, None
    for one laser. b is the largest number of beams of a laser. Scans keep the order of the log,
    also where stamps jump back. `notes` are sentences for the user, not saved in a file.
    """

    t: Floats
    ranges: Ranges
    laser: Laser
    odom: TimeSeries | None = None
    truth: TimeSeries | None = None
    yaw_rate: TimeSeries | None = None
    meta: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    attitude: TimeSeries | None = None
    others: tuple[Laser, ...] = ()
    laser_of: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        t, expected = self.t, (len(self.t), max(laser.n_beams for laser in self.lasers))
        expect(t.ndim == 1 and len(t) > 0, "t", t.shape, "(n,) with n >= 1")
        expect(self.ranges.shape == expected, "ranges", self.ranges.shape, f"{expected}")
        check_stamps("t", t)
        for laser in self.lasers:
            check_laser(laser)
        self._check_numbers()
        for key, row in SERIES_SHAPES.items():
            series = getattr(self, key)
            if series is not None:
                given, shape = series.values.shape, (len(series.t), *row)
                expect(given == shape and len(series.t) > 0, key, given, f"{shape}")
                finite = np.nan_to_num(series.values) if key == "attitude" else series.values
                check_series(key, series.t, finite)
        object.__setattr__(self, "ranges", self._cleaned())

    def __len__(self) -> int:
        return len(self.t)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the fields, so that ranges are read-only in another process, too."""
        return ScanLog, tuple(getattr(self, item.name) for item in fields(self))

    def __iter__(self) -> Iterator[Scan]:
        odometry = self.odometry_at_scans()
        yaw = None if self.yaw_rate is None else self.yaw_rate.integral_at(self.t)
        attitudes = self.attitude_at_scans()
        mid_odometry, mid_yaw = self._at_mid_sweeps()
        lasers, numbers = self.lasers, self.numbers.tolist()
        for i, (t, ranges) in enumerate(zip(self.t.tolist(), self.ranges, strict=True)):
            laser = lasers[numbers[i]]
            yield Scan(
                t,
                ranges[: laser.n_beams],
                laser,
                None if odometry is None else Pose2(*odometry[i].tolist()),
                None if yaw is None else float(yaw[i]),
                None if attitudes is None else Attitude(*attitudes[i].tolist()),
                None if mid_odometry is None else Pose2(*mid_odometry[i].tolist()),
                None if mid_yaw is None else float(mid_yaw[i]),
            )

    @property
    def name(self) -> str:
        """The name of the log in its `meta`."""
        return str(self.meta.get("name", "log"))

    @property
    def lasers(self) -> tuple[Laser, ...]:
        """All lasers, by number."""
        return self.laser, *self.others

    @property
    def numbers(self) -> NDArray[np.int64]:
        """The number of each scan's laser (n,)."""
        return np.zeros(len(self), np.int64) if self.laser_of is None else self.laser_of

    def of_one_laser(self) -> ScanLog:
        """The log itself; ValueError if it has several lasers."""
        expect(
            not self.others, self.name, f"{len(self.lasers)} lasers", "one (of a bag: --scan-topic)"
        )
        return self

    @property
    def stamp_jumps(self) -> int:
        """Number of stamps that are earlier than the stamp before them."""
        return int((np.diff(self.t) < 0).sum())

    @property
    def scan_period(self) -> float:
        """Median time between two scans [s]; 0 for a single scan."""
        return float(np.median(np.diff(self.t))) if len(self) > 1 else 0.0

    def odometry_at_scans(self) -> Floats | None:
        """Odometry (n, 3) at each scan; nan where none was recorded."""
        return self._at_scans(self.odom, TimeSeries.poses_at)

    def attitude_at_scans(self) -> Floats | None:
        """Roll and pitch (n, 2) [rad] at each scan; nan where none was measured."""
        return self._at_scans(self.attitude, TimeSeries.attitudes_at)

    def truth_at(self, t: Floats) -> Floats | None:
        """True poses (n, 3) at the stamps t (n,), nan where not covered; None without truth."""
        return None if self.truth is None else self.truth.known_poses_at(np.asarray(t, np.float64))

    def select(self, limit: int | None = None, every: int = 1, odometry: bool = True) -> ScanLog:
        """The first `limit` of every `every`-th scan, with or without odometry and gyro."""
        some = self.rows(slice(None, None if limit is None else limit * every, every))
        return some if odometry else replace(some, odom=None, yaw_rate=None)

    def rows(self, part: slice | NDArray[Any]) -> ScanLog:
        """The scans of a slice, a mask or indices, with signals that have a value per scan."""
        odom, attitude = self._series_rows(self.odom, part), self._series_rows(self.attitude, part)
        t, ranges = self.t[part], self.ranges[part]
        numbers = None if self.laser_of is None else self.laser_of[part]
        return replace(self, t=t, ranges=ranges, odom=odom, attitude=attitude, laser_of=numbers)

    def _check_numbers(self) -> None:
        given = 1 if self.laser_of is None else len(self.lasers)
        expect(given == len(self.lasers), "laser", "no numbers", "that of each scan's laser")
        numbers = self.numbers
        expect(numbers.shape == self.t.shape, "laser", numbers.shape, f"{self.t.shape}")
        valid = bool(((numbers >= 0) & (numbers < len(self.lasers))).all())
        expect(valid, "laser", "numbers of no laser", f"0 to {len(self.lasers) - 1}")

    def _cleaned(self) -> Ranges:
        """The ranges by REP 117, with the limits of each scan's laser."""
        if not self.others:
            return rep117(self.ranges, self.laser)
        clean = as_float32(self.ranges).copy()
        for number, laser in enumerate(self.lasers):
            own = self.numbers == number
            clean[own] = rep117(clean[own], laser)
            clean[own, laser.n_beams :] = np.nan
        clean.flags.writeable = False
        return clean

    def _at_scans(
        self, series: TimeSeries | None, at: Callable[[TimeSeries, Floats], Floats]
    ) -> Floats | None:
        if series is None:
            return None
        same = np.array_equal(series.t, self.t)  # a value per scan, even if stamps jump back
        return series.values if same else at(series, self.t)

    def _at_mid_sweeps(self) -> tuple[Floats | None, Floats | None]:
        """Odometry (n, 3) and yaw (n,) at the middle of the sweeps; None for instantaneous ones."""
        middle = self.t + 0.5 * np.array([one.sweep_time for one in self.lasers])[self.numbers]
        if np.array_equal(middle, self.t):
            return None, None
        odometry = None if self.odom is None else self.odom.poses_at(middle)
        return odometry, None if self.yaw_rate is None else self.yaw_rate.integral_at(middle)

    def _series_rows(
        self, series: TimeSeries | None, part: slice | NDArray[Any]
    ) -> TimeSeries | None:
        if series is None or not np.array_equal(series.t, self.t):
            return series
        return TimeSeries(self.t[part], series.values[part])

    def save(self, path: str | Path) -> None:
        """Write the file, complete or not at all; the same log gives the same bytes."""
        kind = SCANLOG_2 if self.others else SCANLOG_1
        arrays: dict[str, Any] = {"format": kind, "t": self.t, "ranges": self.ranges}
        meta = {"meta": json.dumps(self.meta, sort_keys=True)}
        if self.others:
            arrays |= meta | {"laser": self.numbers, "lasers": to_table(self.lasers)}
        else:
            arrays |= {key: getattr(self.laser, key) for key in LASER_KEYS}
            heights = {"mount_z": self.laser.mount_z or None, "height": self.laser.height}
            arrays |= meta | {key: value for key, value in heights.items() if value is not None}
        for key in SERIES_SHAPES:
            series = getattr(self, key)
            if series is not None:
                arrays |= {key: series.values, f"{key}_t": series.t}
        write_npz(Path(path), arrays)


def load_npz(path: Path | str) -> ScanLog:
    """Read "scanlog-1" or "scanlog-2".

    Raises:
        OSError: the file cannot be opened.
        ValueError: the file is not a complete, valid scan log; one sentence.
    """
    data = read_npz(Path(path), FILE_KEYS)
    try:
        return _from_arrays(data, Path(path).stem)
    except ValueError as error:
        raise ValueError(f"{path}: not a scan log: {error}") from error


def _from_arrays(data: dict[str, Any], stem: str) -> ScanLog:
    version = str(data.get("format", SCANLOG_1))
    required = ("t", "ranges", "laser", "lasers") if version == SCANLOG_2 else REQUIRED_KEYS
    missing = [key for key in required if key not in data]
    expect(not missing, "keys", f"no {', '.join(missing)}", f"{', '.join(required)}")
    expect(version in (SCANLOG_1, SCANLOG_2), "format", version, f"{SCANLOG_1} or {SCANLOG_2}")
    t = number_array(data, "t", 1)
    ranges = as_float32(data["ranges"])
    expect(ranges.ndim == 2, "ranges", f"{ranges.ndim} dimensions", "2")
    signals: dict[str, Any] = {key: _series(data, key, t) for key in SERIES_SHAPES if key in data}
    return ScanLog(
        t=t,
        ranges=ranges,
        **laser_fields(data, ranges.shape[1], version),
        **signals,
        meta={"name": stem} | _meta(data),
    )


def _meta(data: dict[str, Any]) -> dict[str, Any]:
    try:
        meta = json.loads(str(data.get("meta", "{}")))
    except (json.JSONDecodeError, RecursionError):
        meta = None
    expect(isinstance(meta, dict), "meta", "other text", "a JSON object")
    return dict(meta)


def _series(data: dict[str, Any], key: str, t: Floats) -> TimeSeries:
    values = number_array(data, key, 1 + len(SERIES_SHAPES[key]))
    stamps = number_array(data, f"{key}_t", 1) if f"{key}_t" in data else t
    return TimeSeries(stamps, values)
