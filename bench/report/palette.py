"""Colors of the runs and shades of the maps, the same in every figure."""

from __future__ import annotations

from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.registry import ALGORITHMS, BASELINES
from slams.types import Floats

# Okabe and Ito's, and colors with the largest distances in CIELAB, also from white and black
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
LINE_STYLES = ("-", "--", ":", "-.")  # of runs with the same color
# runs whose look never depends on the other runs of a figure
IDEAS = [name for name in ALGORITHMS if name not in BASELINES]
KNOWN = [*ALGORITHMS, *(f"{name}@{kind}" for kind in ("paper", "original") for name in IDEAS)]
UNKNOWN_SHADE = 0.7  # of unobserved cells
MIN_FREE_SHADE = 0.85  # of free cells: lighter than unknown
MAX_OCCUPIED_SHADE = 0.5  # of occupied cells: darker than unknown


class Look(NamedTuple):
    """How a run is drawn: color and line style."""

    color: str
    line: str


def looks(names: list[str]) -> dict[str, Look]:
    """The look of each run by its name, the same in every figure."""
    ranks = {name: k for k, name in enumerate(KNOWN) if name in names}
    free = (k for k in count() if k not in ranks.values())
    found = {name: ranks[name] if name in ranks else next(free) for name in names}
    return {
        name: Look(COLORS[k % len(COLORS)], LINE_STYLES[k % len(LINE_STYLES)])
        for name, k in found.items()
    }


def shade(p: NDArray[np.floating]) -> Floats:
    """Shades (ny, nx), 0 black to 1 white, of probabilities; unknown lies in between."""
    free = 1.0 - 2.0 * (1.0 - MIN_FREE_SHADE) * p
    occupied = 2.0 * MAX_OCCUPIED_SHADE * (1.0 - p)
    known = np.where(p < 0.5, free, occupied)
    return np.where(np.isnan(p) | (p == 0.5), UNKNOWN_SHADE, known).astype(np.float64)
