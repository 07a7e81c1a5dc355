"""What a real scanner makes of true distances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator


@dataclass(frozen=True)
class Errors:
    """What a scanner does to true distances.

    `noise` [m] + `noise_share` * range is the standard deviation; `step` [m] the rounding, 0 for
    none. `dropout` is the share of beams lost, every other of them reported as "nothing there"
    (inf), the rest as invalid (nan).
    """

    noise: float
    noise_share: float = 0.0
    step: float = 0.001
    dropout: float = 0.0

    def apply(self, distances: Floats, rng: Generator) -> Floats:
        """Ranges (n, b) as measured, from true distances (n, b) [m], inf = nothing."""
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
