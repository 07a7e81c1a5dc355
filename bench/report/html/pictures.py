"""Maps as images inside a plot."""

from __future__ import annotations

import base64
import math

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.report.html.markup import Markup, element
from bench.report.html.plots import short
from bench.report.palette import UNKNOWN, shade
from slams.types import OccupancyGrid

LONGEST = 1000  # px
SHADES = 20  # steps of gray


def picture(
    grid: OccupancyGrid, title: str, transform: str | None = None, finest: float = 0.0
) -> Markup:
    """A map as an image in its own frame; only the part ever observed.

    Cells much finer than `finest` [m] are put together: walls of one such cell would not be seen.
    """
    shades, resolution, (x, y) = _shades(grid, finest)
    height, width = shades.shape
    done, data = cv2.imencode(".png", shades, [cv2.IMWRITE_PNG_COMPRESSION, 6])
    if not done:
        raise RuntimeError(f"a map of {width} x {height} cells cannot be written as png")
    return element(
        "image",
        element("title", title),
        x=short(x),
        y=short(y),
        width=short(width * resolution),
        height=short(height * resolution),
        preserveAspectRatio="none",
        href=f"data:image/png;base64,{base64.b64encode(data.tobytes()).decode()}",
        transform=transform,
    )


def _shades(
    grid: OccupancyGrid, finest: float
) -> tuple[NDArray[np.uint8], float, tuple[float, float]]:
    """Gray values of the observed part, its resolution and origin; walls survive the shrinking."""
    known = ~np.isnan(grid.p)
    if not known.any():
        return np.full((1, 1), round(255 * UNKNOWN), np.uint8), grid.resolution, grid.origin
    rows, columns = (np.flatnonzero(known.any(axis=axis)) for axis in (1, 0))
    part = grid.p[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    factor = max(math.ceil(max(part.shape) / LONGEST), round(finest / grid.resolution))
    part = _shrunk(np.where(np.isnan(part), -1.0, part), factor)
    steps = np.round(shade(np.where(part < 0.0, np.nan, part)) * SHADES) * (255.0 / SHADES)
    shades = steps.round().astype(np.uint8)
    corner = (
        grid.origin[0] + columns[0] * grid.resolution,
        grid.origin[1] + rows[0] * grid.resolution,
    )
    return shades, grid.resolution * factor, corner


def _shrunk(p: NDArray[np.floating], factor: int) -> NDArray[np.floating]:
    """The greatest value of each factor x factor cells."""
    if factor == 1:
        return p
    height, width = (-(-n // factor) for n in p.shape)
    padded = np.full((height * factor, width * factor), -1.0)
    padded[: p.shape[0], : p.shape[1]] = p
    blocks = padded.reshape(height, factor, width, factor)
    shrunk: NDArray[np.floating] = blocks.max(axis=(1, 3))
    return shrunk
