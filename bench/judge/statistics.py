"""How sure a mean error or a difference of two is: intervals, paired tests, one sentence in words.

Errors of neighboring updates resemble each other, and an interval that takes them for independent
is far too narrow: at an autocorrelation of 0.9 from one to the next, "95 %" would cover 50 %. Here
the mean of a series gets a studentized block bootstrap:

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
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slams.types import Floats

DRAWS = 1999
FEWEST = 10  # values; and least number of blocks, below which nothing is known about chance
MOST_BLOCKS = 100
TAIL = 0.005  # share of the draws on either side from where on Student's t goes on


class Interval(NamedTuple):
    """A mean with the limits of its confidence interval; limits are nan for too short a series."""

    value: float
    low: float
    high: float


class Paired(NamedTuple):
    """A mean difference a - b with its confidence interval, how likely chance alone makes it.

    `effect` is Cohen's d of pairs, the mean difference in standard deviations of the differences
    [Cohen88], which does not grow with `n`, the number of pairs.
    """

    difference: float
    low: float
    high: float
    p_value: float
    effect: float
    n: int


class _Mean(NamedTuple):
    """A mean, its standard deviation, draws of (mean - true mean) / deviation in order, blocks."""

    value: float
    deviation: float
    ratios: Floats
    blocks: int


def mean_interval(values: Floats, level: float = 0.95, seed: int = 0) -> Interval:
    """The mean of an autocorrelated series (n,) with its confidence interval.

    Values that are not finite are left out.
    """
    series = values[np.isfinite(values)]
    if len(series) < FEWEST:
        return Interval(_plain_mean(series), math.nan, math.nan)
    mean = _bootstrap(series, seed)
    return Interval(mean.value, *_limits(mean, level))


def paired(a: Floats, b: Floats, level: float = 0.95, seed: int = 0) -> Paired:
    """The mean difference a - b of two error series (n,) at the same times.

    The p-value, of both sides, is the greatest level at which the interval leaves out 0. Pairs with
    a value that is not finite are left out.
    """
    differences = _differences(a, b)
    n = len(differences)
    if n < FEWEST:
        return Paired(_plain_mean(differences), math.nan, math.nan, math.nan, math.nan, n)
    mean = _bootstrap(differences, seed)
    limits = _limits(mean, level)
    return Paired(mean.value, *limits, _p_value(mean), _effect(differences), n)


def paired_over_runs(a: Floats, b: Floats, level: float = 0.95, seed: int = 0) -> Paired:
    """The mean difference a - b over independent runs (n,): one number per seed or log, n >= 2.

    The interval is Student's. The p-value is that of the sign-flip permutation test, exact up to 13
    runs, by chance (seeded) above; it cannot be less than 2 / 2^n, so that five runs never suffice
    for 0.05.
    """
    from scipy.special import stdtrit

    differences = _differences(a, b)
    n = len(differences)
    if n < 2:
        return Paired(_plain_mean(differences), math.nan, math.nan, math.nan, math.nan, n)
    mean = float(differences.mean())
    half = float(stdtrit(n - 1, 0.5 + 0.5 * level) * differences.std(ddof=1) / math.sqrt(n))
    p_value = _sign_flips(differences, seed)
    return Paired(mean, mean - half, mean + half, p_value, _effect(differences), n)


def adjusted(p_values: Sequence[float]) -> list[float]:
    """The p-values of several tests after Holm (1979), in the order given; nan stays nan.

    Holm's, not a false discovery rate, as every pair gets a sentence that is read alone: the chance
    of even one wrong sentence stays below the level, however the tests depend on each other.
    """
    p = np.asarray(p_values, np.float64)
    tested = np.flatnonzero(~np.isnan(p))
    order = tested[np.argsort(p[tested], kind="stable")]
    left = np.arange(len(order), 0, -1)
    p[order] = np.minimum(np.maximum.accumulate(left * p[order]), 1.0)
    return [float(value) for value in p]


def sentence(
    name_a: str,
    name_b: str,
    result: Paired,
    unit: str = "mm",
    scale: float = 1e3,
    what: str = "per second",
    level: float = 0.95,
) -> str:
    """What a comparison of two errors says, in words: less is better.

    Args:
        name_a: what the difference counts from.
        name_b: what was subtracted.
        result: their difference; its p-value may be one from `adjusted`.
        unit: of the numbers printed.
        scale: from the difference's unit to that one.
        what: the span of the errors.
        level: that of the interval.
    """
    if math.isnan(result.p_value):
        return f"{name_a} and {name_b} can't be compared: only {result.n} common values"
    sure = result.p_value < 1.0 - level and not result.low <= 0.0 <= result.high
    swap = sure and result.difference < 0.0
    difference, low, high = (scale * value for value in result[:3])
    if swap:
        low, high = -high, -low
    digits = _digits(high - low)
    low_text, high_text = _fixed(low, digits), _fixed(high, digits)
    interval = f"{level * 100:g} % interval {low_text} to {high_text}"
    chance = _chance(result.p_value)
    if not sure:
        amount = f"difference {_fixed(difference, digits)} {unit} {what}"
        return f"{name_a} and {name_b} can't be told apart: {amount}, {interval}, {chance}"
    better, worse = (name_a, name_b) if swap else (name_b, name_a)
    amount = f"{abs(difference):.{digits}f} {unit} {what}"
    return f"{better} is better than {worse} by {amount}, {interval}, {chance}"


def _fixed(value: float, digits: int) -> str:
    """A number with so many decimals, zero without a sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _digits(width: float) -> int:
    """Decimals that show the width of an interval with one digit, or two that begin with 1."""
    return max(0, -math.floor(math.log10(width / 3.9))) if width > 0.0 else 2


def _chance(p_value: float) -> str:
    if p_value < 0.001:
        return "p < 0.001"
    return f"p = {p_value:.3f}" if p_value < 0.1 else f"p = {p_value:.2f}"


def _differences(a: Floats, b: Floats) -> Floats:
    if a.shape != b.shape:
        raise ValueError(f"pairs: got {a.shape} and {b.shape} values, expected as many of each")
    differences: Floats = a - b
    return differences[np.isfinite(differences)]


def _plain_mean(values: Floats) -> float:
    return float(values.mean()) if len(values) else math.nan


def _effect(differences: Floats) -> float:
    """Cohen's d of pairs; 0 for no difference at all, infinite for a constant one."""
    mean, deviation = float(differences.mean()), float(differences.std(ddof=1))
    if np.ptp(differences) == 0.0:
        return math.copysign(math.inf, mean) if mean else 0.0
    return mean / deviation


def _bootstrap(series: Floats, seed: int) -> _Mean:
    """Steps 1 and 2 of the module's head."""
    n, mean = len(series), float(series.mean())
    if np.ptp(series) == 0.0:
        return _Mean(mean, 0.0, np.zeros(DRAWS), n)
    variance, length = _variance_and_block(_autocovariances(series - mean))
    blocks = n // length
    starts = np.random.default_rng(seed).integers(0, n, (DRAWS, blocks))
    drawn = _circular_means(series - mean, length)[starts]
    with np.errstate(divide="ignore", invalid="ignore"):  # blocks all the same tell of no limit
        ratios = drawn.mean(axis=1) * math.sqrt(blocks) / drawn.std(axis=1, ddof=1)
    ratios = np.sort(np.where(np.isnan(ratios), 0.0, ratios))
    return _Mean(mean, math.sqrt(variance / n), ratios, blocks)


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


def _limits(mean: _Mean, level: float) -> tuple[float, float]:
    """Limits of the interval: the greatest ratio gives the least mean."""
    if mean.deviation == 0.0:
        return mean.value, mean.value
    beyond = 0.5 * (1.0 - level)
    least, greatest = _quantile(mean.ratios, beyond), -_quantile(-mean.ratios[::-1], beyond)
    return mean.value - greatest * mean.deviation, mean.value - least * mean.deviation


def _quantile(ratios: Floats, share: float) -> float:
    """The draw, in order, that a small share of them does not exceed."""
    return float(ratios[max(0, math.floor(share * (len(ratios) + 1)) - 1)])


def _p_value(mean: _Mean) -> float:
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


def _sign_flips(differences: Floats, seed: int) -> float:
    """Share of the ways to set the signs that give a mean as far from 0, of both sides."""
    n = len(differences)
    flips: NDArray[np.int64]
    if n <= 13:
        flips = np.arange(2**n)[:, None] >> np.arange(n) & 1
    else:
        flips = np.random.default_rng(seed).integers(0, 2, (10_000, n))
        flips[0] = 0  # the way it was is one of them
    sums = np.abs((1 - 2 * flips) @ differences)
    rounding = 1e-12 * np.abs(differences).sum()
    return float(np.mean(sums >= abs(differences.sum()) - rounding))
