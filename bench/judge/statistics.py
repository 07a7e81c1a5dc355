"""Significance of differences: paired tests, Holm's correction, a sentence for the result.

Errors of one drive are autocorrelated: Student's t with the deviation of
`bench.judge.autocorrelation`. Independent drives: the tests of Wilcoxon and McNemar. Shares:
Wilson's interval.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bench.judge import autocorrelation
from slams.types import Floats

CONFIDENCE_LEVEL = 0.95  # of the intervals
SIGNIFICANCE_LEVEL = 0.05  # of the tests


class Paired(NamedTuple):
    """The mean difference a - b of `n` pairs, its interval and its p-value."""

    difference: float
    low: float
    high: float
    p_value: float
    n: int


class Share(NamedTuple):
    """k of n, and the confidence interval of the share, both limits within 0 and 1."""

    k: int
    n: int
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.k} of {self.n}"


def wilson(k: int, n: int, confidence: float = 0.95) -> Share:
    """The share of `k` successes in `n` independent trials with Wilson's interval (1927).

    Unlike the normal approximation it holds for few trials and for shares of 0 and 1. Without any
    trial it is 0 to 1.
    """
    from scipy.stats import binomtest

    if n == 0:
        return Share(k, n, 0.0, 1.0)
    found = binomtest(k, n).proportion_ci(confidence, "wilson")
    return Share(k, n, float(found.low), float(found.high))


def mcnemar(only_a: int, only_b: int) -> float:
    """The two-sided p-value of McNemar's exact test (1947) of two shares over the same runs.

    Args:
        only_a: runs that only a survived.
        only_b: runs that only b survived; runs that both or neither survived have no effect.
    """
    from scipy.stats import binomtest

    discordant = only_a + only_b
    return float(binomtest(only_a, discordant).pvalue) if discordant else 1.0


def paired(a: Floats, b: Floats, level: float = CONFIDENCE_LEVEL) -> Paired:
    """The mean difference a - b of two error series (n,) at the same times.

    Interval and two-sided p-value are Student's. Pairs with a value that is not finite are left
    out.
    """
    from scipy.special import stdtr

    differences = _differences(a, b)
    n = len(differences)
    if n < autocorrelation.MIN_SAMPLES:
        return _untested(differences)
    mean, deviation, blocks = autocorrelation.mean_of(differences)
    if deviation == 0.0:
        return Paired(mean, mean, mean, 0.0 if mean else 1.0, n)
    p_value = 2.0 * float(stdtr(blocks - 1, -abs(mean) / deviation))
    return Paired(*_student(mean, deviation, blocks, level), p_value, n)


def paired_over_runs(a: Floats, b: Floats, level: float = CONFIDENCE_LEVEL) -> Paired:
    """The mean difference a - b over independent runs (n,): one number per seed or log, n >= 2.

    The interval is Student's, the p-value that of `wilcoxon`; it cannot be less than 2^(1 - n).
    """
    differences = _differences(a, b)
    n = len(differences)
    if n < 2:
        return _untested(differences)
    mean, deviation = float(differences.mean()), float(differences.std(ddof=1)) / math.sqrt(n)
    return Paired(*_student(mean, deviation, n, level), wilcoxon(differences), n)


def _student(mean: float, deviation: float, n: int, level: float) -> tuple[float, float, float]:
    """A mean with the limits of its interval, from its deviation over n independent values."""
    from scipy.special import stdtrit

    half = float(stdtrit(n - 1, 0.5 + 0.5 * level)) * deviation
    return mean, mean - half, mean + half


def _untested(differences: Floats) -> Paired:
    """The mean of too few values, without interval and p-value."""
    mean = float(differences.mean()) if len(differences) else math.nan
    return Paired(mean, math.nan, math.nan, math.nan, len(differences))


def wilcoxon(differences: Floats) -> float:
    """The two-sided p-value of Wilcoxon's signed-rank test (1945) of the pairs (n,)."""
    from scipy import stats

    return float(stats.wilcoxon(differences).pvalue) if np.any(differences) else 1.0


def adjusted(p_values: Sequence[float]) -> list[float]:
    """The p-values of several tests after Holm (1979), in the order given; nan stays nan.

    Holm's correction, not a false discovery rate, because each pair has its own sentence: the
    probability of any wrong sentence stays below the level for any dependence of the tests.
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
    what: str = "per second",
    where: str = "",
) -> str:
    """The result of a comparison of two errors as a sentence; smaller errors are better.

    Args:
        name_a: name of the minuend.
        name_b: name of the subtrahend.
        result: their difference [m] or [rad]; its p-value may be one from `adjusted`.
        unit: of the numbers printed, mm or mrad.
        what: the span of the errors.
        where: scope of the sentence, for instance "on this log".
    """
    where = where and f" {where}"
    if math.isnan(result.p_value):
        return f"{name_a} and {name_b} can't be compared{where}: only {result.n} common values"
    significant = result.p_value < 1.0 - CONFIDENCE_LEVEL and not result.low <= 0.0 <= result.high
    swap = significant and result.difference < 0.0
    difference, low, high = (1e3 * value for value in result[:3])
    if swap:
        low, high = -high, -low
    digits = _digits(high - low)
    low_text, high_text = _fixed(low, digits), _fixed(high, digits)
    interval = f"{CONFIDENCE_LEVEL * 100:g} % interval {low_text} to {high_text}"
    chance = _chance(result.p_value)
    if not significant:
        amount = f"difference {_fixed(difference, digits)} {unit} {what}"
        return (
            f"{name_a} and {name_b} can't be distinguished{where}: {amount}, {interval}, {chance}"
        )
    better, worse = (name_a, name_b) if swap else (name_b, name_a)
    amount = f"{abs(difference):.{digits}f} {unit} {what}"
    return f"{better} is better than {worse}{where} by {amount}, {interval}, {chance}"


def _fixed(value: float, digits: int) -> str:
    """A number with `digits` decimals, zero without a sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _digits(width: float) -> int:
    """Decimals that show an interval's width with one digit, or with two if the first is 1."""
    return max(0, -math.floor(math.log10(width / 3.9))) if width > 0.0 else 2


def _chance(p_value: float) -> str:
    if p_value < 0.001:
        return "p < 0.001"
    return f"p = {p_value:.3f}" if p_value < 0.1 else f"p = {p_value:.2f}"


def _differences(a: Floats, b: Floats) -> Floats:
    differences: Floats = a - b
    return differences[np.isfinite(differences)]
