"""Consistency of a run with its own scans and with other runs: measures without a ground truth.

- walls: the area of all cells that contain end points, drawn at the run's poses. It grows with
  every blurred or doubled wall, as the entropy of a map does (Stachniss, Grisetti and Burgard
  2005). Runs of one log are compared by the ratio to the least area.
- revisits: at a revisited place, ICP with point-to-line distances (Censi 2008) registers the later
  scan to the earlier ones, starting from the run's poses. The correction is the drift in between.
- conflicts: share of the scan that does not agree with the algorithm's own map (`quality`).
- disagreement: distance of the run from the others on the same log, each aligned to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.registration import Reference, register
from bench.sim.rays import ends_of, rays_of
from slams.metrics import ate, driven
from slams.time_series import TimeSeries
from slams.types import Floats

if TYPE_CHECKING:
    from slams.scanlog import ScanLog

MAX_DRAWN_SCANS = 1000  # of a log, evenly spread
WALL_CELL_SIZE = 0.05  # m, as in the algorithms' maps
MIN_WALL_HITS = 2  # returns in a cell of a wall; a single one may be noise or a person
MAX_REVISITS = 60  # of a log, evenly spread
MAX_REVISIT_DISTANCE = 1.0  # m between the poses of a revisit
MIN_REVISIT_TIME, MIN_REVISIT_PATH = 20.0, 5.0  # s, m of path between these poses
N_NEIGHBOR_SCANS = 2  # before and after the earlier pose, used for the registration
MIN_NEIGHBOR_DISTANCE = 0.1  # m between these scans
UNREGISTERED_ERROR = 0.5  # m, if ICP fails: its largest pairing radius
MIN_SHARED_STAMPS = 10  # of two runs, to compare them


class Consistency(NamedTuple):
    """Wall area [m2]; mean error at revisits [m], None without any; number of revisits."""

    walls_m2: float
    revisits_m: float | None
    revisits: int


def consistency(log: ScanLog, poses: Floats) -> Consistency:
    """Wall area and revisits of a run; poses (n, 3) at the log's scans, nan for missing ones."""
    known = np.flatnonzero(np.isfinite(poses).all(axis=1))
    chosen = known[:: max(1, -(-len(known) // MAX_DRAWN_SCANS))]
    walls = wall_area(points_at(log, poses, chosen))
    errors = revisit_errors(log, poses, known)
    return Consistency(walls, float(errors.mean()) if len(errors) else None, len(errors))


def points_at(log: ScanLog, poses: Floats, scans: NDArray[np.int64]) -> Floats:
    """End points (m, 2) [m] of some scans at the run's poses, in the order of the beams."""
    rays = rays_of(log.laser, _beam_poses(log, poses, scans))
    ranges = log.ranges[scans].astype(np.float64)
    hit = np.isfinite(ranges)
    return ends_of(rays, np.where(hit, ranges, 0.0))[hit]


def _beam_poses(log: ScanLog, poses: Floats, scans: NDArray[np.int64]) -> Floats:
    """Poses (n, 3), or of each beam (n, b, 3) of a turning laser, at constant velocity."""
    if not log.laser.time_increment or len(poses) < 2:
        return poses[scans]
    after = np.minimum(scans + 1, len(poses) - 1)
    step = poses[after] - poses[after - 1]
    step[:, 2] = (step[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    step = np.nan_to_num(step / max(log.scan_period, 1e-3))
    delays = log.laser.time_increment * np.arange(log.laser.n_beams)
    return np.asarray(poses[scans][:, None] + delays[None, :, None] * step[:, None])


def wall_area(points: Floats) -> float:
    """Area [m2] of the cells in which at least `MIN_WALL_HITS` of the points (m, 2) lie."""
    if not len(points):
        return 0.0
    cells = np.floor(points / WALL_CELL_SIZE).astype(np.int64)
    _, counts = np.unique(cells[:, 0] * 2**31 + cells[:, 1], return_counts=True)
    return float(WALL_CELL_SIZE**2 * (counts >= MIN_WALL_HITS).sum())


def revisit_errors(log: ScanLog, poses: Floats, known: NDArray[np.int64]) -> Floats:
    """Error [m] at each of at most `MAX_REVISITS` revisited places."""
    now, then = revisits(log.t[known], poses[known])
    chosen = np.unique(np.linspace(0, len(now) - 1, min(MAX_REVISITS, len(now))).astype(int))
    path = driven(poses[known])
    errors = []
    for k in chosen:
        steps = np.arange(-N_NEIGHBOR_SCANS, N_NEIGHBOR_SCANS + 1)
        places = path[then[k]] + MIN_NEIGHBOR_DISTANCE * steps
        neighbors = np.unique(np.clip(np.searchsorted(path, places), 0, len(known) - 1))
        target = Reference([points_at(log, poses, known[[j]]) for j in neighbors])
        scan = points_at(log, poses, known[[now[k]]])
        moved = register(scan, target, poses[known[now[k]], :2])
        if moved is not None:
            errors.append(min(moved, UNREGISTERED_ERROR))
    return np.array(errors)


def revisits(t: Floats, poses: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices (k,), (k,) of poses (n, 3) and, for each, of its earliest revisited pose."""
    from scipy.spatial import KDTree

    path, tree = driven(poses), KDTree(poses[:, :2])
    places = np.unique(np.searchsorted(path, np.arange(0.0, path[-1], 0.5)))
    now, then = [], []
    for k in places[places < len(poses)].tolist():
        near = np.sort(tree.query_ball_point(poses[k, :2], MAX_REVISIT_DISTANCE))
        near = near[(path[k] - path[near] > MIN_REVISIT_PATH) & (t[k] - t[near] > MIN_REVISIT_TIME)]
        if len(near):
            first = near[path[near] < path[near[0]] + 2.0 * MAX_REVISIT_DISTANCE]
            gap = np.hypot(*(poses[first, :2] - poses[k, :2]).T)
            now.append(k)
            then.append(int(first[np.argmin(gap)]))
    return np.array(now, np.int64), np.array(then, np.int64)


def disagreements(runs: Sequence[tuple[Floats, Floats]]) -> list[float | None]:
    """Median distance [m] of each run from the others, rigidly aligned.

    A run has stamps (n,) and poses (n, 3). Those of the run with more stamps are interpolated at
    the stamps of the other. None where no other run has poses at the same time.
    """
    distances = np.full((len(runs), len(runs)), np.nan)
    for i, j in combinations(range(len(runs)), 2):
        (t, poses), (stamps, others) = sorted((runs[i], runs[j]), key=lambda run: len(run[0]))
        if not np.array_equal(t, stamps):
            others = TimeSeries(stamps, others).poses_at(t)
        shared = np.isfinite(others[:, 0])
        if shared.sum() >= MIN_SHARED_STAMPS:
            distances[i, j] = distances[j, i] = ate(poses[shared], others[shared])
    rows = [row[np.isfinite(row)] for row in distances]
    return [float(np.median(row)) if len(row) else None for row in rows]
