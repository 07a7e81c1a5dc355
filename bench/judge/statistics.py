"""How sure a difference of two errors is: paired tests, Holm's correction, one sentence in words.

Errors of one drive, which are autocorrelated, get the block bootstrap of `bench.judge.bootstrap`,
drives that are independent Wilcoxon's and McNemar's tests, shares Wilson's interval.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bench.judge import bootstrap
from slams.types import Floats


class Paired(NamedTuple):
    """A mean difference a - b of `n` pairs with its interval, how likely chance alone makes it."""

    difference: float
    low: float
    high: float
    p_value: float
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


def paired(a: Floats, b: Floats, level: float = 0.95, seed: int = 0) -> Paired:
    """The mean difference a - b of two error series (n,) at the same times.

    The p-value, of both sides, is the greatest level at which the interval leaves out 0. Pairs with
    a value that is not finite are left out.
    """
    differences = _differences(a, b)
    n = len(differences)
    if n < bootstrap.FEWEST:
        return Paired(_plain_mean(differences), math.nan, math.nan, math.nan, n)
    mean = bootstrap.studentized(differences, seed)
    return Paired(mean.value, *bootstrap.limits(mean, level), bootstrap.p_value(mean), n)


def paired_over_runs(a: Floats, b: Floats, level: float = 0.95) -> Paired:
    """The mean difference a - b over independent runs (n,): one number per seed or log, n >= 2.

    The interval is Student's, the p-value that of `wilcoxon`; it cannot be less than
    `least_p_value`.
    """
    from scipy.special import stdtrit

    differences = _differences(a, b)
    n = len(differences)
    if n < 2:
        return Paired(_plain_mean(differences), math.nan, math.nan, math.nan, n)
    mean = float(differences.mean())
    half = float(stdtrit(n - 1, 0.5 + 0.5 * level) * differences.std(ddof=1) / math.sqrt(n))
    return Paired(mean, mean - half, mean + half, wilcoxon(differences), n)


def wilcoxon(differences: Floats) -> float:
    """The p-value, of both sides, of Wilcoxon's signed-rank test (1945) of the pairs (n,)."""
    from scipy import stats

    return float(stats.wilcoxon(differences).pvalue) if np.any(differences) else 1.0


def least_p_value(n: int) -> float:
    """The least p-value that `wilcoxon` can find over n runs, whatever they differ.

    Two of the 2^n ways to set the signs are as far out as it gets: five runs never suffice for
    0.05.
    """
    return min(1.0, 2.0 ** (1 - n))


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
