"""The block bootstrap, draw by draw."""

import math

import numpy as np
import pytest

from bench.judge import bootstrap


def correlated(n, phi, seed=0):
    noise, series = np.random.default_rng(seed).normal(size=n), np.zeros(n)
    for k in range(1, n):
        series[k] = phi * series[k - 1] + noise[k]
    return series + 3.0


@pytest.mark.parametrize(("n", "phi"), [(50, 0.0), (400, 0.6)])
def test_each_draw_is_studentized_by_its_own_blocks(n, phi):
    series = correlated(n, phi)
    found = bootstrap.studentized(series, 7)
    around = series - series.mean()
    length = n // found.blocks
    starts = np.random.default_rng(7).integers(0, n, (bootstrap.DRAWS, found.blocks))
    ratios = []
    for draw in starts:
        means = [around[np.arange(a, a + length) % n].mean() for a in draw]
        ratios.append(np.mean(means) / (np.std(means, ddof=1) / math.sqrt(found.blocks)))
    assert length > 1
    assert found.ratios == pytest.approx(np.sort(ratios), rel=1e-6, abs=1e-9)


def test_limits_lie_across_the_mean_from_the_ratios():
    ratios = np.linspace(-1.0, 3.0, bootstrap.DRAWS)
    mean = bootstrap.Mean(10.0, 2.0, ratios, 50)
    low, high = bootstrap.limits(mean, 0.95)
    assert low == pytest.approx(10.0 - 2.0 * 2.9, abs=0.02)
    assert high == pytest.approx(10.0 + 2.0 * 0.9, abs=0.02)


def test_the_variance_of_a_plain_series_is_as_without_a_bootstrap():
    series = np.random.default_rng(1).normal(size=5000)
    found = bootstrap.studentized(series, 0)
    assert found.deviation == pytest.approx(series.std(ddof=1) / math.sqrt(5000), rel=0.1)
