"""How well a run agrees with its own scans and with other runs: measures that need no truth.

- walls: the scans are drawn at the run's poses, all runs by one rule whatever their own map looks
  like. The area of the cells they end in grows with every blurred or doubled wall, as the entropy
  of a map does (Stachniss, Grisetti and Burgard 2005); over that of the sharpest run it tells runs
  of one log apart.
- revisits: where the robot comes back to a place, the scan of now is registered to those of then by
  ICP with point-to-line distances (Censi 2008), starting from the run's poses. What ICP moves it by
  is the error that the run has gathered in between.
- conflicts: share of the scan that the algorithm's own map does not explain (`quality`).
- disagreement: distance of the run from the others on the same log, each aligned to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.registration import Reference, register
from bench.sim.rays import ends_of, rays_of
from slams.metrics import ate, driven
from slams.types import Floats

if TYPE_CHECKING:
    from slams.scanlog import ScanLog

SCANS = 1000  # of a log that are drawn, evenly spread
CELL = 0.05  # m, as the algorithms' maps
HITS = 2  # returns that make a cell a wall: one may be noise, or a person
REVISITS = 60  # places of a log at which scans are registered, evenly spread
NEAR = 1.0  # m between the poses of a revisit
APART_S, APART_M = 20.0, 5.0  # time and path between them
AROUND = 2  # scans before and after the earlier pose that it is registered to
STRIDE = 0.1  # m between those
UNREGISTERED = 0.5  # m, error of a revisit whose scans do not fit together: ICP's reach
FEWEST_SHARED = 10  # stamps that two runs must share to be compared


class Consistency(NamedTuple):
    """Wall area [m2]; mean error at revisits [m], None without any; how many of these there are."""

    walls_m2: float
    revisits_m: float | None
    revisits: int


def consistency(log: ScanLog, poses: Floats) -> Consistency:
    """Measure a run by its scans; poses (n, 3) at those of the log, nan where it has none."""
    known = np.flatnonzero(np.isfinite(poses).all(axis=1))
    chosen = known[:: max(1, -(-len(known) // SCANS))]
    walls = wall_area(points_at(log, poses, chosen))
    errors = revisit_errors(log, poses, known)
    return Consistency(walls, float(errors.mean()) if len(errors) else None, len(errors))


def points_at(log: ScanLog, poses: Floats, scans: NDArray[np.int64]) -> Floats:
    """Where the returns of some scans lie (m, 2) at the run's poses, beams in their order."""
    rays = rays_of(log.laser, _beam_poses(log, poses, scans))
    ranges = log.ranges[scans].astype(np.float64)
    hit = np.isfinite(ranges)
    return ends_of(rays, np.where(hit, ranges, 0.0))[hit]


def _beam_poses(log: ScanLog, poses: Floats, scans: NDArray[np.int64]) -> Floats:
    """Poses (n, 3), or of each beam (n, b, 3) of a laser that sweeps, at the scan's velocity."""
    if not log.laser.time_increment or len(poses) < 2:
        return poses[scans]
    after = np.minimum(scans + 1, len(poses) - 1)
    step = poses[after] - poses[after - 1]
    step[:, 2] = (step[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    step = np.nan_to_num(step / max(log.scan_period, 1e-3))
    delays = log.laser.time_increment * np.arange(log.laser.n_beams)
    return np.asarray(poses[scans][:, None] + delays[None, :, None] * step[:, None])


def wall_area(points: Floats) -> float:
    """Area [m2] of the cells in which at least `HITS` of the points (m, 2) lie."""
    if not len(points):
        return 0.0
    cells = np.floor(points / CELL).astype(np.int64)
    _, counts = np.unique(cells[:, 0] * 2**31 + cells[:, 1], return_counts=True)
    return float(CELL**2 * (counts >= HITS).sum())


def revisit_errors(log: ScanLog, poses: Floats, known: NDArray[np.int64]) -> Floats:
    """Error [m] at each of at most `REVISITS` places that the run comes back to."""
    now, then = revisits(log.t[known], poses[known])
    chosen = np.unique(np.linspace(0, len(now) - 1, min(REVISITS, len(now))).astype(int))
    path = driven(poses[known])
    errors = []
    for k in chosen:
        places = path[then[k]] + STRIDE * np.arange(-AROUND, AROUND + 1)
        around = np.unique(np.clip(np.searchsorted(path, places), 0, len(known) - 1))
        target = Reference([points_at(log, poses, known[[j]]) for j in around])
        scan = points_at(log, poses, known[[now[k]]])
        moved = register(scan, target, poses[known[now[k]], :2])
        if moved is not None:
            errors.append(min(moved, UNREGISTERED))
    return np.array(errors)


def revisits(t: Floats, poses: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices (k,), (k,) of poses (n, 3) and of the earliest near one, long before each."""
    from scipy.spatial import KDTree

    path, tree = driven(poses), KDTree(poses[:, :2])
    places = np.unique(np.searchsorted(path, np.arange(0.0, path[-1], 0.5)))
    now, then = [], []
    for k in places[places < len(poses)].tolist():
        near = np.sort(tree.query_ball_point(poses[k, :2], NEAR))
        near = near[(path[k] - path[near] > APART_M) & (t[k] - t[near] > APART_S)]
        if len(near):
            first = near[path[near] < path[near[0]] + 2.0 * NEAR]
            gap = np.hypot(*(poses[first, :2] - poses[k, :2]).T)
            now.append(k)
            then.append(int(first[np.argmin(gap)]))
    return np.array(now, np.int64), np.array(then, np.int64)


def disagreements(runs: Sequence[tuple[Floats, Floats]]) -> list[float | None]:
    """Median over the others of each run's distance [m] from them, rigidly aligned.

    A run is its stamps (n,) and poses (n, 3); None where no other has the same stamps.
    """
    apart = np.full((len(runs), len(runs)), np.nan)
    for i, (t, poses) in enumerate(runs):
        for j in range(i):
            _, own, other = np.intersect1d(t, runs[j][0], return_indices=True)
            if len(own) >= FEWEST_SHARED:
                apart[i, j] = apart[j, i] = ate(poses[own], runs[j][1][other])
    rows = [row[np.isfinite(row)] for row in apart]
    return [float(np.median(row)) if len(row) else None for row in rows]
