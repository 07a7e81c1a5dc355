"""Significance: coverage of the intervals, tests of pairs, Holm, and the sentence."""

import math

import numpy as np
import pytest
from scipy import signal, stats

from bench.judge.statistics import Paired, adjusted, paired, paired_over_runs, sentence, wilson


def mean_interval(values, level=0.95):
    """The mean of a series with its limits: its difference to nothing."""
    return paired(values, np.zeros(len(values)), level)[:3]


def autoregressive(phi, series, n, seed):
    """Series (series, n) of mean 0 and deviation 1 with autocorrelation phi ** lag."""
    noise = np.random.default_rng(seed).standard_normal((series, n + 300))
    return math.sqrt(1.0 - phi**2) * signal.lfilter([1.0], [1.0, -phi], noise, axis=1)[:, 300:]


def coverage(values, mean):
    intervals = [mean_interval(row) for row in values]
    return np.mean([low <= mean <= high for _, low, high in intervals])


def overlapping(series):
    """Sums over spans of 40 values that share most of them, of deviation 1."""
    total = np.cumsum(np.random.default_rng(3).standard_normal((series, 3040)), axis=1)
    return (total[:, 40:] - total[:, :-40]) / math.sqrt(40.0)


@pytest.mark.parametrize(
    ("values", "mean", "least"),
    [
        *((autoregressive(phi, 600, 3000, 1), 0.0, 0.93) for phi in (0.0, 0.5, 0.9)),
        (np.abs(autoregressive(0.9, 2000, 3000, 15)), math.sqrt(2.0 / math.pi), 0.93),
        (autoregressive(0.9, 2000, 3000, 15) ** 2, 1.0, 0.93),
        (overlapping(300), 0.0, 0.93),
        (autoregressive(0.9, 2000, 300, 16), 0.0, 0.92),
    ],
    ids=["white", "0.5", "0.9", "absolute", "squared", "spans", "short"],
)
def test_intervals_cover_the_mean_of_a_series(values, mean, least):
    assert least <= coverage(values, mean) <= 0.97


def test_interval_of_too_few_or_constant_values():
    value, low, high = mean_interval(np.array([1.0, 2.0]))
    assert value == 1.5 and math.isnan(low) and math.isnan(high)
    assert all(math.isnan(number) for number in mean_interval(np.zeros(0)))
    assert mean_interval(np.full(50, 0.1)) == pytest.approx((0.1, 0.1, 0.1))
    spike = np.zeros(1000)
    spike[500] = 1.0
    value, low, high = mean_interval(spike)
    assert value == 0.001 and low <= 0.001 < high


def test_pairs_find_a_difference_that_the_series_alone_hide():
    """What both series share, here a thousand times the difference, drops out."""
    shared, own = autoregressive(0.9, 2, 3000, 7)
    a, b = 10.0 * shared + own, 10.0 * shared + 0.5
    result = paired(a, b)
    assert result.difference == pytest.approx(own.mean() - 0.5)
    assert result.low < result.difference < result.high < 0.0
    assert result.p_value < 0.001 and result.n == 3000
    mirrored = paired(b, a)
    assert mirrored.difference == -result.difference
    assert (mirrored.low, mirrored.high) == pytest.approx((-result.high, -result.low), rel=0.05)


def test_p_values_of_no_difference_are_evenly_spread():
    a, b = autoregressive(0.8, 300, 2000, 8), autoregressive(0.8, 300, 2000, 9)
    p = np.array([paired(x, y).p_value for x, y in zip(a, b, strict=True)])
    assert stats.kstest(p, "uniform").pvalue > 0.05
    assert 0.03 <= np.mean(p < 0.05) <= 0.07


def test_p_value_and_interval_agree():
    for seed in range(20):
        (values,) = autoregressive(0.5, 1, 400, seed)
        for level in (0.5, 0.8, 0.95, 0.98):
            result = paired(values, np.full(400, 0.1), level)
            assert (result.p_value < 1.0 - level) == (not result.low < 0.0 < result.high)


def test_pairs_that_are_equal_constant_or_few():
    values = np.arange(50.0)
    same = paired(values, values)
    assert same.p_value == 1.0 and same[:3] == (0.0, 0.0, 0.0)
    moved = paired(values, values + 1.0)
    assert moved.p_value == 0.0
    few = paired(values[:4], values[:4])
    assert math.isnan(few.p_value) and few.n == 4
    holes = np.where(values < 5.0, np.nan, values)
    assert paired(holes, values).n == 45


def test_runs_against_scipy():
    rng = np.random.default_rng(11)
    a, b = rng.normal(1.0, 1.0, 9), rng.normal(0.0, 1.0, 9)
    result = paired_over_runs(a, b)
    interval = stats.ttest_rel(a, b).confidence_interval(0.95)
    assert (result.low, result.high) == pytest.approx(tuple(interval))
    assert result.p_value == stats.wilcoxon(a - b).pvalue


def test_runs_few_and_many():
    for n in (2, 5, 6, 13, 14, 30):
        found = paired_over_runs(np.linspace(1.0, 2.0, n), np.zeros(n)).p_value
        assert found == pytest.approx(2.0 / 2**n)
    assert paired_over_runs(np.ones(4), np.ones(4)).p_value == 1.0
    assert math.isnan(paired_over_runs(np.ones(1), np.zeros(1)).p_value)


def test_shares_of_all_none_and_nothing():
    """Wilson's formula at the ends: z^2 / (n + z^2), z = 1.96."""
    z = 1.959964
    assert wilson(0, 10)[2:] == pytest.approx((0.0, z * z / (10 + z * z)))
    assert wilson(10, 10)[2:] == pytest.approx((10 / (10 + z * z), 1.0))
    assert wilson(0, 0)[2:] == (0.0, 1.0)


def test_holm_by_hand():
    assert adjusted([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert adjusted([0.4, math.nan, 0.5])[::2] == pytest.approx([0.8, 0.8])
    assert math.isnan(adjusted([0.4, math.nan])[1])
    assert adjusted([]) == [] and adjusted([0.9, 0.8]) == [1.0, 1.0]


def test_sentence_in_words():
    better = Paired(-0.0012, -0.0014, -0.0010, 0.0001, 300)
    words = "by 1.2 mm per second, 95 % interval 1.0 to 1.4, p < 0.001"
    assert sentence("hector", "crsm", better) == f"hector is better than crsm {words}"
    worse = Paired(0.0012, 0.0010, 0.0014, 0.0001, 300)
    assert sentence("crsm", "hector", worse) == f"hector is better than crsm {words}"
    turn = Paired(0.00012, 0.00001, 0.00023, 0.0312, 300)
    assert sentence("tsd", "crsm", turn, "mrad", "per update") == (
        "crsm is better than tsd by 0.12 mrad per update, 95 % interval 0.01 to 0.23, p = 0.031"
    )


def test_sentence_of_no_proven_difference():
    unsure = Paired(0.0001, -0.0002, 0.0004, 0.41, 300)
    assert sentence("hector", "crsm", unsure) == (
        "hector and crsm can't be distinguished: difference 0.1 mm per second, 95 % interval -0.2"
        " to 0.4, p = 0.41"
    )
    adjusted_away = Paired(-0.0012, -0.0024, -0.0001, 0.2, 300)
    assert "can't be distinguished" in sentence("hector", "crsm", adjusted_away)
    wide = Paired(-0.0012, -0.0026, 0.0002, 0.04, 6)
    assert "can't be distinguished" in sentence("hector", "crsm", wide)
    few = paired(np.zeros(3), np.zeros(3))
    assert sentence("hector", "crsm", few, where="on this log") == (
        "hector and crsm can't be compared on this log: only 3 common values"
    )


def test_intervals_of_differences_of_neighbors():
    """Their sum hangs on the ends alone, and the flat top's estimate is often negative."""
    noise = np.random.default_rng(19).standard_normal((20, 401))
    for values in np.diff(noise, axis=1):
        value, low, high = mean_interval(values)
        assert -0.1 < low < value < high < 0.1
