"""Start luck: the same log begun at several scans tells a good algorithm from a lucky first map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

LATEST_SHARE = 0.1  # of a log that may be left out at its start
LATEST = 500  # scans that may, as so many have been left out of Intel in the measurements


class Starts(NamedTuple):
    """What came of a log begun at `n` scans.

    `mean` is that of the runs that were not lost, nan without any. In `median` and `worst` a lost
    run is as bad as can be, inf. `above` of the runs were above the limit, lost ones included.
    """

    n: int
    mean: float
    median: float
    worst: float
    above: int


def start_scans(scans: int, n: int) -> NDArray[np.int64]:
    """Scans to begin at, evenly from 0 to a tenth of the log's `scans` (`LATEST` at most).

    As many as `n`, both 1 or more, or fewer in a log too short for so many different ones.
    """
    latest = min(LATEST, int(LATEST_SHARE * scans))
    return np.unique(np.round(np.linspace(0, latest, n)).astype(np.int64))


def summarize_starts(errors: Sequence[float | None], limit: float) -> Starts:
    """The spread of one error over the starts, 1 or more; None is a lost run."""
    values = np.array([math.inf if error is None else error for error in errors])
    found = values[np.isfinite(values)]
    return Starts(
        n=len(values),
        mean=float(found.mean()) if len(found) else math.nan,
        median=float(np.median(values)),
        worst=float(values.max()),
        above=int((values > limit).sum()),
    )
