"""Correlative matching: a window of poses, searched coarse to fine, on any map with a likelihood.

[Olson15] E. Olson: M3RSM: Many-to-Many Multi-Resolution Scan Matching. ICRA 2015.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.frontend import correlative_kernels as kernels
from slams.types import Floats, Pose2

BEAMS = 60  # of a scan that are looked up
LARGEST = 8  # cells along the edge of a coarse one at most
ACROSS = 2.5  # coarse cells, at least, from the middle of a window to its edge
STEP = 3.0  # cells that the farthest end is moved by from one rotation to the next
COARSEST = 0.1  # rad between two rotations at most
GOLDEN = 0.618034  # ratio that leads each point far from those before
REFINED = 40  # coarse poses that are searched finely
ALIKE = 0.2  # of the likelihood of the best pose, that others worth a match may be below it
DEVIATIONS = 3.0  # of a prior that a window covers
WIDEST = 2.0  # m: half of the window of a prior at most
LEAST_ROTATION = 0.2  # rad: half of it at least, as a prior in doubt is no limit


class LikelihoodField(NamedTuple):
    """Likelihood of walls 0..1 (ny, nx), the center of cell [0, 0] (x, y) [m], the cell [m].

    `pooled` (ny, nx), `block`: see `pooled_field`; without, coarse cells are made in every search.
    """

    likelihood: NDArray[np.float32]
    x0: float
    y0: float
    resolution: float
    pooled: NDArray[np.float32] | None = None
    block: int = 0


class Window(NamedTuple):
    """Where a pose is searched for: its middle, half its width [m] and half its rotation [rad]."""

    middle: Pose2
    half: float
    rotation: float


def window_of(middle: Pose2, covariance: Floats) -> Window:
    """Around a prior with a covariance (3, 3) [m, rad]."""
    spread = math.sqrt(max(float(covariance[0, 0]), float(covariance[1, 1]), 0.0))
    rotation = DEVIATIONS * math.sqrt(max(float(covariance[2, 2]), 0.0))
    return Window(middle, min(DEVIATIONS * spread, WIDEST), max(rotation, LEAST_ROTATION))


def pooled_field(lookup: LikelihoodField, block: int) -> LikelihoodField:
    """A map for many searches: with the largest likelihood in a block of cells from each cell on.

    A point may lie anywhere in a coarse cell, so that bounds the shifts of two blocks; this bounds
    those of one [Olson15].
    """
    import cv2

    likelihood = np.pad(lookup.likelihood, ((block, 0), (block, 0)))  # blocks that end in the map
    pooled = cv2.dilate(likelihood, np.ones((block, block), np.uint8), anchor=(0, 0))
    x0, y0 = (v - block * lookup.resolution for v in (lookup.x0, lookup.y0))
    return LikelihoodField(
        likelihood, x0, y0, lookup.resolution, np.asarray(pooled, np.float32), block
    )


def search(
    lookup: LikelihoodField, ends: Floats, window: Window, enough: float = 0.0, alike: float = 1.0
) -> tuple[Floats, int]:
    """The best poses of a window; coarse cells bound what their poses can score [Olson15].

    They bound it for one rotation in several: the others beside it may score a little more.

    Args:
        lookup: the map.
        ends: end points (2 or 3, n) [m] in the base frame; a part of them is looked up.
        window: of poses.
        enough: score that the best must have.
        alike: how much below the best a score still counts.

    Returns:
        poses (k, 4), the best first: x, y [m], theta [rad], and the mean likelihood at the ends,
        too low where it was given up; how many cells were looked up.
    """
    some = ends[:2, :: max(1, ends.shape[1] // BEAMS)]
    far_apart = np.argsort(np.arange(some.shape[1]) * GOLDEN % 1.0)  # bad poses fail early
    some = np.ascontiguousarray(some[:, far_apart])
    far = math.sqrt(float((some * some).sum(axis=0).max(initial=1.0)))
    part, cell = _part(lookup, window, far), lookup.resolution
    cells = lookup.block or _block(window.half / cell)
    poses, count = _coarse_poses(part, some, window, cells, (far, enough))
    frame = np.array((part.x0 - 0.5 * cell, part.y0 - 0.5 * cell, cell))
    kernels.finest(part.likelihood, some, frame, cells, np.array((enough, alike)), poses)
    tried = int((poses[:, 3] > 0.0).sum())
    lookups = (count + tried * cells * cells) * some.shape[1]
    return poses[np.argsort(-poses[:, 3], kind="stable")], lookups


def _block(half: float) -> int:
    """Cells along the edge of a coarse one, a power of two, by half of the window in cells."""
    return 1 << int(math.log2(min(max(half / ACROSS, 1.0), LARGEST)))


def _part(lookup: LikelihoodField, window: Window, far: float) -> LikelihoodField:
    """The cells that ends can be in."""
    cell, reach = lookup.resolution, far + window.half
    x, y = (window.middle.x - lookup.x0) / cell, (window.middle.y - lookup.y0) / cell
    margin = math.ceil(reach / cell) + 2 * LARGEST
    i, j = max(round(x) - margin, 0), max(round(y) - margin, 0)
    part = np.s_[j : max(round(y) + margin, 0), i : max(round(x) + margin, 0)]
    likelihood = np.ascontiguousarray(lookup.likelihood[part])  # so the kernels compile once
    pooled = None if lookup.pooled is None else np.ascontiguousarray(lookup.pooled[part])
    corner = lookup.x0 + i * cell, lookup.y0 + j * cell
    return LikelihoodField(likelihood, *corner, cell, pooled, lookup.block)


def _coarse_poses(
    lookup: LikelihoodField, ends: Floats, window: Window, cells: int, need: tuple[float, float]
) -> tuple[Floats, int]:
    """The first poses (k, 4) of the best blocks of a window, and how many blocks it has."""
    fine, x0, y0, cell, coarse, stride = lookup
    (ny, nx), block, (far, enough) = fine.shape, cell * cells, need
    edge = cell
    if coarse is None:
        coarse, edge, stride = np.zeros((ny // cells + 1, nx // cells + 1), np.float32), block, 1
        kernels.pool(fine, cells, coarse)
    shifts = 2 * math.ceil(window.half / block) + 1
    turns = np.arange(-(cells // 4), cells // 4 + 1) / (cells // 2 + 1)
    rotation = min(window.rotation, math.pi)
    widest = len(turns) * min(STEP * cell / far, COARSEST)
    rotations = 2 * max(1, math.ceil(rotation / widest)) + 1
    step = 2.0 * rotation / (rotations - 1)
    x, y = (v - 0.5 * (shifts - 1) * block for v in window.middle[:2])
    first = window.middle.theta - rotation
    bounds = np.zeros((rotations, shifts, shifts), np.float32)
    view = np.array((x, y, first, step, enough))
    frame = np.array((x0 - 0.5 * cell, y0 - 0.5 * cell, edge))
    kernels.bounds(coarse, ends, view, frame, stride, bounds)
    good = _greatest(bounds.ravel(), enough)
    k, j, i = np.unravel_index(good, bounds.shape)
    thetas = (first + (k[:, None] + turns) * step).ravel()
    xs, ys = (np.repeat(v, len(turns)) for v in (x + i * block, y + j * block))
    bound = np.repeat(bounds.flat[good], len(turns))
    poses = np.ascontiguousarray(np.stack([xs, ys, thetas, bound], axis=1), np.float64)
    return poses, bounds.size


def _greatest(bounds: NDArray[np.float32], enough: float) -> NDArray[np.intp]:
    """Where the `REFINED` greatest of bounds (n,) are, of those that are enough.

    Of equals those near the middle of the window come first.
    """
    good = np.flatnonzero(bounds >= enough)
    if len(good) > REFINED:  # a sort of all takes as long as their sums
        good = good[bounds[good] >= np.partition(bounds[good], -REFINED)[-REFINED]]
        good = good[np.argsort(np.abs(good - bounds.size // 2), kind="stable")]
    return good[np.argsort(-bounds[good], kind="stable")[:REFINED]]
