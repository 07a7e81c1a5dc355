"""Which things of a scan stand where beams of earlier scans went through."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.jit import njit
from slams.types import Floats, Ranges

THING = 0.6  # m, extent of what may walk about: two legs, or a body
APART = 0.15  # m, between two things, at least
BEAMS_APART = 2.0  # beam widths between two things, at least
LEG = 0.1  # m; beams farther apart than that may have missed what stood there
SOME = 0.25  # of the beams on a thing, from which all of it moves


class Earlier(NamedTuple):
    """Earlier scans: lasers (k, 4) at x, y [m] in the map, cosine and sine of their heading.

    `ranges` (k, beams) [m], 0 without return, the first beam at the angle `first`, `step` [rad]
    from one to the next.
    """

    lasers: Floats
    ranges: Ranges
    first: float
    step: float


@njit(inner=True)
def was_free(earlier: Any, k: int, x: float, y: float, doubt: Any) -> bool:
    """Whether beams of an earlier scan, three in a row, went on behind x, y [m].

    ours: the two beside it as well, as walls seen edge-on are near and far side by side. Not told
    where the doubt of the pose leads to other beams. doubt: plain, how far they have to have gone
    on [m], the pose's own beside the beam [m] and of the heading [rad].
    """
    lasers, ranges, first, step = earlier
    margin, beside, heading = doubt
    dx, dy = x - lasers[k, 0], y - lasers[k, 1]
    square = dx * dx + dy * dy
    far = math.sqrt(square)
    if max(abs(step) * far, beside + heading * far) > LEG:
        return False
    c, s = lasers[k, 2], lasers[k, 3]
    turn = math.atan2(c * dy - s * dx, c * dx + s * dy) - first
    around = 2.0 * math.pi / abs(step)
    beam = turn / step + 0.5
    i = math.floor(beam - around * math.floor(beam / around))
    if i < 1 or i > ranges.shape[1] - 2:
        return False
    least = far + margin
    nearest = min(ranges[k, i - 1], ranges[k, i], ranges[k, i + 1])
    return bool(nearest > least)


@njit
def moving(
    pieces: Floats, pose: Any, mount: Any, earlier: Any, doubt: Any, out: NDArray[np.bool_]
) -> float:
    """Which pieces (n, 5) of a scan lie on small things that stand where there was nothing.

    ours: free space contradicts what moves. A thing are pieces that the laser sees side by side;
    it moves as a whole, as some of it is always hidden by where it stood before. pose of the base
    and mount of the laser: plain x, y [m], theta [rad]; `Earlier` as a plain tuple, too; doubt as
    of `was_free`; out (n,); returns how many beams.
    """
    n, found, first = pieces.shape[0], 0.0, 0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    sparse = BEAMS_APART * earlier[3]
    while first < n:
        last = first
        while last + 1 < n:
            x, y = pieces[last, 0], pieces[last, 1]
            ax, ay = x - mount[0], y - mount[1]
            dx, dy = pieces[last + 1, 0] - x, pieces[last + 1, 1] - y
            gap = max(APART * APART, sparse * sparse * (ax * ax + ay * ay))
            if dx * dx + dy * dy > gap:
                break
            last += 1
        dx, dy = pieces[last, 0] - pieces[first, 0], pieces[last, 1] - pieces[first, 1]
        beams = free = 0.0
        if dx * dx + dy * dy <= THING * THING:
            for i in range(first, last + 1):
                x = pose[0] + c * pieces[i, 0] - s * pieces[i, 1]
                y = pose[1] + s * pieces[i, 0] + c * pieces[i, 1]
                beams += pieces[i, 4]
                for k in range(earlier[0].shape[0]):
                    if was_free(earlier, k, x, y, doubt):
                        free += pieces[i, 4]
                        break
        moves = free > SOME * beams
        for i in range(first, last + 1):
            out[i] = moves
        found += beams if moves else 0.0
        first = last + 1
    return found
