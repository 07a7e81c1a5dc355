"""Times and spells of degradations, for logs whose stamps may jump back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats

if TYPE_CHECKING:
    from numpy.random import Generator

Mask = NDArray[np.bool_]

START_SHARES = (0.3, 0.7)  # of the log, between which a spell begins


def elapsed(t: Floats) -> Floats:
    """Time (n,) [s] since the first of the stamps t (n,); the clock stands still on jumps back."""
    return np.concatenate([[0.0], np.cumsum(np.maximum(np.diff(t), 0.0))])


def spell(t: Floats, seconds: float, rng: Generator) -> Mask:
    """Mask (n,) of the stamps in a spell of `seconds` in the middle of the log; never the first."""
    clock = elapsed(t)
    start = rng.uniform(*START_SHARES) * max(0.0, clock[-1] - seconds)
    within: Mask = (clock >= start) & (clock < start + seconds)
    within[0] = False
    return within


def moment(t: Floats, rng: Generator) -> int:
    """Index of a random stamp in the middle of t (n,)."""
    clock = elapsed(t)
    return int(np.searchsorted(clock, rng.uniform(*START_SHARES) * clock[-1]))


def at_rate(t: Floats, hertz: float) -> NDArray[Any]:
    """Indices of the stamps t (n,) nearest to an even rate; all if they are slower."""
    clock = elapsed(t)
    half = 0.5 * float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    tick = np.floor((clock + max(half, 0.0)) * hertz)
    return np.flatnonzero(np.diff(tick, prepend=-1.0) > 0.0)
