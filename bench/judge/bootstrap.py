"""The mean of an autocorrelated series by a studentized block bootstrap.

Errors of neighboring updates resemble each other, and an interval that takes them for independent
is far too narrow: at an autocorrelation of 0.9 from one to the next, "95 %" would cover 50 %. So:

1. The autocovariances up to the lag where they vanish give the variance of the mean, by Politis
   and Romano's flat-top window; the lag by the rule of Politis and White, "Automatic block-length
   selection for the dependent bootstrap" (Econometric Reviews 2004, corrected by Patton 2009).
2. Blocks of the series, drawn circularly with replacement, give the distribution of (mean - true
   mean) / its deviation, each draw studentized by its own blocks (Goetze and Kuensch, "Second-order
   correctness of the blockwise bootstrap", Annals of Statistics 1996). Their length is Politis and
   White's too, but never shorter than 4/3 of the window (so that the draws have no more degrees of
   freedom than the variance) nor than a hundredth of the series (only to save time).

Over 2000 seeded series of 3000 values "95 %" covered 94.8, 94.5 and 94.6 % at autocorrelations of
0, 0.5 and 0.9, 94.3 % on squares at 0.9, where percentiles of the bootstrapped means cover 91 %;
of 300 values at 0.9 it covered 93 %, of 100 only 87 %.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.types import Floats

DRAWS = 1999
FEWEST = 10  # values; and least number of blocks, below which nothing is known about chance
MOST_BLOCKS = 100
TAIL = 0.005  # share of the draws on either side from where on Student's t goes on


class Mean(NamedTuple):
    """A mean, its standard deviation, draws of (mean - true mean) / deviation in order, blocks."""

    value: float
    deviation: float
    ratios: Floats
    blocks: int


def studentized(series: Floats, seed: int) -> Mean:
    """The mean of at least `FEWEST` values (n,) by steps 1 and 2 of the module's head."""
    n, mean = len(series), float(series.mean())
    if np.ptp(series) == 0.0:
        return Mean(mean, 0.0, np.zeros(DRAWS), n)
    variance, length = _variance_and_block(_autocovariances(series - mean))
    blocks = n // length
    starts = np.random.default_rng(seed).integers(0, n, (DRAWS, blocks))
    drawn = _circular_means(series - mean, length)[starts]
    with np.errstate(divide="ignore", invalid="ignore"):  # blocks all the same tell of no limit
        ratios = drawn.mean(axis=1) * math.sqrt(blocks) / drawn.std(axis=1, ddof=1)
    ratios = np.sort(np.where(np.isnan(ratios), 0.0, ratios))
    return Mean(mean, math.sqrt(variance / n), ratios, blocks)


def _autocovariances(centered: Floats) -> Floats:
    """Of all lags (n,), by the Fourier transform."""
    n = len(centered)
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(centered, size)
    covariances: Floats = np.fft.irfft(np.abs(spectrum) ** 2, size)[:n] / n
    return covariances


def _variance_and_block(covariances: Floats) -> tuple[float, int]:
    """Variance of the mean times n, and the length of a block."""
    n = len(covariances)
    window = min(2 * _vanishing_lag(covariances), n // 5)
    lags = np.arange(1, window + 1)
    flat_top = 2.0 * np.minimum(1.0, 2.0 * (1.0 - lags / window))
    shares = flat_top * covariances[1 : window + 1]
    variance = covariances[0] + shares.sum()
    if variance <= 0.0:  # a flat top can be; Bartlett's window never
        flat_top = 2.0 * (1.0 - lags / (window + 1))
        variance = covariances[0] + (flat_top * covariances[1 : window + 1]).sum()
    best = (1.5 * float((lags * shares).sum() / variance) ** 2 * n) ** (1.0 / 3.0)
    lowest, highest = max(1, n // MOST_BLOCKS), max(1, n // FEWEST)
    length = int(np.clip(round(max(best, 4.0 / 3.0 * window)), lowest, highest))
    # taking the series' own mean out took this share of the variance with it
    return float(variance / (1.0 - (1.0 + flat_top.sum()) / n)), length


def _vanishing_lag(covariances: Floats) -> int:
    """The last lag before a run of insignificant autocorrelations, at least 1."""
    n = len(covariances)
    run = max(5, math.ceil(math.sqrt(math.log10(n))))
    limit = 2.0 * math.sqrt(math.log10(n) / n) * covariances[0]
    small = np.convolve(np.abs(covariances[1:]) < limit, np.ones(run), "valid") > run - 0.5
    return max(1, int(np.argmax(small))) if small.any() else n // 2


def _circular_means(centered: Floats, length: int) -> Floats:
    """Mean of the block (n,) that begins at each value and goes on around the end."""
    around = np.concatenate([centered, centered[: length - 1]])
    total = np.concatenate([[0.0], np.cumsum(around)])
    means: Floats = (total[length:] - total[:-length]) / length
    return means


def limits(mean: Mean, level: float) -> tuple[float, float]:
    """Limits of the mean's interval: the greatest ratio gives the least mean."""
    if mean.deviation == 0.0:
        return mean.value, mean.value
    beyond = 0.5 * (1.0 - level)
    least, greatest = _quantile(mean.ratios, beyond), -_quantile(-mean.ratios[::-1], beyond)
    return mean.value - greatest * mean.deviation, mean.value - least * mean.deviation


def _quantile(ratios: Floats, share: float) -> float:
    """The draw, in order, that a small share of them does not exceed."""
    return float(ratios[max(0, math.floor(share * (len(ratios) + 1)) - 1)])


def p_value(mean: Mean) -> float:
    """Twice the share of draws on the ratio's side of 0 or the other that go beyond it."""
    if mean.deviation == 0.0:
        return 0.0 if mean.value else 1.0
    ratio = mean.value / mean.deviation
    below = _tail(mean.ratios, ratio, mean.blocks - 1)
    above = _tail(-mean.ratios[::-1], -ratio, mean.blocks - 1)
    return min(1.0, 2.0 * min(below, above))


def _tail(ratios: Floats, ratio: float, freedom: int) -> float:
    """Share of the draws, in order, below a ratio; far out by a Student's t laid on the draws."""
    from scipy.special import stdtr, stdtrit

    share = (int(np.searchsorted(ratios, ratio, "right")) + 1) / (len(ratios) + 1)
    last = _quantile(ratios, TAIL)
    if share > TAIL or not -math.inf < last < 0.0:
        return share
    return float(stdtr(freedom, stdtrit(freedom, TAIL) * ratio / last))
