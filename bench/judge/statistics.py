"""How sure a mean error or a difference of two is: intervals, paired tests, one sentence in words.

The mean of an autocorrelated series gets the block bootstrap of `bench.judge.bootstrap`, runs that
are independent a permutation test, shares Wilson's interval.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge import bootstrap
from slams.types import Floats

EXACT = 13  # runs up to which all ways to set the signs are counted
FLIPS = 10_000  # ways drawn by chance beyond


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


class Share(NamedTuple):
    """Limits of the confidence interval of a share, both within 0 and 1."""

    low: float
    high: float


def wilson(successes: int, n: int, confidence: float = 0.95) -> Share:
    """Wilson's interval (1927) of the share of successes in `n` independent trials.

    Unlike the usual one it is right for few trials and shares of 0 and 1. No trial tells nothing:
    0 to 1.

    Raises:
        ValueError: more successes than trials, or less than none.
    """
    from scipy.stats import binomtest

    if not 0 <= successes <= n:
        raise ValueError(f"share: got {successes} of {n}, expected 0 to {n} of at least 0")
    if n == 0:
        return Share(0.0, 1.0)
    found = binomtest(successes, n).proportion_ci(confidence, "wilson")
    return Share(float(found.low), float(found.high))


def mcnemar(only_a: int, only_b: int) -> float:
    """The p-value, of both sides, of McNemar's exact test (1947) of two shares over the same runs.

    Args:
        only_a: runs that only a survived.
        only_b: runs that only b survived; those that both did, or neither, tell nothing.
    """
    from scipy.stats import binomtest

    discordant = only_a + only_b
    return float(binomtest(only_a, discordant).pvalue) if discordant else 1.0


def mean_interval(values: Floats, level: float = 0.95, seed: int = 0) -> Interval:
    """The mean of an autocorrelated series (n,) with its confidence interval.

    Values that are not finite are left out.
    """
    series = values[np.isfinite(values)]
    if len(series) < bootstrap.FEWEST:
        return Interval(_plain_mean(series), math.nan, math.nan)
    mean = bootstrap.studentized(series, seed)
    return Interval(mean.value, *bootstrap.limits(mean, level))


def paired(a: Floats, b: Floats, level: float = 0.95, seed: int = 0) -> Paired:
    """The mean difference a - b of two error series (n,) at the same times.

    The p-value, of both sides, is the greatest level at which the interval leaves out 0. Pairs with
    a value that is not finite are left out.
    """
    differences = _differences(a, b)
    n = len(differences)
    if n < bootstrap.FEWEST:
        return Paired(_plain_mean(differences), math.nan, math.nan, math.nan, math.nan, n)
    mean = bootstrap.studentized(differences, seed)
    limits = bootstrap.limits(mean, level)
    return Paired(mean.value, *limits, bootstrap.p_value(mean), _effect(differences), n)


def paired_over_runs(a: Floats, b: Floats, level: float = 0.95, seed: int = 0) -> Paired:
    """The mean difference a - b over independent runs (n,): one number per seed or log, n >= 2.

    The interval is Student's. The p-value is that of the sign-flip permutation test, exact up to 13
    runs, by chance (seeded) above; it cannot be less than `least_p_value`.
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


def least_p_value(n: int) -> float:
    """The least p-value that `paired_over_runs` can find over n runs, whatever they differ.

    Two of the 2^n ways to set the signs are as far out as it gets: five runs never suffice for
    0.05.
    """
    return min(1.0, 2.0 / 2**n) if n <= EXACT else 1.0 / FLIPS


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
    where: str = "",
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
        where: to what the sentence is limited, as "on this log".
    """
    where = where and f" {where}"
    if math.isnan(result.p_value):
        return f"{name_a} and {name_b} can't be compared{where}: only {result.n} common values"
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
        return (
            f"{name_a} and {name_b} can't be distinguished{where}: {amount}, {interval}, {chance}"
        )
    better, worse = (name_a, name_b) if swap else (name_b, name_a)
    amount = f"{abs(difference):.{digits}f} {unit} {what}"
    return f"{better} is better than {worse}{where} by {amount}, {interval}, {chance}"


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


def _sign_flips(differences: Floats, seed: int) -> float:
    """Share of the ways to set the signs that give a mean as far from 0, of both sides."""
    n = len(differences)
    flips: NDArray[np.int64]
    if n <= EXACT:
        flips = np.arange(2**n)[:, None] >> np.arange(n) & 1
    else:
        flips = np.random.default_rng(seed).integers(0, 2, (FLIPS, n))
        flips[0] = 0  # the way it was is one of them
    sums = np.abs((1 - 2 * flips) @ differences)
    rounding = 1e-12 * np.abs(differences).sum()
    return float(np.mean(sums >= abs(differences.sum()) - rounding))
