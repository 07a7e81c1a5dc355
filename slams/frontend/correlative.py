"""Correlative matching: coarse-to-fine search of a window of poses on a likelihood field.

[Olson15] E. Olson: M3RSM: Many-to-Many Multi-Resolution Scan Matching. ICRA 2015.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from slams.frontend import correlative_kernels as kernels
from slams.types import Floats, Pose2

N_SEARCH_BEAMS = 60  # of a scan that are looked up, at least, if it has so many
MAX_BLOCK_SIZE = 8  # cells along the edge of a coarse cell
MIN_BLOCKS_PER_HALF_WINDOW = 2.5  # so that coarse cells are not larger than the window
ROTATION_STEP_CELLS = 3.0  # cells that a rotation step moves the farthest end point
MAX_ROTATION_STEP = 0.1  # rad, also where all end points are near
MAX_REFINED_POSES = 40  # coarse poses that are searched at full resolution
SEARCH_SCORE_TOLERANCE = 0.2  # below the best score; poses within it are worth a match
PRIOR_WINDOW_DEVIATIONS = 3.0  # of a prior, to each side
MAX_HALF_WINDOW = 2.0  # m, to bound the work
MIN_HALF_ROTATION = 0.2  # rad, since a doubtful prior must not limit the search


class LikelihoodField(NamedTuple):
    """Likelihood of walls (ny, nx), center of cell [0, 0] (x, y) [m], edge of a cell [m].

    `pooled` (ny, nx) and `block`: see `pooled_field`; without them each search makes its own.
    Values of `full` and more are a likelihood of 1.
    """

    likelihood: NDArray[np.float32]
    x0: float
    y0: float
    resolution: float
    pooled: NDArray[np.float32] | None = None
    block: int = 0
    full: float = 1.0


class Window(NamedTuple):
    """Poses to search: the middle, half of the width [m] and half of the rotation [rad]."""

    middle: Pose2
    half_width: float
    half_rotation: float


def window_of(middle: Pose2, covariance: Floats) -> Window:
    """Window around a prior with a covariance (3, 3) [m, rad]."""
    std = math.sqrt(max(float(covariance[0, 0]), float(covariance[1, 1]), 0.0))
    rotation = PRIOR_WINDOW_DEVIATIONS * math.sqrt(max(float(covariance[2, 2]), 0.0))
    half_width = min(PRIOR_WINDOW_DEVIATIONS * std, MAX_HALF_WINDOW)
    return Window(middle, half_width, max(rotation, MIN_HALF_ROTATION))


def pooled_field(field: LikelihoodField, block: int) -> LikelihoodField:
    """A field for searches, with the maximum over the block of cells that starts at each cell.

    Its bound is tighter than that of coarse cells, in which a point may lie anywhere [Olson15].
    """
    likelihood = np.pad(field.likelihood, ((block, 0), (block, 0)))  # blocks that end in the map
    pooled = cv2.dilate(likelihood, np.ones((block, block), np.uint8), anchor=(0, 0))
    x0, y0 = (v - block * field.resolution for v in (field.x0, field.y0))
    return LikelihoodField(
        likelihood, x0, y0, field.resolution, np.asarray(pooled, np.float32), block
    )


def search(
    field: LikelihoodField,
    ends: Floats,
    window: Window,
    min_score: float = 0.0,
    tolerance: float = 1.0,
) -> tuple[Floats, int]:
    """The best poses of a window; coarse cells bound the score of the poses in them [Olson15].

    The bound is that of one of several adjacent rotations; the others may score a little more.
    `ends` (2 or 3, n) [m] are end points in the base frame, of which a subset is looked up;
    `min_score` is the least score of the best pose, `tolerance` the difference to the best score up
    to which scores are exact. Returns poses (k, 4), the best first: x, y [m], theta [rad], mean
    likelihood at the end points (too small or 0 beyond the tolerance); number of lookups.
    """
    subset = ends[:2, :: max(1, ends.shape[1] // N_SEARCH_BEAMS)]
    golden_ratio = 0.618034  # spreads successive points over the scan, so that bad poses fail early
    order = np.argsort(np.arange(subset.shape[1]) * golden_ratio % 1.0)
    subset = np.ascontiguousarray(subset[:, order])
    max_range = math.sqrt(float((subset * subset).sum(axis=0).max(initial=1.0)))
    part, cell = _part(field, window, max_range), field.resolution
    block = field.block or _block_size(window.half_width / cell)
    if part.pooled is None:
        part = pooled_field(part, block)
    poses, count = _coarse_poses(part, subset, window, (max_range, min_score))
    frame = np.array((part.x0 - 0.5 * cell, part.y0 - 0.5 * cell, cell))
    scores = np.array((min_score, tolerance))
    kernels.best_shifts(part.likelihood, subset, frame, block, scores, poses)
    tried = int((poses[:, 3] > 0.0).sum())
    lookups = (count + tried * block * block) * subset.shape[1]
    return poses[np.argsort(-poses[:, 3], kind="stable")], lookups


def _block_size(half_width: float) -> int:
    """Cells along the edge of a coarse cell, a power of two; `half_width` of the window [cell]."""
    blocks = half_width / MIN_BLOCKS_PER_HALF_WINDOW
    return 1 << int(math.log2(min(max(blocks, 1.0), MAX_BLOCK_SIZE)))


def _part(field: LikelihoodField, window: Window, max_range: float) -> LikelihoodField:
    """The cells that end points can reach."""
    cell, reach = field.resolution, max_range + window.half_width
    x, y = (window.middle.x - field.x0) / cell, (window.middle.y - field.y0) / cell
    margin = math.ceil(reach / cell) + 2 * MAX_BLOCK_SIZE
    i, j = max(round(x) - margin, 0), max(round(y) - margin, 0)
    part = np.s_[j : max(round(y) + margin, 0), i : max(round(x) + margin, 0)]
    likelihood = np.array(field.likelihood[part], np.float32)  # so the kernels compile once
    if field.full != 1.0:
        likelihood = np.minimum(likelihood / np.float32(field.full), np.float32(1.0))
    pooled = None if field.pooled is None else np.ascontiguousarray(field.pooled[part])
    corner = field.x0 + i * cell, field.y0 + j * cell
    return LikelihoodField(likelihood, *corner, cell, pooled, field.block)


def _coarse_poses(
    field: LikelihoodField, ends: Floats, window: Window, need: tuple[float, float]
) -> tuple[Floats, int]:
    """First poses (k, 4) of the best blocks; number of blocks. need: max_range, min_score."""
    _, x0, y0, cell, coarse, block = field[:6]
    assert coarse is not None, "the field of a search is pooled"
    width, (max_range, min_score) = block * cell, need
    shifts = 2 * math.ceil(window.half_width / width) + 1
    substeps = np.arange(-(block // 4), block // 4 + 1) / (block // 2 + 1)
    rotation = min(window.half_rotation, math.pi)
    max_step = len(substeps) * min(ROTATION_STEP_CELLS * cell / max_range, MAX_ROTATION_STEP)
    rotations = 2 * max(1, math.ceil(rotation / max_step)) + 1
    step = 2.0 * rotation / (rotations - 1)
    x, y = (v - 0.5 * (shifts - 1) * width for v in window.middle[:2])
    first = window.middle.theta - rotation
    bounds = np.zeros((rotations, shifts, shifts), np.float32)
    view = np.array((x, y, first, step, min_score))
    frame = np.array((x0 - 0.5 * cell, y0 - 0.5 * cell, cell))
    kernels.bounds(coarse, ends, view, frame, block, bounds)
    good = _greatest(bounds.ravel(), min_score)
    k, j, i = np.unravel_index(good, bounds.shape)
    thetas = (first + (k[:, None] + substeps) * step).ravel()
    xs, ys = (np.repeat(v, len(substeps)) for v in (x + i * width, y + j * width))
    bound = np.repeat(bounds.flat[good], len(substeps))
    poses = np.ascontiguousarray(np.stack([xs, ys, thetas, bound], axis=1), np.float64)
    return poses, bounds.size


def _greatest(bounds: NDArray[np.float32], min_score: float) -> NDArray[np.intp]:
    """Indices of the `MAX_REFINED_POSES` greatest bounds (n,) that reach `min_score`.

    Among equal bounds the poses near the middle of the window come first.
    """
    n, good = MAX_REFINED_POSES, np.flatnonzero(bounds >= min_score)
    if len(good) > n:  # sorting all bounds would take as long as computing them
        good = good[bounds[good] >= np.partition(bounds[good], -n)[-n]]
        good = good[np.argsort(np.abs(good - bounds.size // 2), kind="stable")]
    return good[np.argsort(-bounds[good], kind="stable")[:n]]
