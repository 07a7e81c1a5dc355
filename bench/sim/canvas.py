"""Canvas of the arenas: shapes become occupied cells, passages between them stay open."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bench.sim.world import Mask, World

ARENA_MARGIN = 0.2  # m around the arena
MIN_GAP = 0.1  # m between two objects; narrower gaps are closed

Outline = NDArray[np.float64]  # (n, 2) [m], corners of a convex shape, counter-clockwise
Area = tuple[slice, slice]  # a window of cells
WHOLE_CANVAS: Area = (slice(None), slice(None))


def pieces(mask: Mask) -> int:
    """Number of 4-connected components of a mask."""
    import cv2

    count, _ = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    return count - 1


class Canvas:
    """Cells to draw on, `shape` (ny, nx) and a margin; metres are measured from the inner corner.

    `inside` are the cells of the arena. All others are unknown, and nothing is drawn there.

    Raises:
        ValueError: the cells are too coarse for thin walls.
    """

    def __init__(self, shape: tuple[int, int], resolution: float) -> None:
        if not 0.005 <= resolution <= 0.1:
            raise ValueError(f"resolution: got {resolution} m, expected 0.005 to 0.1 for the arena")
        self.resolution = resolution
        self.margin = math.ceil(ARENA_MARGIN / resolution)
        ny, nx = shape
        self.occupied = np.zeros((ny + 2 * self.margin, nx + 2 * self.margin), np.bool_)
        self.inside = np.zeros_like(self.occupied)

    @classmethod
    def solid(cls, width: float, depth: float, resolution: float) -> Canvas:
        """A block of `width` x `depth` [m] to carve rooms from."""
        canvas = cls((round(depth / resolution), round(width / resolution)), resolution)
        block = canvas.area(0.0, 0.0, width, depth)
        canvas.inside[block] = canvas.occupied[block] = True
        return canvas

    def world(self) -> World:
        """The drawn world, with narrow gaps closed; outside it is unknown."""
        import cv2

        k = 2 * max(1, round(0.5 * MIN_GAP / self.resolution)) + 1  # odd: the anchor is its middle
        square, drawn = np.ones((k, k), np.uint8), self.occupied.astype(np.uint8)
        closed = cv2.morphologyEx(drawn, cv2.MORPH_CLOSE, square) > 0
        occupied = self.occupied | (closed & self.inside)
        corner = -self.margin * self.resolution
        unknown = ~(self.inside | occupied)
        return World(occupied, unknown, self.resolution, (corner, corner))

    def area(self, left: float, bottom: float, right: float, top: float) -> Area:
        """The cells of a rectangle [m], cut off at the edge."""
        edges = np.round(np.array([left, bottom, right, top]) / self.resolution).astype(int)
        x0, y0, x1, y1 = np.maximum(edges + self.margin, 0).tolist()
        return slice(y0, y1), slice(x0, x1)

    def carve(self, left: float, bottom: float, right: float, top: float) -> None:
        """Make a rectangle [m] free."""
        self.occupied[self.area(left, bottom, right, top)] = False

    def hide(self, left: float, bottom: float, right: float, top: float) -> None:
        """Remove a rectangle [m] from the arena."""
        area = self.area(left, bottom, right, top)
        self.inside[area] = self.occupied[area] = False

    def is_free(self, left: float, bottom: float, right: float, top: float) -> bool:
        """Whether a rectangle [m] is free."""
        area = self.area(left, bottom, right, top)
        return not self.occupied[area].any() and bool(self.inside[area].all())

    def fill(self, outline: Outline) -> None:
        """Occupy the cells whose centers lie in an outline."""
        cells = outline / self.resolution + self.margin
        low = np.maximum(np.floor(cells.min(axis=0)).astype(int), 0)
        high = np.ceil(cells.max(axis=0)).astype(int)
        window = self.occupied[low[1] : high[1], low[0] : high[0]]
        iy, ix = np.indices(window.shape)
        x, y = ix + low[0] + 0.5, iy + low[1] + 0.5
        within = np.ones(window.shape, np.bool_)
        for (ax, ay), (bx, by) in zip(cells, np.roll(cells, -1, axis=0), strict=True):
            within &= (bx - ax) * (y - ay) >= (by - ay) * (x - ax)
        window |= within & self.inside[low[1] : high[1], low[0] : high[0]]

    def put(self, outlines: Sequence[Outline], clearance: float, area: Area = WHOLE_CANVAS) -> bool:
        """Fill outlines in `area` if the places with `clearance` [m] stay connected.

        Returns whether they were filled.
        """
        before = self.occupied[area].copy()
        for outline in outlines:
            self.fill(outline)
        passable = self._passable(clearance, area)
        if not passable:
            self.occupied[area] = before
        return passable

    def _passable(self, clearance: float, area: Area) -> bool:
        """Whether all places with `clearance` [m] are connected."""
        import cv2

        free = (self.inside[area] & ~self.occupied[area]).astype(np.uint8)
        distance = cv2.distanceTransform(free, cv2.DIST_L2, 5) * self.resolution  # within 2 %
        return pieces(distance >= clearance) == 1


def rectangle(center: tuple[float, float], length: float, width: float, angle: float) -> Outline:
    """A rectangle whose `length` lies in the direction `angle`."""
    c, s = math.cos(angle), math.sin(angle)
    corners = 0.5 * np.array(
        [[-length, -width], [length, -width], [length, width], [-length, width]]
    )
    rotated: Outline = corners @ np.array([[c, s], [-s, c]]) + np.array(center)
    return rotated


def round_outline(center: tuple[float, float], radius: float) -> Outline:
    """A circle, with 32 corners."""
    angles = np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False)
    return np.array(center) + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
