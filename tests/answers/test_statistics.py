"""Shares, means, paired tests and lognormal fits: against SciPy, closed forms and brute force."""

import itertools
import math

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import minimize_scalar
from scipy.special import log_ndtr
from scipy.stats import binomtest

from tpd.answers.statistics import (
    Interval,
    Share,
    chance_of,
    chance_of_either,
    change,
    conditional_interval,
    degrees_of_freedom,
    fall,
    fit_lognormal,
    is_positive,
    mcnemar,
)


def test_shares_have_wilsons_interval():
    for hits, n in ((10, 100), (0, 50), (50, 50), (1, 3)):
        share = Share.of(np.arange(n) < hits)
        known = binomtest(hits, n).proportion_ci(method="wilson")
        assert share == pytest.approx((hits / n, known.low, known.high), abs=1e-12)
    assert str(Share.of(np.arange(100) < 10)) == "10.0 % (5.5 to 17.4 %)"
    assert str(Share.of(np.zeros(0, bool))) == "nan % (0.0 to 100.0 %)"


def test_the_chance_of_a_difference_is_the_binomials():
    assert chance_of(0, 0) == chance_of_either(0, 0) == 1.0
    for worse, better in ((5, 0), (4, 1), (0, 5), (900, 1100)):
        known = binomtest(worse, worse + better, alternative="greater").pvalue
        assert chance_of(worse, better) == pytest.approx(known, rel=1e-9)
        either = binomtest(worse, worse + better).pvalue
        assert chance_of_either(worse, better) == pytest.approx(either, rel=1e-9)


def test_a_mean_is_positive_by_the_one_sided_test_of_student():
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


def test_degrees_of_freedom_and_limits_are_those_of_explicit_matrices():
    rng = np.random.default_rng(3)
    for n in (2, 5, 40):
        assert degrees_of_freedom(np.full(n, 1.0 / n)) == pytest.approx(n - 1, rel=1e-12)
    for sizes in ([2, 3, 1, 9, 4], [30, 50, 20, 10], [300, 500, 700]):
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


def test_exact_coverage_of_rare_differences_is_at_least_94_per_cent():
    n, counts = 512, np.arange(61)
    limits = [changed(np.arange(n) < k) for k in counts]
    low, high = (np.array([getattr(x, side) for x in limits]) for side in ("low", "high"))
    assert np.all(np.diff(low) > 0.0)
    assert np.all(np.diff(high) > 0.0)
    for p in np.linspace(0.0005, 0.05, 200):
        held = (low <= p) & (p <= high)
        assert stats.binom.pmf(counts, n, p) @ held > 0.94


@pytest.mark.parametrize("n", [2, 3, 6, 20, 512])
def test_rare_differences_are_within_the_interval_of_clusters_that_saw_none(n):
    for found in (changed(np.zeros(n)), changed(np.zeros(3 * n), np.repeat(np.arange(n), 3))):
        assert found.low == pytest.approx(-found.high)
        assert (1.0 - found.high) ** n < 0.06
    cancel = changed(np.tile([1.0, -1.0], n), np.repeat(np.arange(n), 2))
    assert cancel.high == pytest.approx(changed(np.zeros(n)).high)


def test_limits_hold_the_mean_and_one_cluster_leaves_it_unknown():
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


@pytest.mark.parametrize("truth", [0.08, 0.16, 0.3])
def test_an_interval_that_allows_for_the_decision_contains_the_truth_of_samples_that_pass(truth):
    """The normal distribution itself: a sample passes above a threshold."""
    rng, error, least = np.random.default_rng(0), 0.06, 0.168
    means = rng.normal(truth, error, 40_000)
    means = means[means > least][:600]
    found = [conditional_interval(of, of, of.mean - least) for of in (usual(m, error) for m in means)]
    covered = np.mean([of.low <= truth <= of.high for of in found])
    # The upper end is at least the mean of the sample, which covers a little more close to the threshold.
    assert 0.92 < covered < 0.99
    # The estimate is too large as often as too small; the mean of those that pass is too large.
    assert 0.4 < np.mean([of.mean > truth for of in found]) < 0.56
    if truth < least:
        assert np.all(means > truth)


def usual(mean: float, error: float) -> Interval:
    return Interval(float(mean), float(mean) - 1.959964 * error, float(mean) + 1.959964 * error)


def test_a_quantity_that_did_not_decide_is_corrected_by_its_correlation():
    """Two means of a bivariate normal distribution, of which the first decides."""
    rng, error, least, rho = np.random.default_rng(0), 0.06, 0.168, 0.7
    pairs = rng.multivariate_normal([0.1, 0.1], error**2 * np.array([[1.0, rho], [rho, 1.0]]), 40_000)
    found = [
        conditional_interval(usual(second, error), usual(first, error), first - least, rho)
        for first, second in pairs[pairs[:, 0] > least][:600]
    ]
    assert 0.92 < np.mean([of.low <= 0.1 <= of.high for of in found]) < 0.98
    # Without correlation, far above the threshold, or without a known interval, nothing changes.
    of = usual(0.2, 0.1)
    assert conditional_interval(of, of, 0.1, 0.0) == of
    far = conditional_interval(of, of, 2.0)
    assert (far.mean, far.low, far.high) == pytest.approx((of.mean, of.low, of.high), abs=1e-6)
    unknown = Interval(0.2, -math.inf, math.inf)
    assert conditional_interval(unknown, of, 0.1) == unknown


def test_a_fall_of_runs_that_are_all_alike_has_a_width():
    for pendulum, without in ((0.5, 1.0), (1.0, 1.0), (0.0, 1.0), (0.3, 0.2), (0.0, 0.0), (0.6, 0.0)):
        found = fall(np.full(18, pendulum), np.full(18, without), np.repeat(np.arange(6), 3), least=0.02)
        assert found.low < found.mean <= found.high <= 1.0
        assert found.high - found.low > 0.3


def test_a_curve_of_earthquakes_that_are_all_alike_has_no_known_spread():
    hits = np.tile([0.0, 1.0, 0.0, 1.0], (6, 1))
    found = fit_lognormal(np.array([0.5, 1.0, 2.0, 4.0]), hits)
    assert found.interval() == (0.0, math.inf)
    assert np.isnan(found.covariance).all()
    assert found.covariance.shape == (2, 2)
    # Three earthquakes show a spread, and two do not.
    differ = np.array([[0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 1.0, 1.0], [0.0, 1.0, 0.0, 1.0]])
    ends = [fit_lognormal(np.array([0.5, 1.0, 2.0, 4.0]), differ[i:]).interval() for i in (0, 1)]
    assert 0.0 < ends[0][0] < ends[0][1] < math.inf
    assert ends[1] == (0.0, math.inf)
    # One earthquake that ends otherwise shows a spread.
    low, high = fit_lognormal(
        np.array([0.5, 1.0, 2.0, 4.0]), np.vstack([hits, [0.0, 0.0, 0.0, 1.0]])
    ).interval()
    assert 0.0 < low < high < math.inf


def test_few_values_that_are_all_alike_are_no_significant_mean():
    assert not is_positive(np.ones(2))
    assert not is_positive(np.full(4, 0.1))
    assert is_positive(np.ones(5))
    assert not is_positive(np.ones(5), least=-3.0)
    assert is_positive(np.full(400, 0.1))


def test_a_fall_is_a_ratio_of_means_whose_interval_covers_the_truth():
    # Bare tilts about a mean of each earthquake, hung ones at 0.7 of these with a scatter.
    rng, hits, clusters = np.random.default_rng(0), 0, np.repeat(np.arange(20), 3)
    for _ in range(300):
        without = np.repeat(rng.uniform(0.2, 0.8, 20), 3) + rng.uniform(-0.1, 0.1, 60)
        pendulum = without * (0.7 + np.repeat(rng.uniform(-0.3, 0.3, 20), 3))
        found = fall(pendulum, without, clusters)
        assert found.mean == pytest.approx(1.0 - pendulum.mean() / without.mean())
        hits += found.low <= 0.3 <= found.high
    assert hits / 300 > 0.93


def test_a_fall_from_next_to_nothing_is_counted_in_units_of_the_least_mean():
    found = fall(np.array([0.01, 0.03]), np.array([0.0, 0.01]), least=0.02)
    assert found.mean == pytest.approx((0.005 - 0.02) / 0.02)
    assert found.low < found.mean < found.high
    assert fall(np.zeros(3), np.zeros(3)).mean == 0.0
    # Without any tilt to be counted in, the unit is the slenderness.
    assert fall(np.full(3, 0.1), np.zeros(3)).mean == pytest.approx(-0.1)
    assert math.isnan(fall(np.zeros(0), np.zeros(0)).mean)


@pytest.mark.parametrize(("motions", "least"), [(40, 12), (4000, 1024)])
def test_the_paired_test_is_that_of_mcnemar(motions, least):
    rng = np.random.default_rng(3)
    a, b = ((rng.random((motions, 6)) < share).astype(float) for share in (0.5, 0.48))
    for i, p in enumerate(mcnemar(a, b)):
        x, y = (int(np.sum(one[:, i] > other[:, i])) for one, other in ((a, b), (b, a)))
        assert p == pytest.approx(binomtest(x, x + y).pvalue)
        assert x + y >= least


def test_the_paired_test_is_the_largest_that_unknown_outcomes_allow():
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


def outcomes(counts: list[int], motions: int) -> np.ndarray:
    """Outcomes of motions of which so many reach the state at each stripe."""
    return (np.arange(motions)[:, None] < np.array(counts)).astype(float)


def likelihood(a, b, stripes: np.ndarray, hits: np.ndarray) -> np.ndarray:
    """Logarithm of the likelihood of intercepts and slopes in the logarithm of the intensity."""
    eta = np.asarray(a)[..., None] + np.asarray(b)[..., None] * np.log(stripes)
    known = np.isfinite(hits)
    counts, n = np.where(known, hits, 0.0).sum(axis=0), known.sum(axis=0)
    return (counts * log_ndtr(eta) + (n - counts) * log_ndtr(-eta)).sum(axis=-1)


def against(a, b, stripes: np.ndarray, hits: np.ndarray) -> float:
    return -float(likelihood(a, b, stripes, hits))


SEPARATED = [
    # Shares, motions, and between which of the stripes 1, 2, 3 ... the share passes a half.
    ([0, 2, 4], 4, (2.0, 2.0)),
    ([0, 0, 0, 3], 20, (4.0, math.inf)),
    ([0, 0, 1, 5], 5, (3.0, 4.0)),
    ([7, 9, 9], 9, (0.0, 1.0)),
    ([0, 0, 8, 8], 8, (2.0, 3.0)),
    ([0, 1], 1, (1.0, 2.0)),
]


@pytest.mark.parametrize(("counts", "motions", "passes"), SEPARATED)
def test_separated_outcomes_have_the_median_and_band_of_the_stripes_around(counts, motions, passes):
    stripes = np.arange(1.0, len(counts) + 1.0)
    fit = fit_lognormal(stripes, outcomes(counts, motions))
    assert fit.separated
    assert "too small to resolve with these stripes" in str(fit)
    assert math.isnan(fit.dispersion)
    assert fit.median == pytest.approx(math.sqrt(passes[0] * passes[1]))
    assert fit.interval()[0] <= passes[0]
    assert fit.interval()[1] >= passes[1]
    exact = [binomtest(k, motions).proportion_ci(0.9, method="exact") for k in counts]
    # Below and above the stripes nothing limits the probability on one side.
    lows, highs = [0.0, *(e.low for e in exact)], [*(e.high for e in exact), 1.0]
    between = np.arange(0.5, len(counts) + 1.0)
    np.testing.assert_allclose(fit.band(between, level=0.9), [lows, highs], atol=1e-12)
    np.testing.assert_allclose(fit.band(stripes, level=0.9), [lows[1:], highs[:-1]], atol=1e-12)
    # The curve is drawn only where the stripes on both sides say the same.
    shares = np.array([0.0, *counts, motions]) / motions
    known = shares[1:] == shares[:-1]
    assert np.array_equal(np.isfinite(fit.probability(between)), known)
    np.testing.assert_allclose(fit.probability(stripes), shares[1:-1])


def test_one_stripe_sees_no_dispersion():
    for count, median in ((3, math.inf), (5, 2.0), (8, 0.0)):
        fit = fit_lognormal(np.array([2.0]), outcomes([count], 10))
        assert (fit.separated, fit.median) == (True, median)
        assert math.isnan(fit.dispersion)
        assert "unknown with one stripe" in str(fit)


def test_a_change_that_rounds_to_zero_is_called_a_reduction():
    cases = {
        (0.25, 0.1, 0.4): (True, "25 %", " (95 % interval 10 to 40 %)"),
        (-0.004, -math.inf, math.inf): (True, "0 %", ""),
        (-0.25, -0.4, 0.1): (False, "25 %", " (95 % interval -10 to 40 %)"),
    }
    for numbers, words in cases.items():
        assert Interval(*numbers).fall_in_words() == words


def test_a_share_that_grows_slowly_has_a_curve_and_one_that_does_not_grow_has_none():
    stripes = np.array([0.5, 1.0, 2.0, 4.0])
    fit = fit_lognormal(stripes, outcomes([10, 12, 14, 16], 40))
    assert 1.0 / fit.dispersion == pytest.approx(0.2021, abs=1e-4)
    assert "does not grow" not in str(fit)
    # The median of these, about exp(900), is no double.
    assert math.isnan(fit_lognormal(stripes, outcomes([100, 100, 100, 101], 10_000)).median)
    for counts in ([10, 10, 10, 10], [16, 14, 12, 10], [40, 40, 0, 0], [40, 20, 0, 0]):
        fit = fit_lognormal(stripes, outcomes(counts, 40))
        assert math.isnan(fit.median)
        assert "does not grow" in str(fit)


def test_random_fits_are_maxima_or_have_none():
    rng, seen = np.random.default_rng(35), {"maximum": 0, "separated": 0, "flat": 0}
    for _ in range(200):
        stripes = np.sort(np.exp(rng.normal(0.0, 1.0, rng.integers(2, 9))))
        motions = int(rng.choice([2, 4, 12, 40, 200]))
        median, dispersion = np.exp(rng.normal(0.0, 1.0)), np.exp(rng.normal(-0.3, 1.2))
        capacity = median * np.exp(dispersion * rng.standard_normal((motions, len(stripes))))
        # Either the outcomes of a motion at all stripes hang together, or they do not.
        hits = (stripes >= (capacity[:, :1] if rng.random() < 0.5 else capacity)).astype(float)
        hits[rng.random(hits.shape) < rng.choice([0.0, 0.1])] = np.nan
        fit = fit_lognormal(stripes, hits)
        fell, stood = (stripes[np.any(hits == x, axis=0)] for x in (1.0, 0.0))
        assert fit.separated == (not fell.size or not stood.size or stood.max() <= fell.min())
        if fit.separated:
            seen["separated"] += 1
        elif math.isnan(fit.median):
            seen["flat"] += 1
            # With the best intercept of each slope the likelihood falls from a slope of zero on.
            best = [minimize_scalar(against, args=(b, stripes, hits)).fun for b in (0.0, 0.03, 0.3)]
            assert best == sorted(best)
        else:
            seen["maximum"] += 1
            b = 1.0 / fit.dispersion
            a = -b * math.log(fit.median)
            top = likelihood(a, b, stripes, hits)
            # The likelihood is concave: a maximum among its neighbours is the maximum.
            turns, size = np.linspace(0.0, 2.0 * math.pi, 40), np.array([[1e-4], [1e-2], [0.3]])
            near = a + size * np.cos(turns), b + size * np.sin(turns) * max(1.0, b)
            assert np.all(likelihood(*near, stripes, hits) < top + 1e-9)
    assert min(seen.values()) > 2
    assert seen["maximum"] > 100


@pytest.mark.parametrize("rows", [[[0, 1, 0, 1, 1]], [[0, 1, 0, 1, 1], [0, 0, 1, 1, 1]]], ids=["one", "two"])
def test_one_earthquake_or_two_show_no_spread(rows):
    stripes, hits = np.arange(1.0, 6.0), np.array(rows, dtype=float)
    # Rows without any outcome are no motions, and copies are no more earthquakes.
    padded = np.vstack([hits, np.full((3, 5), np.nan)])
    copies = fit_lognormal(stripes, np.tile(hits, (6, 1)), np.arange(6 * len(hits)) % len(hits))
    for fit in (fit_lognormal(stripes, hits), fit_lognormal(stripes, padded), copies):
        assert not fit.separated
        assert fit.interval() == (0.0, math.inf)
        np.testing.assert_array_equal(fit.band(np.array([1.0, 3.0])), [[0.0, 0.0], [1.0, 1.0]])


def test_without_outcomes_there_is_no_median():
    fit = fit_lognormal(np.array([1.0, 2.0]), np.full((5, 2), np.nan))
    assert math.isnan(fit.median)
    assert "no outcome is known" in str(fit)
    np.testing.assert_array_equal(fit.band(np.array([0.5, 1.5, 3.0])), [[0.0] * 3, [1.0] * 3])


def test_outcomes_that_are_all_the_same_bound_the_probability():
    never, always = (fit_lognormal(np.array([1.0, 2.0, 3.0]), np.full((20, 3), x)) for x in (0.0, 1.0))
    assert (str(never), never.interval()) == ("median above the stripes, dispersion unknown", (3.0, math.inf))
    assert (str(always), always.interval()) == ("median below the stripes, dispersion unknown", (0.0, 1.0))
    known = binomtest(0, 20).proportion_ci(method="exact").high
    known = [0.0] * 3, [known, known, 1.0]
    np.testing.assert_allclose(never.band(np.array([0.5, 2.5, 3.5])), known, rtol=1e-6)


def test_large_counts_and_close_stripes_lose_no_digits():
    stripes = np.array([1.0, 1.0 + 1e-6, 1.0 + 2e-6])
    hits = outcomes([10_000, 30_000, 70_000], 100_000)
    near, wide = fit_lognormal(stripes, hits), fit_lognormal(7.0 * stripes**1e6, hits)
    assert near.median**1e6 == pytest.approx(wide.median / 7.0, rel=1e-7)
    assert near.dispersion * 1e6 == pytest.approx(wide.dispersion, rel=1e-7)


def test_few_earthquakes_have_the_wider_quantile_of_student():
    hits = np.array([[0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
    fit = fit_lognormal(np.array([1.0, 2.0, 4.0, 8.0]), hits)
    toward = -fit.dispersion * np.array([1.0, math.log(fit.median)])
    width = 4.302652729911275 * math.sqrt(toward @ fit.covariance @ toward)
    assert fit.interval() == pytest.approx((fit.median * math.exp(-width), fit.median * math.exp(width)))


def test_the_interval_covers_and_takes_a_motion_as_one():
    # The outcomes of a motion at all stripes hang together.
    rng, stripes, inside, width = np.random.default_rng(0), np.linspace(0.5, 6.0, 12), 0, []
    for _ in range(200):
        capacity = 2.0 * np.exp(0.5 * rng.standard_normal(40))
        fit = fit_lognormal(stripes, (stripes >= capacity[:, None]).astype(float))
        low, high = fit.interval()
        inside += low < 2.0 < high
        width.append(math.log(high / low))
    assert 0.90 < inside / 200 < 0.985
    # The deviation of the mean of 40 logarithms.
    assert np.median(width) == pytest.approx(2 * 1.959964 * 0.5 / math.sqrt(40), rel=0.15)


def test_a_share_over_clusters_has_the_interval_of_as_many_observations():
    hits = np.array([True, True, False, False, True, False])
    found = Share.of(hits, np.array([0, 0, 1, 1, 2, 2]))
    expected = binomtest(0, 3).proportion_ci(method="wilson")
    assert Share.of(np.zeros(6, bool), np.repeat(range(3), 2))[1:] == pytest.approx(
        tuple(expected), abs=1e-12
    )
    assert found.value == 0.5
    # Equal entries within each cluster: the interval is that of the clusters alone.
    assert Share.of(np.repeat([True, False], 4), np.repeat(range(4), 2)) == Share.of(
        np.array([1, 1, 0, 0]) == 1
    )
