"""Colors of the runs and shades of the maps, the same in every figure. Light."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats

# Okabe and Ito's, and such as are farthest from these and each other in CIELAB on white and black
COLORS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#E69F00",
    "#A000E0",
    "#000000",
    "#CC79A7",
    "#806040",
    "#E00060",
    "#00C000",
    "#6060E0",
    "#A0C040",
    "#E040C0",
    "#56B4E9",
)
LINES = ("-", "--", ":", "-.")  # of the runs where the colors come again
UNKNOWN = 0.7  # shade of cells never observed
LEAST_FREE = 0.85  # shade of a cell that is just free: lighter than unknown
MOST_OCCUPIED = 0.5  # shade of a cell that is just occupied: darker than unknown


class Look(NamedTuple):
    """How a run is drawn: color and line style."""

    color: str
    line: str


def looks(names: list[str]) -> dict[str, Look]:
    """The look of each run, the same in every figure, whichever of the runs it shows."""
    return {
        name: Look(COLORS[k % len(COLORS)], LINES[k % len(LINES)]) for k, name in enumerate(names)
    }


def shade(p: NDArray[np.floating]) -> Floats:
    """Shades (ny, nx) of probabilities: 0 black to 1 white; unknown between free and occupied."""
    free = 1.0 - 2.0 * (1.0 - LEAST_FREE) * p
    occupied = 2.0 * MOST_OCCUPIED * (1.0 - p)
    known = np.where(p < 0.5, free, occupied)
    return np.where(np.isnan(p) | (p == 0.5), UNKNOWN, known).astype(np.float64)
