"""How good a map is: the occupancy grid of a run against the true one.

The run's map is brought into the true map's frame by one rigid motion: by definition the true base
pose of the first scan, so that drift counts against the map; `map_frame` also finds the one that
lays the whole trajectory on the truth. A cell is occupied above a probability of 0.5 and free
below; nan and 0.5 are unknown, and unknown is never free. Measures that compare cells do so in the
run's grid: there a cell is truly occupied when a part of it is (walls may be thinner than a cell),
else truly free when a part of it is. Distances are between the centers of occupied cells and need
no common grid.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.metrics import align
from slams.types import Floats, OccupancyGrid, Pose2

if TYPE_CHECKING:
    from bench.sim.world import World
    from slams.scanlog import ScanLog
    from slams.types import Laser

Mask = NDArray[np.bool_]

POSES = 2000  # of a log that the world is looked at from, evenly spread
FINE = 256  # parts of a cell in which outlines are drawn
FEWEST_WALLS = 100  # occupied cells that a statement about walls takes
FEWEST_CELLS = 1000  # known cells that a statement about areas takes
LEAST_SHARE = 0.1  # of the true map that a run must know to be judged by it
SSIM_WINDOW, SSIM_SIGMA = 11, 1.5  # cells, [Wang04] section III.B
SSIM_C1, SSIM_C2 = 0.01**2, 0.03**2  # [Wang04]: (K1 L)^2 and (K2 L)^2, L = 1


class Quality(NamedTuple):
    """One measure: its value, from how many cells, whether it means something, else why not."""

    value: float
    support: int
    meaningful: bool
    reason: str


@dataclass(frozen=True)
class MapQuality:
    """All measures of one map, whose cells are `resolution` [m].

    - iou: cells occupied in both over cells occupied in either, of those known in both.
    - adnn_to_truth: average distance [m] from an occupied cell to the nearest true wall: accuracy.
    - adnn_from_truth: average distance [m] from a true wall to the nearest occupied cell:
      completeness. Where cells of 0.05 m meet true ones of 0.02 m, either is 0.01 to 0.02 at best.
    - hausdorff: the greatest of all these distances [m], either way: a single cell decides it.
    - hausdorff_95: the greater of the 95th percentiles [m] of the two directions.
    - ssim: structural similarity [Wang04] of the maps as pictures in black and white, mean over
      the cells known in both. Open space counts as alike.
    - ssim_walls: its mean over the windows that hold a wall in either map.
    - wall_thickness: area of the walls over half of their outline [m].
    - true_wall_thickness: of the true walls in the run's grid, what a perfect map would have.
    - coverage: share of the cells known in the true map that the run's map knows.
    """

    alignment: str
    resolution: float
    iou: Quality
    adnn_to_truth: Quality
    adnn_from_truth: Quality
    hausdorff: Quality
    hausdorff_95: Quality
    ssim: Quality
    ssim_walls: Quality
    wall_thickness: Quality
    true_wall_thickness: Quality
    coverage: Quality

    def as_dict(self) -> dict[str, Any]:
        """For results.json: each measure as a dict, None for a value that is not finite."""
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return {
            name: _plain(value) if isinstance(value, Quality) else value
            for name, value in values.items()
        }


class _Cells(NamedTuple):
    """What is known of the cells (ny, nx) of a grid."""

    occupied: Mask
    free: Mask

    @property
    def known(self) -> Mask:
        """Cells of which something is known."""
        return self.occupied | self.free


class _Window(NamedTuple):
    """The part of a grid, or around it, from cell [iy, ix] on."""

    iy: int
    ix: int
    ny: int
    nx: int


def truth_map(log: ScanLog, most: int = POSES) -> OccupancyGrid | None:
    """What a perfect mapper could know of a simulated log's world; None when not simulated.

    Free are the free cells that lie within the outline of a scan seen from a true pose (every k-th
    scan, at most `most`), exact ranges up to the laser's limit. Occupied are the walls' cells that
    share an edge with one of these. All else is unknown: rooms never looked into, insides of walls.
    """
    from bench.sim.rays import true_poses
    from bench.sim.simulation import world_of

    world = world_of(log)
    if world is None or log.truth is None:
        return None
    poses = true_poses(log, log.t[:: max(1, math.ceil(len(log) / most))])
    poses = poses[np.isfinite(poses).all(axis=tuple(range(1, poses.ndim)))]
    free = _looked_at(world, log.laser, poses) & world.free
    walls = world.occupied & _beside(free)
    p = np.full(free.shape, np.nan, np.float32)
    p[free], p[walls] = 0.0, 1.0
    return OccupancyGrid(p, world.resolution, world.origin)


def map_frame(estimate: Floats, truth: Floats, by_trajectory: bool = False) -> Pose2 | None:
    """The frame of a run's map in the world, from its poses (n, 3) and the true ones there.

    The true pose of the first scan; or the motion that brings all positions closest to the true
    ones. None when the truth does not tell.
    """
    known = np.flatnonzero(np.isfinite(truth).all(axis=1))
    if by_trajectory:
        return align(estimate[known], truth[known]) if len(known) > 1 else None
    return Pose2(*truth[0].tolist()) if len(known) and known[0] == 0 else None


def compare(
    grid: OccupancyGrid,
    truth: OccupancyGrid,
    T_world_map: Pose2,
    alignment: str = "true pose of the first scan",
) -> MapQuality:
    """Every measure of a run's map.

    Args:
        grid: the run's map.
        truth: the true map, nan where no scan could tell.
        T_world_map: the frame of the run's map in that of the true one.
        alignment: in words, where that pose is from.
    """
    window = _true_window(truth, grid, T_world_map)
    here, there = _cut(grid, window), _resampled(truth, grid, T_world_map, window)
    known = here.known & there.known
    walls = _cells(grid.p).occupied
    doubt = _doubt(int(walls.sum()), known, there)
    to_truth, from_truth = _distances(grid, truth, T_world_map)
    similarity = _similarity(here.occupied, there.occupied, known)
    beside_walls = _around(here.occupied | there.occupied, known)
    return MapQuality(
        alignment=alignment,
        resolution=grid.resolution,
        iou=_overlap(here.occupied & known, there.occupied & known, doubt),
        adnn_to_truth=_mean(to_truth, doubt),
        adnn_from_truth=_mean(from_truth, doubt),
        hausdorff=_greater(to_truth, from_truth, 1.0, doubt),
        hausdorff_95=_greater(to_truth, from_truth, 0.95, doubt),
        ssim=_mean(similarity[known], doubt or _too_small(known)),
        ssim_walls=_mean(similarity[beside_walls], doubt or _too_small(beside_walls)),
        wall_thickness=_thickness(walls, grid.resolution),
        true_wall_thickness=_thickness(there.occupied, grid.resolution),
        coverage=_coverage(known, there.known),
    )


def _plain(quality: Quality) -> dict[str, Any]:
    value = quality.value if math.isfinite(quality.value) else None
    return quality._asdict() | {"value": value}


def _quality(value: float, support: int, doubt: str) -> Quality:
    doubt = doubt if math.isfinite(value) else doubt or "nothing to measure"
    return Quality(value, support, not doubt, doubt)


def _cells(p: NDArray[np.float32]) -> _Cells:
    return _Cells(p > 0.5, p < 0.5)


def _looked_at(world: World, laser: Laser, poses: Floats) -> Mask:
    """Cells inside the outline of an exact scan from one of the poses (n, 3) or (n, b, 3)."""
    import cv2

    from bench.sim.rays import rays_of

    seen = np.zeros(world.occupied.shape, np.uint8)
    for k in range(len(poses)):
        (rays,) = rays_of(laser, poses[k : k + 1])
        reach = np.minimum(world.cast(rays), laser.range_max)
        sights = np.stack([reach * np.cos(rays[:, 2]), reach * np.sin(rays[:, 2])], axis=1)
        corners = np.vstack([rays[:1, :2], rays[:, :2] + sights])
        outline = (corners - np.array(world.origin)) / world.resolution - 0.5
        cv2.fillPoly(seen, [np.round(FINE * outline).astype(np.int32)], 1, 8, FINE.bit_length() - 1)
    return seen.astype(bool)


def _beside(mask: Mask) -> Mask:
    """Cells that share an edge with one of the mask."""
    padded = np.pad(mask, 1)
    beside: Mask = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    return beside


def _centers(grid: OccupancyGrid, mask: Mask) -> Floats:
    """Centers (n, 2) [m] of the cells of a mask."""
    iy, ix = np.nonzero(mask)
    x, y = grid.origin
    return np.stack([x + (ix + 0.5) * grid.resolution, y + (iy + 0.5) * grid.resolution], axis=1)


def _true_window(truth: OccupancyGrid, grid: OccupancyGrid, T_world_map: Pose2) -> _Window:
    """The part of the run's grid that holds all that the true map knows; never empty."""
    known = T_world_map.inverse().transform(_centers(truth, _cells(truth.p).known))
    if not len(known):
        return _Window(0, 0, 1, 1)
    margin, origin = truth.resolution, np.array(grid.origin)
    low = np.floor((known.min(axis=0) - margin - origin) / grid.resolution).astype(int)
    high = np.ceil((known.max(axis=0) + margin - origin) / grid.resolution).astype(int)
    return _Window(int(low[1]), int(low[0]), int(high[1] - low[1]), int(high[0] - low[0]))


def _cut(grid: OccupancyGrid, window: _Window) -> _Cells:
    """The run's own cells of a window, unknown beyond its edges."""
    p = np.full((window.ny, window.nx), np.nan, np.float32)
    ny, nx = grid.p.shape
    iy, ix = (
        np.arange(window.iy, window.iy + window.ny),
        np.arange(window.ix, window.ix + window.nx),
    )
    in_y, in_x = (iy >= 0) & (iy < ny), (ix >= 0) & (ix < nx)
    p[np.ix_(in_y, in_x)] = grid.p[np.ix_(iy[in_y], ix[in_x])]
    return _cells(p)


def _resampled(
    truth: OccupancyGrid, grid: OccupancyGrid, T_world_map: Pose2, window: _Window
) -> _Cells:
    """The true map in the run's grid, looked up at points half a true cell apart or closer."""
    true = _cells(truth.p)
    ny, nx = truth.p.shape
    parts = max(1, math.ceil(2.0 * grid.resolution / truth.resolution))
    occupied = np.zeros((window.ny, window.nx), bool)
    free = np.zeros_like(occupied)
    c, s = math.cos(T_world_map.theta), math.sin(T_world_map.theta)
    for part in range(parts * parts):
        down, across = divmod(part, parts)
        ix = window.ix + np.arange(window.nx) + (across + 0.5) / parts
        iy = window.iy + np.arange(window.ny) + (down + 0.5) / parts
        x, y = ix * grid.resolution + grid.origin[0], iy[:, None] * grid.resolution + grid.origin[1]
        at_x = np.floor((T_world_map.x + c * x - s * y - truth.origin[0]) / truth.resolution)
        at_y = np.floor((T_world_map.y + s * x + c * y - truth.origin[1]) / truth.resolution)
        inside = (at_x >= 0) & (at_x < nx) & (at_y >= 0) & (at_y < ny)
        place = at_y[inside].astype(int), at_x[inside].astype(int)
        occupied[inside] |= true.occupied[place]
        free[inside] |= true.free[place]
    return _Cells(occupied, free & ~occupied)


def _doubt(walls: int, known: Mask, there: _Cells) -> str:
    """Why the maps cannot be compared, "" when they can."""
    if there.occupied.sum() < FEWEST_WALLS:
        return f"only {there.occupied.sum()} cells of true walls could be seen"
    if walls < FEWEST_WALLS:
        return f"the map has only {walls} occupied cells"
    share = known.sum() / there.known.sum()
    if share < LEAST_SHARE:
        return f"the map knows only {100.0 * share:.0f} % of what could be seen"
    return ""


def _too_small(cells: Mask) -> str:
    return f"only {cells.sum()} cells known in both" if cells.sum() < FEWEST_CELLS else ""


def _overlap(here: Mask, there: Mask, doubt: str) -> Quality:
    either = int((here | there).sum())
    return _quality(float((here & there).sum() / either) if either else math.nan, either, doubt)


def _distances(
    grid: OccupancyGrid, truth: OccupancyGrid, T_world_map: Pose2
) -> tuple[Floats, Floats]:
    """From each occupied cell to the nearest true one (n,) and back (m,) [m].

    Empty where either map has no walls.
    """
    from scipy.spatial import KDTree

    here = T_world_map.transform(_centers(grid, _cells(grid.p).occupied))
    there = _centers(truth, _cells(truth.p).occupied)
    if not len(here) or not len(there):
        return np.zeros(0), np.zeros(0)
    to_truth, from_truth = KDTree(there).query(here)[0], KDTree(here).query(there)[0]
    return np.asarray(to_truth), np.asarray(from_truth)


def _mean(values: Floats, doubt: str) -> Quality:
    return _quality(float(values.mean()) if len(values) else math.nan, len(values), doubt)


def _greater(to_truth: Floats, from_truth: Floats, share: float, doubt: str) -> Quality:
    """The greater of both directions' quantiles."""
    support = len(to_truth) + len(from_truth)
    if not support:
        return _quality(math.nan, 0, doubt)
    greater = max(float(np.quantile(part, share)) for part in (to_truth, from_truth))
    return _quality(greater, support, doubt)


def _blurred(values: Floats) -> Floats:
    """Weighted sum (ny, nx) over the Gaussian window around each cell, nothing beyond the edge."""
    import cv2

    size = (SSIM_WINDOW, SSIM_WINDOW)
    return np.asarray(
        cv2.GaussianBlur(values, size, SSIM_SIGMA, borderType=cv2.BORDER_CONSTANT), np.float64
    )


def _similarity(a: Mask, b: Mask, known: Mask) -> Floats:
    """[Wang04] eq. 13 around each cell (ny, nx) of two pictures of 1 and 0.

    Means, variances and covariance are taken over the known cells of a window alone.
    """
    weight = np.maximum(_blurred(known.astype(np.float64)), 1e-12)

    def mean(values: Mask) -> Floats:
        """Of the known cells around each."""
        return _blurred((values & known).astype(np.float64)) / weight

    mean_a, mean_b = mean(a), mean(b)
    # 1 and 0 are their own squares
    variance_a, variance_b = mean_a - mean_a**2, mean_b - mean_b**2
    covariance = mean(a & b) - mean_a * mean_b
    luminance = (2.0 * mean_a * mean_b + SSIM_C1) / (mean_a**2 + mean_b**2 + SSIM_C1)
    similarity: Floats = (
        luminance * (2.0 * covariance + SSIM_C2) / (variance_a + variance_b + SSIM_C2)
    )
    return similarity


def _around(walls: Mask, known: Mask) -> Mask:
    """Known cells whose window holds a known wall."""
    around: Mask = (_blurred((walls & known).astype(np.float64)) > 0.0) & known
    return around


def _thickness(occupied: Mask, resolution: float) -> Quality:
    """Area over half the outline, the latter by Cauchy and Crofton from four directions.

    Lines along rows, columns and diagonals meet the walls so many times; the factor makes long
    walls along the grid exact, and leaves slanted ones up to 8 % too thin.
    """
    support = int(occupied.sum())
    padded = np.pad(occupied, 1)
    inner = padded[1:-1, 1:-1]
    straight = (inner & ~padded[1:-1, :-2]).sum() + (inner & ~padded[:-2, 1:-1]).sum()
    slanted = (inner & ~padded[:-2, :-2]).sum() + (inner & ~padded[:-2, 2:]).sum()
    half_outline = (straight + slanted / math.sqrt(2.0)) / (1.0 + math.sqrt(2.0))
    doubt = f"only {support} occupied cells" if support < FEWEST_WALLS else ""
    value = resolution * support / float(half_outline) if support else math.nan
    return _quality(value, support, doubt)


def _coverage(known: Mask, true: Mask) -> Quality:
    support = int(true.sum())
    doubt = f"only {support} cells could be seen" if support < FEWEST_CELLS else ""
    return _quality(float(known.sum() / support) if support else math.nan, support, doubt)
