"""Kernels of a pose's covariance from scan to scan: predicted, seen, put together.

All matrices are (3, 3) of x, y [m], theta [rad] in the map's frame, covariances or informations
(inverse covariances). x, y is the direction that a scan sees worst, a unit vector.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slams.geometry import inverse3, widened
from slams.jit import njit
from slams.types import Floats

LEAST = 1e-4  # 1/m^2, 1/rad^2: information of a scan, along what it does not see


@njit
def along(of: Floats, x: float, y: float) -> float:
    """What a matrix has in a direction, a^T M a. ours."""
    what: float = x * x * of[0, 0] + 2.0 * x * y * of[0, 1] + y * y * of[1, 1]
    return what


@njit(inner=True)
def raised(of: Floats, x: float, y: float, more: float) -> Floats:
    """A matrix with so much more in a direction: M + more a a^T. ours."""
    out = of.copy()
    out[0, 0] += more * x * x
    out[1, 1] += more * y * y
    out[0, 1] += more * x * y
    out[1, 0] += more * x * y
    return out


@njit
def stretched(of: Floats, x: float, y: float, by: float) -> Floats:
    """A matrix so many times as long in a direction: S M S with S = I + (by - 1) a a^T. ours."""
    out, more = of.copy(), by - 1.0
    if more == 0.0:
        return out
    xx, xy, yy, xt, yt = of[0, 0], of[0, 1], of[1, 1], of[0, 2], of[1, 2]
    to_x, to_y, turn = x * xx + y * xy, x * xy + y * yy, x * xt + y * yt
    square = more * (x * to_x + y * to_y)
    ax, ay = to_x + 0.5 * square * x, to_y + 0.5 * square * y
    mixed = more * (x * ay + y * ax)
    out[0, 0] += 2.0 * more * x * ax
    out[1, 1] += 2.0 * more * y * ay
    out[0, 1] += mixed
    out[1, 0] += mixed
    out[0, 2] += more * x * turn
    out[2, 0] += more * x * turn
    out[1, 2] += more * y * turn
    out[2, 1] += more * y * turn
    return out


@njit(inner=True)
def carried(before: Floats, heading: float, step: Any, variance: Any) -> Floats:
    """Covariance of a pose after a step, from that of the pose before, whose heading [rad] is told.

    [Thrun05] 5.4: an error of the heading before swings the step. step: plain x, y, theta seen
    from the pose before; variance: those of its `Chord`, seen from half way.
    """
    c, s = math.cos(heading), math.sin(heading)
    x, y = c * step[0] - s * step[1], s * step[0] + c * step[1]
    ahead, aside, turn = variance
    half = heading + 0.5 * step[2]
    c, s = math.cos(half), math.sin(half)
    x_turn, y_turn = -0.5 * y, 0.5 * x  # an error of the turn turns the chord by half
    out = before.copy()
    tt = before[2, 2]
    xt, yt = before[0, 2] - y * tt, before[1, 2] + x * tt
    xy = before[0, 1] + x * before[0, 2] - y * yt
    out[0, 0] -= y * (before[0, 2] + xt)
    out[1, 1] += x * (before[1, 2] + yt)
    out[0, 0] += c * c * ahead + s * s * aside + x_turn * x_turn * turn
    out[1, 1] += s * s * ahead + c * c * aside + y_turn * y_turn * turn
    out[2, 2] += turn
    out[0, 1] = out[1, 0] = xy + (c * s * (ahead - aside) + x_turn * y_turn * turn)
    out[0, 2] = out[2, 0] = xt + x_turn * turn
    out[1, 2] = out[2, 1] = yt + y_turn * turn
    return out


@njit
def foreseen(
    before: Floats, heading: float, step: Any, variance: Any, sees: Any, learned: Any
) -> tuple[Floats, Floats, Floats]:
    """The prediction's covariance, the same with caution, and the inverse of that.

    ours. `before`, heading, step, variance as of `carried`. sees: x, y and `blind`, how little is
    seen there, 0 to 1; learned: whether errors of `before` and of the step are one and the same
    where nothing is seen (deviations add there, not variances), the scale of what is expected (but
    not where nothing was seen that it could come from), and the caution.
    """
    x, y, blind = sees
    same, scale, caution = learned
    if same > 0.0:
        both = carried(np.zeros((3, 3)), heading, step, variance)
        more = 2.0 * blind * math.sqrt(along(before, x, y) * along(both, x, y))
        before = raised(before, x, y, more)
    predicted = carried(before, heading, step, variance)
    if scale > 1.0:
        for i in range(3):
            for k in range(3):
                predicted[i, k] *= scale
        predicted = stretched(predicted, x, y, scale ** (-0.5 * blind))
    expected = predicted.copy()
    for i in range(3):
        for k in range(3):
            expected[i, k] *= caution
    return predicted, expected, inverse3(expected)


@njit
def held_back(
    seen: Floats, honest: Floats, known: Floats, off: Floats, x: float, y: float
) -> float:
    """How far [m] along x, y to move a match that lies `off` (3,) from the prediction.

    Solution remapping in [Zhang16], but gradually: a match of what was `seen` lies between the
    prediction, of information `known`, and where the scan alone would have it; that is fused once
    more by what it is worth, `honest`.
    """
    prior = along(widened(known, off)[0], x, y)
    claimed, worth = along(seen, x, y), along(honest, x, y)
    if worth >= claimed:
        return 0.0
    keep = worth * (claimed + prior) / (claimed * (worth + prior))
    moved: float = (keep - 1.0) * (x * off[0] + y * off[1])
    return moved


@njit
def settled(honest: Floats, known: Floats, off: Floats) -> tuple[Floats, Floats, float]:
    """Covariance of a match by its scan alone, and with the prediction, `off` (3,) to the match.

    ours: the informations add; the prediction's is that of `widened`. Also the evenness of what the
    scan alone tells.
    """
    alone = honest.copy()
    for k in range(3):
        alone[k, k] += LEAST
    both = widened(known, off)[0]
    for i in range(3):
        for k in range(3):
            both[i, k] += honest[i, k]
    covariance = inverse3(alone)
    return covariance, inverse3(both), evenness(covariance)


@njit(inner=True)
def evenness(covariance: Floats) -> float:
    """Ratio of the least to the largest variance of x and y in a (3, 3), 0 to 1. ours."""
    half = 0.5 * (covariance[0, 0] + covariance[1, 1])
    spread = math.hypot(0.5 * (covariance[0, 0] - covariance[1, 1]), covariance[0, 1])
    ratio: float = max(half - spread, 0.0) / (half + spread)
    return ratio


@njit
def by_scan(seen: Floats, known: Floats, off: Floats) -> Floats:
    """How far (3,) from the prediction the scan alone has a pose that lies between the two, `off`.

    ours: off + seen^-1 known off.
    """
    alone, out, pull = seen.copy(), off.copy(), off.copy()
    for i in range(3):
        alone[i, i] += LEAST
        pull[i] = known[i, 0] * off[0] + known[i, 1] * off[1] + known[i, 2] * off[2]
    inverse = inverse3(alone)
    for i in range(3):
        out[i] += inverse[i, 0] * pull[0] + inverse[i, 1] * pull[1] + inverse[i, 2] * pull[2]
    return out


@njit
def surprise(expected: Floats, alone: Floats, by_scan: Floats) -> float:
    """The normalized innovation squared: d^T (C + S)^-1 d of d = `by_scan` (3,). ours."""
    both = expected.copy()
    for i in range(3):
        for k in range(3):
            both[i, k] += alone[i, k]
    inverse, square = inverse3(both), 0.0
    for i in range(3):
        for k in range(3):
            square += by_scan[i] * inverse[i, k] * by_scan[k]
    return square
