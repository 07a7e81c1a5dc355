"""Parameters of the line cells, and of the fit to them."""

from __future__ import annotations

from dataclasses import dataclass

from slams.params import param
from slams.scan.params import ScanParams


@dataclass(frozen=True)
class RefineParams(ScanParams):
    """Parameters of the refinement after the paper's mechanism, by a fit to lines."""

    refine: bool = param(
        True,
        "1",
        "fit lines inside the cells after the paper's mechanism",
        source="ours: exact to below a cell",
        switch=True,
    )
    reach: int = param(
        1,
        "cell",
        "cells on each side of the wall that a hit enters",
        source="ours: basin",
        low=0,
        high=5,
    )
    side: int = param(
        3,
        "cell",
        "greatest number of cells along the wall that fill the gap to the next beam",
        source="ours: sparse lasers",
        low=0,
        high=10,
    )
    weight_cap: float = param(
        200.0,
        "1",
        "greatest weight of a cell's line, in hits",
        source="ours: stiff, yet follows a moved wall",
        low=10.0,
    )
    softness: float = param(
        0.05,
        "m",
        "distance to a line that halves a beam's weight; at least three times the noise",
        source="ours: a cell",
        low=0.001,
    )
    line_steps: int = param(
        12,
        "1",
        "Gauss-Newton steps on the lines, at most",
        source="ours: 3 are typical",
        low=1,
        high=1000,
    )
    converged: float = param(
        2e-4,
        "m",
        "a step below this (and this times 1 rad/m) is the last; with many beams four times this",
        source="ours: a tenth of the pose's error; with many beams the next step is a tenth",
        low=0.0,
    )
