"""Pictures of a field of signed distances."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

UNKNOWN = 205.0  # shade of unknown cells
Image = NDArray[np.float32]
Picture = tuple[Image, Image, float, tuple[float, float]]


def colored(tsd: Image, truncation: float) -> NDArray[np.uint8]:
    """The field as a picture (ny, nx, 3), blue, green, red, north up.

    Blue before a surface, red behind, the paler the farther; gray where nothing is known.
    """
    pale = 255.0 * np.clip(np.abs(tsd) / truncation, 0.0, 1.0)
    full = np.full_like(pale, 255.0)
    blue, red = np.where(tsd > 0.0, full, pale), np.where(tsd > 0.0, pale, full)
    image = np.stack([blue, pale, red], axis=2)
    known = np.isfinite(tsd)
    image[~known] = UNKNOWN
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if rows.size == 0:
        rows = columns = np.zeros(1, np.int64)
    part = image[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return np.ascontiguousarray(part[::-1].astype(np.uint8))
