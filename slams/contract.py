"""Checks of the contract of `slams.types.Slam`, one a clause, on simulated scans of a room."""

from __future__ import annotations

import math
import traceback
import typing
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from slams.registry import Entry
from slams.scanlog import ScanLog
from slams.test_world import drive, laser, odd_scans, scan_at
from slams.types import IDENTITY, OccupancyGrid, Pose2, Scan, Slam, State

N_CHECK_SCANS = 12  # of a log, enough to map a part of the room
FRAME_TOLERANCE = 1e-6  # m, rad by which a pose may differ: rounding

Clause = Callable[[Entry], None]  # raises BrokenContractError if the clause is broken


class BrokenContractError(Exception):
    """A broken clause, described in one sentence."""


def broken(entry: Entry, clause: Clause) -> str | None:
    """The error in one sentence, or None if the clause holds."""
    try:
        clause(entry)
    except BrokenContractError as error:
        return str(error)
    except Exception as error:  # an algorithm of a user may raise anything
        return _raised(error)
    return None


def _raised(error: Exception) -> str:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    what = f"raised {type(error).__name__}: {error}"
    return f"{' '.join(what.split())[:200]} ({Path(frame.filename).name}:{frame.lineno})"


def _expect(condition: bool, sentence: str) -> None:
    if not condition:
        raise BrokenContractError(sentence)


def _new(entry: Entry) -> Slam:
    return entry.cls(entry.params())


def _log() -> ScanLog:
    """A new log each time, as an algorithm may write to its scans."""
    return drive(n=N_CHECK_SCANS)


def _pose(slam: Slam, scan: Scan) -> tuple[float, ...]:
    pose = slam.update(scan)
    _expect(isinstance(pose, Pose2), f"update returned {pose!r}, expected a Pose2")
    return tuple(pose)


def _poses(slam: Slam, scans: Iterable[Scan]) -> list[tuple[float, ...]]:
    return [_pose(slam, scan) for scan in scans]


def _reports_from_the_start(entry: Entry) -> None:
    report = _new(entry).report()
    _expect(isinstance(report, dict), "report() before the first scan is not a dict")


def _starts_at_the_origin(entry: Entry) -> None:
    pose = _pose(_new(entry), next(iter(_log())))
    _expect(pose == IDENTITY, f"the first pose is {pose}, expected Pose2(0, 0, 0)")


def _stays_finite(entry: Entry) -> None:
    odd = {kind: [scan] for kind, scan in odd_scans().items()}
    odd["all"] = [scan for scans in odd.values() for scan in scans]
    poses = [Pose2(0.01 * k, 0.0, 0.0) for k in range(3)]
    good = [scan_at(at, t=0.05 * k, odometry=at, yaw=0.0) for k, at in enumerate(poses)]
    for kind, scans in odd.items():
        streams = {"later": [*good, *scans, *good], "first": [*scans, *good], "alone": scans}
        for when, stream in streams.items():
            _expect_finite(entry, stream, f"{kind} {when}")


def _expect_finite(entry: Entry, scans: list[Scan], kind: str) -> None:
    slam = _new(entry)
    for scan in scans:
        try:
            pose = _pose(slam, scan)
        except BrokenContractError:
            raise
        except Exception as error:
            raise BrokenContractError(f"{_raised(error)} [scans: {kind}]") from error
        _expect(all(map(math.isfinite, pose)), f"the pose is {pose} [scans: {kind}]")
        _expect_confidence(slam, kind)
    grid = slam.map()
    _expect(isinstance(grid, OccupancyGrid), f"map() is no OccupancyGrid [scans: {kind}]")
    _expect(grid.p.size > 0, f"map() has no cell [scans: {kind}]")


def _expect_confidence(slam: typing.Any, kind: str) -> None:
    """State, quality and covariance of the last pose, if the algorithm has them."""
    if not all(hasattr(slam, name) for name in ("state", "quality", "covariance")):
        return
    state, quality, covariance = slam.state, slam.quality, slam.covariance
    states = typing.get_args(State)
    _expect(state in states, f"state is {state!r}, expected one of {', '.join(states)}")
    _expect(0.0 <= quality <= 1.0, f"quality is {quality}, expected 0 to 1 [scans: {kind}]")
    deviations = [float(covariance[i, i]) for i in range(3)]
    _expect(min(deviations) > 0.0, f"covariance has {deviations}, expected > 0 [scans: {kind}]")


def _writes_nothing(entry: Entry) -> None:
    scans = list(_log())
    _poses(_new(entry), scans)
    same = all(
        np.array_equal(scan.ranges, before.ranges, equal_nan=True)
        for scan, before in zip(scans, _log(), strict=True)
    )
    _expect(same, "the ranges of a scan changed")


def _repeats(entry: Entry) -> None:
    first, second = _poses(_new(entry), _log()), _poses(_new(entry), _log())
    index = next((i for i, (a, b) in enumerate(zip(first, second, strict=True)) if a != b), None)
    if index is not None:
        raise BrokenContractError(
            f"scan {index} of the same log got {first[index]}, then {second[index]}"
        )


def _runs_without_odometry(entry: Entry) -> None:
    slam = _new(entry)
    _poses(slam, _log().select(odometry=False))
    used = slam.report().get("odometry")
    _expect(used == 0, f"report()['odometry'] is {used!r} after scans without odometry, expected 0")


def _shares_nothing(entry: Entry) -> None:
    alone = _poses(_new(entry), _log())
    first, second = _new(entry), _new(entry)
    together = []
    for scan, other in zip(_log(), reversed(list(_log())), strict=True):
        together.append(tuple(first.update(scan)))
        second.update(other)
    _expect(together == alone, "a second instance changed the poses of the first")


def _takes_any_odom_frame(entry: Entry) -> None:
    poses = np.array(_poses(_new(entry), _log()))
    for motion in (Pose2(-7.0, 4.0, 2.0), Pose2(3.0, 1.0, 0.5)):
        moved = [
            Scan(s.t, s.ranges, s.laser, motion @ (s.odometry or motion), (s.yaw or 0.0) + 2.0)
            for s in _log()
        ]
        worst = float(np.abs(np.array(_poses(_new(entry), moved)) - poses).max())
        _expect(
            worst < FRAME_TOLERANCE,
            f"another odom frame moves a pose by {worst:.2g} (m or rad)",
        )


def _takes_a_changing_laser(entry: Entry) -> None:
    lasers = (laser(181), laser(361))
    scans = [scan_at((0.02 * k, 0.0, 0.0), lasers[k % 2], t=0.05 * k) for k in range(6)]
    _expect_finite(entry, scans, "181 and 361 beams by turns")


def _maps_in_the_first_frame(entry: Entry) -> None:
    slam = _new(entry)
    _poses(slam, _log())
    grid = slam.map()
    p = grid.p
    whole = p.ndim == 2 and p.size > 0 and p.dtype == np.float32
    _expect(whole, f"map().p is {p.dtype} {p.shape}, expected float32 (ny, nx) with cells")
    _expect(grid.resolution > 0.0, f"map().resolution is {grid.resolution}")
    observed = p[~np.isnan(p)]
    _expect(observed.size > 0, f"map() has no observed cell after {N_CHECK_SCANS} scans of a room")
    _expect(
        observed.min() >= 0.0 and observed.max() <= 1.0, "map().p is not in 0..1 where observed"
    )
    (x, y), (height, width) = grid.origin, p.shape
    inside = x < 0.0 < x + width * grid.resolution and y < 0.0 < y + height * grid.resolution
    _expect(inside, f"the first pose is not on the map: origin {grid.origin}, {width} x {height}")


CLAUSES: dict[str, Clause] = {
    "0 it reports from the start": _reports_from_the_start,
    "1 the first pose is the origin": _starts_at_the_origin,
    "2 every pose is finite, whatever the scans contain": _stays_finite,
    "3 nothing of a scan is written to": _writes_nothing,
    "4 same scans, same poses, bit for bit": _repeats,
    "5 it runs without odometry and reports what it used": _runs_without_odometry,
    "6 two instances do not disturb each other": _shares_nothing,
    "7 the odom frame is arbitrary": _takes_any_odom_frame,
    "8 a changing laser is handled": _takes_a_changing_laser,
    "9 the map has observed cells, in the frame of the first scan": _maps_in_the_first_frame,
}
