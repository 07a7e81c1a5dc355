"""Range errors of a real scanner."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator


@dataclass(frozen=True)
class Errors:
    """Errors of ranges.

    `noise` [m] + `noise_share` * range is the standard deviation; `step` [m] the rounding, 0 for
    none. `dropout` is the share of lost beams; half of them are "no return" (inf), half invalid
    (nan).
    """

    noise: float
    noise_share: float = 0.0
    step: float = 0.001
    dropout: float = 0.0

    def apply(self, distances: Floats, rng: Generator) -> Floats:
        """Measured ranges (n, b) from true distances (n, b) [m]; inf is no return."""
        ranges = distances.copy()
        if self.noise or self.noise_share:
            deviation = self.noise + self.noise_share * np.where(np.isinf(ranges), 0.0, ranges)
            ranges += deviation * rng.standard_normal(ranges.shape)
        if self.step:
            ranges = np.round(ranges / self.step) * self.step
        if self.dropout:
            chance = rng.random(ranges.shape)
            ranges[chance < self.dropout] = np.nan
            ranges[chance < 0.5 * self.dropout] = np.inf
        return ranges
