"""Shares, means and paired tests: against SciPy, closed forms and brute force."""

import itertools
import math

import numpy as np
import pytest
from scipy import stats
from scipy.stats import binomtest

from tpd.answers.statistics import (
    Interval,
    Share,
    chance_of,
    chance_of_either,
    change,
    degrees_of_freedom,
    fall,
    is_positive,
    mcnemar,
    quantile_of,
)


def test_the_interval_of_a_share_is_wilsons():
    for hits, n in ((10, 100), (0, 50), (50, 50), (1, 3)):
        share = Share.of(np.arange(n) < hits)
        known = binomtest(hits, n).proportion_ci(method="wilson")
        assert share == pytest.approx((hits / n, known.low, known.high), abs=1e-12)
    assert str(Share.of(np.arange(100) < 10)) == "10.0 % (5.5 to 17.4 %)"
    assert str(Share.of(np.zeros(0, bool))) == "nan % (0.0 to 100.0 %)"


@pytest.mark.parametrize("allowed", [0.0, 0.07, 0.1, 0.5])
def test_a_quantile_is_the_smallest_value_that_at_most_the_allowed_share_exceeds(allowed):
    for n in (*range(1, 130), 1000):
        values = np.random.default_rng(n).permutation(n).astype(float)
        value = quantile_of(values, 1.0 - allowed)
        # No smaller value of the runs obeys the rule of the validation, which compares the same two numbers.
        assert next(x for x in np.sort(values) if np.mean(values > x) <= allowed) == value
    assert quantile_of(np.array([1.0, np.nan, 0.0]), 0.5) == 1.0
    assert np.isnan(quantile_of(np.array([1.0, np.nan, 0.0]), 0.9))
    assert np.isnan(quantile_of(np.zeros(0), 1.0 - allowed))


def test_the_chance_of_a_difference_is_the_binomial_p_value():
    assert chance_of(0, 0) == chance_of_either(0, 0) == 1.0
    for worse, better in ((5, 0), (4, 1), (0, 5), (900, 1100)):
        known = binomtest(worse, worse + better, alternative="greater").pvalue
        assert chance_of(worse, better) == pytest.approx(known, rel=1e-9)
        either = binomtest(worse, worse + better).pvalue
        assert chance_of_either(worse, better) == pytest.approx(either, rel=1e-9)


def test_a_mean_is_positive_by_the_one_sided_t_test():
    rng, said = np.random.default_rng(2), []
    for _ in range(100):
        values = rng.normal(0.4, 1.0, 12)
        said.append(is_positive(values))
        assert said[-1] == (stats.ttest_1samp(values, 0.0, alternative="greater").pvalue < 0.05)
    assert 20 < sum(said) < 80
    assert not is_positive(np.ones(1))


def changed(values, clusters=None):
    """Interval of given differences."""
    return change(np.asarray(values), np.zeros(len(values)), clusters)


def explicit(tops, clusters):
    """CR2 variance of the mean and its degrees of freedom, by full matrices."""
    n, groups = len(tops), [np.flatnonzero(clusters == c) for c in np.unique(clusters)]
    residual_maker = np.eye(n) - np.full((n, n), 1.0 / n)
    residuals = residual_maker @ tops
    rows, variance = [], 0.0
    for g in groups:
        values, vectors = np.linalg.eigh(residual_maker[np.ix_(g, g)])
        adjusted = vectors @ np.diag(values**-0.5) @ vectors.T @ np.ones(len(g))
        variance += (adjusted @ residuals[g]) ** 2 / n**2
        rows.append(adjusted @ residual_maker[g])
    products = np.array(rows) @ np.array(rows).T
    return variance, np.trace(products) ** 2 / np.sum(products**2)


def test_degrees_of_freedom_equal_explicit_matrices():
    rng = np.random.default_rng(3)
    for n in (2, 5, 40):
        assert degrees_of_freedom(np.full(n, 1.0 / n)) == pytest.approx(n - 1, rel=1e-12)
    for sizes in ([2, 3, 1, 9, 4], [30, 50, 20, 10]):
        clusters = np.repeat(np.arange(len(sizes)), sizes)
        values = np.clip(rng.normal(0.2, 0.3, len(clusters)), -1.0, 1.0)
        variance, freedom = explicit(values, clusters)
        assert degrees_of_freedom(np.array(sizes) / sum(sizes)) == pytest.approx(freedom, rel=1e-9)
        # With many copies of each run the two added runs do not matter.
        copies = 1000
        found = changed(np.tile(values, copies), np.tile(clusters, copies))
        width = stats.t.ppf(0.975, freedom) * math.sqrt(variance)
        # CR2's factor and the shares of the clusters are those of the original runs.
        assert found.high - found.mean == pytest.approx(min(width, 1.0 - found.mean), rel=1e-2)


def test_the_coverage_of_rare_differences_is_at_least_94_per_cent():
    n, counts = 512, np.arange(61)
    limits = [changed(np.arange(n) < k) for k in counts]
    low, high = (np.array([getattr(x, side) for x in limits]) for side in ("low", "high"))
    assert np.all(np.diff(low) > 0.0)
    assert np.all(np.diff(high) > 0.0)
    for p in np.linspace(0.0005, 0.05, 200):
        held = (low <= p) & (p <= high)
        assert stats.binom.pmf(counts, n, p) @ held > 0.94


@pytest.mark.parametrize("n", [2, 6, 512])
def test_the_interval_without_differences_contains_rare_differences(n):
    for found in (changed(np.zeros(n)), changed(np.zeros(3 * n), np.repeat(np.arange(n), 3))):
        assert found.low == pytest.approx(-found.high)
        assert (1.0 - found.high) ** n < 0.06
    cancel = changed(np.tile([1.0, -1.0], n), np.repeat(np.arange(n), 2))
    assert cancel.high == pytest.approx(changed(np.zeros(n)).high)


def test_an_interval_contains_its_mean_and_needs_two_clusters():
    rng = np.random.default_rng(1)
    for _ in range(200):
        n = int(rng.integers(2, 30))
        pendulum, without = np.clip(rng.normal(rng.random(2)[:, None], 0.5, (2, n)), 0.0, 1.0)
        for found in (change(pendulum, without), fall(pendulum, without), fall(pendulum, without, least=0.3)):
            assert found.low <= found.mean <= found.high
    for found in (changed(np.ones(3), np.zeros(3, int)), fall(np.ones(2), np.ones(2), np.zeros(2, int))):
        assert math.isinf(found.low)
    assert math.isnan(changed([]).mean)
    below = changed(np.full(40, -0.5), np.repeat(np.arange(20), 2))
    assert below.high < 0.0
    assert not below.low > 0.0


def test_the_reduction_of_identical_runs_has_an_interval_of_positive_width():
    for pendulum, without in ((0.5, 1.0), (1.0, 1.0), (0.0, 1.0), (0.3, 0.2), (0.0, 0.0), (0.6, 0.0)):
        found = fall(np.full(18, pendulum), np.full(18, without), np.repeat(np.arange(6), 3), least=0.02)
        assert found.low < found.mean <= found.high <= 1.0
        assert found.high - found.low > 0.3


def test_a_mean_of_few_identical_values_is_not_significant():
    assert not is_positive(np.ones(2))
    assert not is_positive(np.full(4, 0.1))
    assert is_positive(np.ones(5))
    assert not is_positive(np.ones(5), least=-3.0)
    assert is_positive(np.full(400, 0.1))


def test_the_interval_of_a_ratio_of_means_has_its_stated_coverage():
    # Bare tilts about a mean of each earthquake, hung ones at 0.7 of these with a scatter.
    rng, hits, clusters = np.random.default_rng(0), 0, np.repeat(np.arange(20), 3)
    for _ in range(300):
        without = np.repeat(rng.uniform(0.2, 0.8, 20), 3) + rng.uniform(-0.1, 0.1, 60)
        pendulum = without * (0.7 + np.repeat(rng.uniform(-0.3, 0.3, 20), 3))
        found = fall(pendulum, without, clusters)
        assert found.mean == pytest.approx(1.0 - pendulum.mean() / without.mean())
        hits += found.low <= 0.3 <= found.high
    assert hits / 300 > 0.93


def test_a_reduction_from_almost_zero_is_relative_to_the_least_mean():
    found = fall(np.array([0.01, 0.03]), np.array([0.0, 0.01]), least=0.02)
    assert found.mean == pytest.approx((0.005 - 0.02) / 0.02)
    assert found.low < found.mean < found.high
    assert fall(np.zeros(3), np.zeros(3)).mean == 0.0
    # Without any tilt to be counted in, the unit is the slenderness.
    assert fall(np.full(3, 0.1), np.zeros(3)).mean == pytest.approx(-0.1)
    assert math.isnan(fall(np.zeros(0), np.zeros(0)).mean)


@pytest.mark.parametrize(("motions", "least"), [(40, 12), (4000, 1024)])
def test_the_paired_test_equals_mcnemars(motions, least):
    rng = np.random.default_rng(3)
    a, b = ((rng.random((motions, 6)) < share).astype(float) for share in (0.5, 0.48))
    for i, p in enumerate(mcnemar(a, b)):
        x, y = (int(np.sum(one[:, i] > other[:, i])) for one, other in ((a, b), (b, a)))
        assert p == pytest.approx(binomtest(x, x + y).pvalue)
        assert x + y >= least


def test_the_paired_test_uses_the_least_favourable_unknown_outcomes():
    rng = np.random.default_rng(5)
    for i in range(40):
        a, b = ((rng.random((9, 1)) < share).astype(float) for share in ((0.7, 0.2), (0.2, 0.7))[i % 2])
        unknown = rng.permutation(18)[: rng.integers(0, 5)]
        both = np.stack([a, b])
        both.flat[unknown] = np.nan
        values = []
        for outcome in itertools.product((0.0, 1.0), repeat=len(unknown)):
            both_known = both.copy()
            both_known.flat[unknown] = outcome
            values.append(mcnemar(*both_known)[0])
        assert mcnemar(*both)[0] == pytest.approx(max(values), rel=1e-12)


def test_a_change_that_rounds_to_zero_is_printed_as_a_reduction():
    cases = {
        (0.25, 0.1, 0.4): (True, "25 %", " (95 % interval 10 to 40 %)"),
        (-0.004, -math.inf, math.inf): (True, "0 %", ""),
        (-0.25, -0.4, 0.1): (False, "25 %", " (95 % interval -10 to 40 %)"),
    }
    for numbers, words in cases.items():
        assert Interval(*numbers).fall_in_words() == words
