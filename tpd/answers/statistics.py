"""Shares, means, paired tests and lognormal curves of runs, with intervals of 95 % confidence.

Runs of one cluster, such as an earthquake, are not independent. Variances are therefore those between
clusters (a bias-reduced cluster-robust variance), and quantiles are those of Student's distribution. The
distributions come from `scipy.special`, because `scipy.stats`, with which the tests compare, takes most of a
second to load.

If all clusters of a sample are alike, the sample shows no variance, although other clusters may differ.
`_limits_of_ratio` therefore adds two extreme runs to paired runs, and `is_positive` allows for a share
`unseen(n)` of different clusters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import root
from scipy.special import bdtr, betaincinv, erfcx, log_ndtr, ndtr, ndtri, stdtrit

from tpd.core.formatting import confidence, interval, percent

SIGNIFICANT = 0.05
"""Probability below which a difference between two shares is significant."""
_LEVEL = 0.95
"""Confidence level of all intervals."""
_WEIGHT = 1.2
"""Weight, in runs, of each of the two runs that are added to paired runs. If differences in one direction are
rare, the smallest coverage is 94.3 % with this weight and 93.2 % with a weight of 1."""
_FARTHEST = float(ndtri(0.999) / ndtri(0.975))
"""Largest distance of the lower end of a conditional interval from the mean, in distances of the lower end of
the usual interval: the end of a one-sided interval of 99.9 %. Without it some lower ends are infinite."""
_MANY = 1e12
"""Degrees of freedom above which Student's distribution equals the normal distribution."""
_ROUNDING = 1e-12
"""Relative size below which a number is due to rounding."""
_CONVERGED = 1e-8
"""Largest derivative of the likelihood, per outcome, at its maximum. About 1e-13 is usual."""


class Share(NamedTuple):
    """Share of the runs, with its 95 % confidence interval (Wilson's)."""

    value: float
    """Share of the runs, from 0 to 1."""
    low: float
    """Lower end of the interval."""
    high: float
    """Upper end of the interval."""

    @staticmethod
    def of(hits: np.ndarray, clusters: np.ndarray | None = None) -> Share:
        """Return the share of true entries in a vector.

        Without entries the share is NaN and the interval is 0 to 1. With `clusters`, see `change`, the
        interval is that of as many observations as there are clusters, as if the entries of a cluster were
        equal.
        """
        if not len(hits):
            return Share(math.nan, 0.0, 1.0)
        # Wilson's interval stays within 0 to 1, and has a positive width even if all runs are alike.
        n = len(hits if clusters is None else np.unique(clusters))
        s, z = float(np.mean(hits)), float(ndtri(0.5 * (1.0 + _LEVEL)))
        middle = (s + z**2 / (2 * n)) / (1 + z**2 / n)
        half = z / (1 + z**2 / n) * math.sqrt(s * (1 - s) / n + z**2 / (4 * n**2))
        return Share(s, max(0.0, middle - half), min(1.0, middle + half))

    def __str__(self) -> str:
        return interval(*self, digits=1)


@dataclass(frozen=True)
class Interval:
    """Mean with its interval of 95 % confidence."""

    mean: float
    """Mean."""
    low: float
    """Lower end of the interval; -infinity if the interval is unknown."""
    high: float
    """Upper end of the interval; infinity if the interval is unknown."""

    def fall_in_words(self) -> tuple[bool, str, str]:
        """Return whether a relative change is a reduction, its size, and its interval as text."""
        # A share that rounds to zero must not read "-0 %".
        less = self.mean > -0.005
        low, high = (self.low, self.high) if less else (-self.high, -self.low)
        around = f" {confidence(low, high)}" if math.isfinite(low) else ""
        return less, percent(abs(self.mean)), around


def conditional_interval(
    of: Interval, decided: Interval, margin: float, correlation: float = 1.0
) -> Interval:
    """Return the interval of a mean that is quoted only because its own sample passed a decision.

    A sample passes if one of its means is above a threshold. Given that it passes, this mean has a normal
    distribution that is truncated at the threshold (H. Zhong and R. L. Prentice, Biostatistics 9, 2008). The
    interval contains the true values for which the mean of the sample is neither among the lowest nor among
    the highest 2.5 % of this distribution. The new mean is the true value for which it is the median. For a
    mean that did not decide, the distance from the threshold in standard errors is divided by the correlation
    with the mean that did (J. D. Lee, D. L. Sun, Y. Sun and J. E. Taylor, Ann. Statist. 44, 2016).

    The standard errors are those that the usual intervals imply for a normal distribution. As in the hybrid
    intervals of I. Andrews, T. Kitagawa and A. McCloskey (Q. J. Econ. 139, 2024), a very wide usual interval
    bounds the lower end. The upper end is at least the mean of the sample.

    Args:
        of: mean with its usual interval.
        decided: mean that decided, with its usual interval.
        margin: distance of the mean that decided from the threshold.
        correlation: correlation of both means.

    Example:
        >>> of = Interval(0.2, 0.1, 0.3)
        >>> [conditional_interval(of, of, margin).fall_in_words()[1:] for margin in (0.05, 0.5)]
        [('18 %', ' (95 % interval 4 to 30 %)'), ('20 %', ' (95 % interval 10 to 30 %)')]
    """
    if not (math.isfinite(of.low) and correlation > 0.0):
        return of
    quantile = float(ndtri(0.5 * (1.0 + _LEVEL)))
    passed = margin / (decided.mean - decided.low) * quantile / correlation
    # Distance of the sample from possible true values in standard errors, and the probability that a sample
    # that passes has at least this mean. This probability increases with the true value.
    truths = np.linspace(of.mean - _FARTHEST * (of.mean - of.low), of.high, 2001)
    width = np.where(truths <= of.mean, of.mean - of.low, of.high - of.mean)
    distance = (of.mean - truths) / width * quantile
    chance = np.exp(log_ndtr(-distance) - log_ndtr(passed - distance))
    low, mean, high = np.interp((0.5 * (1.0 - _LEVEL), 0.5, 0.5 * (1.0 + _LEVEL)), chance, truths)
    # Very close to the threshold the upper end would fall to the bound of the lower end.
    return Interval(float(mean), float(low), max(float(high), of.mean))


def unseen(n: int) -> float:
    """Return the largest share (95 % confidence) of outcomes that n independent observations do not show."""
    return 1.0 - (1.0 - _LEVEL) ** (1.0 / n)


def change(
    with_pendulum: np.ndarray, without_pendulum: np.ndarray, clusters: np.ndarray | None = None
) -> Interval:
    """Return the mean difference of paired runs, with minus without the pendulum, and its interval.

    With fewer than two clusters the interval is infinite. Without runs the mean is NaN.

    Args:
        with_pendulum: a number from 0 to 1 for each run, such as its severity, shape (runs,).
        without_pendulum: the same numbers for the runs without the pendulum, shape (runs,).
        clusters: a number for each run, equal for runs that depend on each other. By default all runs are
            independent.

    Example:
        >>> overturned = np.array([True] * 30 + [False] * 70)
        >>> f"{change(np.zeros(100), overturned).high:.3f}"
        '-0.198'
    """
    differences = with_pendulum.astype(float) - without_pendulum
    mean = float(differences.mean()) if differences.size else math.nan
    low, high = _limits_of_ratio(differences, np.ones_like(differences), ((1.0, 1.0), (-1.0, 1.0)), clusters)
    if math.isinf(low):
        return Interval(mean, low, high)
    return Interval(mean, max(-1.0, low), min(1.0, high))


def fall(
    with_pendulum: np.ndarray,
    without_pendulum: np.ndarray,
    clusters: np.ndarray | None = None,
    least: float = 0.0,
) -> Interval:
    """Return the relative reduction of the mean of paired runs by the pendulum, and its interval.

    The reduction is (B - H) / B with the means B without and H with the pendulum; it is 0 if both means are
    0. A mean B below `least` counts as `least`. The interval is infinite if there are fewer than two
    clusters, or if B is not significantly above zero. Without runs all numbers are NaN.

    Args:
        with_pendulum: a number from 0 to 1 for each run, such as its severity, shape (runs,).
        without_pendulum: the same numbers for the runs without the pendulum, shape (runs,).
        clusters: see `change`.
        least: smallest mean without the pendulum.

    Example:
        >>> overturned = np.array([True] * 30 + [False] * 70)
        >>> fall(overturned & (np.arange(100) < 12), overturned).fall_in_words()
        (True, '60 %', ' (95 % interval 37 to 77 %)')
    """
    if not without_pendulum.size:
        return Interval(math.nan, math.nan, math.nan)
    falls = without_pendulum.astype(float) - with_pendulum
    mean = float(without_pendulum.mean())
    size = max(mean, least) or 1.0
    if mean >= least:
        # One of the two extreme runs is severe only with the pendulum, the other only without it.
        sizes, extremes = without_pendulum.astype(float), ((1.0, 1.0), (-1.0, 0.0))
    else:
        # A constant in place of the mean does not vary between runs.
        sizes, extremes = np.full_like(falls, size), ((1.0, size), (-1.0, size))
    low, high = _limits_of_ratio(falls, sizes, extremes, clusters)
    return Interval(float(falls.mean()) / size, low, high if math.isinf(low) else min(1.0, high))


def _limits_of_ratio(
    tops: np.ndarray,
    bottoms: np.ndarray,
    extremes: tuple[tuple[float, float], tuple[float, float]],
    clusters: np.ndarray | None,
) -> tuple[float, float]:
    """Return the 95 % limits of the ratio sum(tops) / sum(bottoms).

    The interval is Fieller's (E. C. Fieller, J. R. Statist. Soc. B 16, 1954). It contains the ratios r for
    which the mean of tops - r * bottoms is not significant. The variance of this mean is the bias-reduced
    cluster-robust variance (CR2) with the degrees of freedom of R. M. Bell and D. F. McCaffrey (Survey
    Methodology 28, 2002), for clusters of different sizes.

    If events are rare, this variance is too small when the sample has few events, and zero when it has none.
    Therefore two runs are added at the extremes, one in each direction, as D. G. Bonett and R. M. Price
    propose for paired proportions (J. Educ. Behav. Statist. 37, 2012). Their variance is known.
    Satterthwaite's rule gives the degrees of freedom of the sum.

    Args:
        tops: numerators, shape (runs,).
        bottoms: denominators, shape (runs,).
        extremes: numerator and denominator of each added run.
        clusters: see `change`.
    """
    sums = added_up(np.stack([tops, bottoms, np.ones_like(tops)], axis=1), clusters)
    if len(sums) < 2:
        return -math.inf, math.inf
    shares = sums[:, 2] / len(tops)
    ratio = sums[:, 0].sum() / (sums[:, 1].sum() or 1.0)
    # Clusters that are all alike contain no information on single runs. Each added run then has the weight of
    # a cluster.
    is_alike = np.abs(sums[:, 0] - ratio * sums[:, 1]).max() < _ROUNDING * len(tops)
    weight = _WEIGHT * (len(tops) / len(sums) if is_alike else 1.0)
    added = weight * np.column_stack([extremes, np.ones(2)])
    top, bottom, size = sums.sum(axis=0) + added.sum(axis=0)
    # Deviations of the sums from the averages for clusters of these sizes, with the factor of CR2.
    deviations = np.concatenate([sums, added])
    deviations = deviations[:, :2] - np.outer(deviations[:, 2] / size, [top, bottom])
    deviations[:-2] /= np.sqrt(1.0 - shares)[:, None]
    squares = (deviations @ [1.0, -top / bottom]) ** 2
    of_clusters = float(squares[:-2].sum())
    freedom = math.inf
    if not is_alike:
        freedom = degrees_of_freedom(shares) * (float(squares.sum()) / of_clusters) ** 2
    quantile = float(stdtrit(min(freedom, _MANY), 0.5 * (1.0 + _LEVEL)))
    # (top - r bottom)^2 = quantile^2 times its variance is a quadratic equation for r. If the leading
    # coefficient is not positive, the denominator is not significantly above zero.
    (c, b), (_, a) = np.outer([top, bottom], [top, bottom]) - quantile**2 * deviations.T @ deviations
    if a <= _ROUNDING * bottom**2:
        return -math.inf, math.inf
    width = math.sqrt(max(0.0, b**2 - a * c))
    return float((b - width) / a), float((b + width) / a)


def degrees_of_freedom(shares: np.ndarray) -> float:
    """Return the degrees of freedom of a mean over clusters, by Bell and McCaffrey.

    For clusters of equal size this is their number minus one. For clusters of different sizes it is smaller.

    Args:
        shares: share of the runs that belongs to each cluster, shape (clusters,).

    Example:
        >>> [round(degrees_of_freedom(np.array(x)), 3) for x in ([0.25] * 4, [0.8, 0.1, 0.1])]
        [3.0, 1.246]
    """
    # The covariance matrix of the terms of the clusters, divided by its trace, has shares on its diagonal and
    # b_g b_h elsewhere. The result is the inverse of the sum of its squares.
    b = shares**2 / (1.0 - shares)
    return float(1.0 / (np.sum(shares**2) + np.sum(b) ** 2 - np.sum(b**2)))


def is_positive(values: np.ndarray, least: float = -1.0, clusters: np.ndarray | None = None) -> bool:
    """Whether the mean of values is significantly above zero, at 5 % (one-sided).

    The test is Student's, between clusters. If all clusters are alike, the test allows for the unseen share
    of clusters with the smallest possible value.

    Args:
        values: one value for each run, shape (runs,).
        least: smallest possible value.
        clusters: see `change`.
    """
    if clusters is not None:
        sizes = added_up(np.ones(len(values)), clusters)
        values = added_up(values, clusters) / (sizes.mean() if sizes.size else 1.0)
    n = len(values)
    if n < 2:
        return False
    mean, spread = float(values.mean()), float(values.std(ddof=1))
    # Without variance the bound is the mean that results if the unseen share has the smallest value.
    error = stdtrit(n - 1, _LEVEL) * spread / math.sqrt(n)
    return bool(mean > (error if spread > _ROUNDING else unseen(n) * (mean - least)))


def added_up(values: np.ndarray, clusters: np.ndarray | None) -> np.ndarray:
    """Add the rows of `values`, one for each run, over the runs of each cluster.

    Without `clusters` each run is a cluster.
    """
    if clusters is None:
        return values
    unique, numbers = np.unique(clusters, return_inverse=True)
    sums = np.zeros((len(unique), *values.shape[1:]))
    np.add.at(sums, numbers, values)
    return sums


def chance_of(worse: int, better: int) -> float:
    """Return the p-value of McNemar's test, exact and one-sided.

    It is the probability that at least `worse` of the runs with different outcomes are worse with the
    pendulum, if either direction were equally likely.
    """
    # Runs with equal outcomes in both cases contain no information on the difference, and are not counted.
    return float(bdtr(better, worse + better, 0.5))


def chance_of_either(x: int, y: int) -> float:
    """Return the p-value of McNemar's test, exact and two-sided.

    x and y are the numbers of differences in the two directions.
    """
    return min(1.0, 2.0 * chance_of(max(x, y), min(x, y)))


def mcnemar(a: np.ndarray, b: np.ndarray, quakes: np.ndarray | None = None) -> np.ndarray:
    """Return the p-values of McNemar's test over earthquakes at each stripe, exact and two-sided.

    An earthquake differs if more of its motions reach the state in one case than in the other. If outcomes
    are unknown, the p-value is the largest that is possible.

    Args:
        a, b: 1 where a motion reaches the state, 0 where it does not, NaN if unknown; shape
            (motions, stripes).
        quakes: number of the earthquake of each motion; by default each motion has its own earthquake.
    """
    # For each earthquake: the number of motions that reach the state in case a minus that in case b, at least
    # and at most.
    low, high = (
        added_up(np.nan_to_num(a, nan=x) - np.nan_to_num(b, nan=1.0 - x), quakes) for x in (0.0, 1.0)
    )
    only_a, only_b = np.sum(low > 0.0, axis=0), np.sum(high < 0.0, axis=0)
    may_a, may_b = np.sum((low <= 0.0) & (high > 0.0), axis=0), np.sum((high >= 0.0) & (low < 0.0), axis=0)
    # The unknown earthquakes make the split as even as possible.
    x = np.where(only_a < only_b, np.minimum(only_a + may_a, only_b), only_a)
    y = np.where(only_b < only_a, np.minimum(only_b + may_b, only_a), only_b)
    return np.array([chance_of_either(int(i), int(j)) for i, j in zip(x, y, strict=True)])


@dataclass(frozen=True)
class Lognormal:
    """Fragility curve: the probability of a damage state at the intensity x is Phi(ln(x/median)/dispersion).

    The likelihood has a finite maximum exactly if the outcomes overlap: some motion reaches the state at an
    intensity below one at which some motion does not reach it, and the other way round (M. J. Silvapulle, J.
    R. Statist. Soc. B 43, 1981). If the outcomes are separated, the only information is that of the stripes,
    and that the probability increases with the intensity.
    """

    median: float
    """Median of the distribution. If the outcomes are separated, it is the geometric mean of the two stripes
    between which the share passes a half: 0 if the share is above a half at all stripes, infinite if it is
    below at all stripes. NaN if the share does not increase with the intensity, or if no outcome is known."""
    dispersion: float
    """Standard deviation of the logarithm; NaN if unknown."""
    covariance: np.ndarray
    """Covariance of intercept and slope of the probit in ln x, shape (2, 2). It is the sandwich estimate over
    earthquakes: all motions of one earthquake at all stripes count as one observation. NaN if it is unknown:
    for separated outcomes, fewer than three earthquakes, and earthquakes that are all alike."""
    separated: bool
    """Whether the likelihood has no finite maximum, because no motion reaches the state at an intensity below
    one at which some motion does not. The dispersion is then too small to resolve with these stripes."""
    freedom: float = math.nan
    """Degrees of freedom of Student's distribution: number of earthquakes minus the two coefficients."""
    seen: np.ndarray | None = None
    """Data of the stripes, shape (3, stripes); None unless the outcomes are separated. The rows are the
    intensities, the number of earthquakes that reach the state (the share of the motions times all
    earthquakes), and the number of earthquakes with a known outcome."""

    @property
    def words(self) -> tuple[str, str]:
        """Median with its interval, and dispersion, as text."""
        if math.isnan(self.median):
            nothing = self.seen is not None and not self.seen.size
            why = "no outcome is known" if nothing else "the share does not grow with the intensity"
            return "unknown", why
        where = median_words(self.median)
        if 0.0 < self.median < math.inf:
            where += " ({:.4g} to {:.4g})".format(*self.interval())
        if self.seen is None:
            return where, f"{self.dispersion:.3g}"
        stripes, counts, n = self.seen
        # If all outcomes are equal, the median contains all information.
        if not 0.0 < counts.sum() < n.sum():
            return where, "unknown"
        several = "too small to resolve with these stripes"
        return where, several if len(stripes) > 1 else "unknown with one stripe"

    def __str__(self) -> str:
        return "median {}, dispersion {}".format(*self.words)

    def probability(self, x: np.ndarray) -> np.ndarray:
        """Return the probability of the state at intensities x > 0.

        If the outcomes are separated, it is the share of the two stripes around x if they agree, otherwise
        NaN.
        """
        if self.seen is None:
            return ndtr(np.log(np.asarray(x, dtype=float) / self.median) / self.dispersion)
        share = self.seen[1] / self.seen[2]
        low, high = self._around(share, share, x)
        return np.where(low == high, low, np.nan)

    def band(self, x: np.ndarray, level: float = _LEVEL) -> tuple[np.ndarray, np.ndarray]:
        """Return the pointwise confidence band of the probability at intensities x > 0, by the delta method.

        If the outcomes are separated, the band has the exact binomial limits of the stripes around x (C. J.
        Clopper and E. S. Pearson, Biometrika 26, 1934), since the probability increases with x. If nothing is
        known, the band is 0 to 1.
        """
        x = np.asarray(x, dtype=float)
        if self.seen is not None:
            return self._around(*self._limits(level), x)
        if not np.isfinite(self.covariance).all():
            return np.zeros_like(x), np.ones_like(x)
        middle = np.log(x / self.median) / self.dispersion
        width = self._width(np.stack([np.ones_like(x), np.log(x)], axis=-1), level)
        return ndtr(middle - width), ndtr(middle + width)

    def interval(self, level: float = _LEVEL) -> tuple[float, float]:
        """Return the confidence interval of the median, by the delta method.

        If the outcomes are separated, it contains the intensities at which the band contains a half. If
        nothing is known, it is 0 to infinity.
        """
        if self.seen is not None:
            low, high = self._limits(level)
            below, above = self.seen[0][high < 0.5], self.seen[0][low > 0.5]
            return float(below.max(initial=0.0)), float(above.min(initial=math.inf))
        if not np.isfinite(self.covariance).all():
            return 0.0, math.inf
        width = float(self._width(-self.dispersion * np.array([1.0, math.log(self.median)]), level))
        return self.median * _exp(-width), self.median * _exp(width)

    def _width(self, direction: np.ndarray, level: float) -> Any:
        """Return the half widths of the intervals of linear forms of both coefficients, shape (..., 2)."""
        variance = np.einsum("...i,ij,...j->...", direction, self.covariance, direction)
        return stdtrit(self.freedom, 0.5 + 0.5 * level) * np.sqrt(np.maximum(variance, 0.0))

    def _limits(self, level: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the exact binomial limits of the probability at the stripes."""
        assert self.seen is not None
        quantile, (_, counts, n) = 0.5 * (1.0 + level), self.seen
        # The lower limit follows from the upper limit of the complement. If every outcome is a hit, the
        # function returns NaN, and the limit is 1.
        limits = [np.nan_to_num(betaincinv(k + 1.0, n - k, quantile), nan=1.0) for k in (n - counts, counts)]
        return 1.0 - limits[0], limits[1]

    def _around(self, low: np.ndarray, high: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the lower limit of all stripes up to x, and the upper limit of all stripes from x on."""
        assert self.seen is not None
        least = np.maximum.accumulate(np.concatenate([[0.0], low]))
        most = np.minimum.accumulate(np.concatenate([high, [1.0]])[::-1])[::-1]
        at = [np.searchsorted(self.seen[0], x, side=side) for side in ("right", "left")]
        return least[at[0]], most[at[1]]


def median_words(median: float) -> str:
    """Return the median of a `Lognormal` as text."""
    if math.isnan(median):
        return "unknown"
    return {0.0: "below the stripes", math.inf: "above the stripes"}.get(median, f"{median:.4g}")


def fit_lognormal(stripes: np.ndarray, hits: np.ndarray, earthquakes: np.ndarray | None = None) -> Lognormal:
    """Fit a lognormal distribution to the outcomes of motions at stripes (probit regression).

    Args:
        stripes: increasing intensities, shape (stripes,).
        hits: 1 where a motion reaches the state, 0 where it does not, NaN if unknown; shape
            (motions, stripes).
        earthquakes: number of the earthquake of each motion, shape (motions,); by default each motion has its
            own earthquake.

    Raises:
        RuntimeError: the maximum is not reached (never observed).
    """
    answered = np.isfinite(hits)
    n, counts = answered.sum(axis=0), np.where(answered, hits, 0.0).sum(axis=0)
    some, unknown = n > 0, np.full((2, 2), math.nan)
    x, counts, n = np.log(stripes[some]), counts[some], n[some].astype(float)
    # The outcomes are separated if no intensity without the state is above one with it.
    if x[counts < n].max(initial=-math.inf) <= x[counts > 0.0].min(initial=math.inf):
        independent = (added_up(answered, earthquakes) > 0).sum(axis=0)[some]
        seen = np.stack([stripes[some], counts / n * independent, independent])
        # The last stripe with a share up to a half, and the first with a share from a half on. They are the
        # same stripe if its share is exactly a half.
        below = seen[0][2.0 * seen[1] <= seen[2]].max(initial=0.0)
        above = seen[0][2.0 * seen[1] >= seen[2]].min(initial=math.inf)
        return Lognormal(math.sqrt(below * above) if x.size else math.nan, math.nan, unknown, True, seen=seen)
    middle = float(np.average(x, weights=n))
    scale = math.sqrt(float(np.average((x - middle) ** 2, weights=n)))
    # The slope of the maximum has the sign of the derivative of the likelihood at the slope zero.
    if not counts @ (x - middle) > _ROUNDING * (counts @ np.abs(x - middle)):
        return Lognormal(math.nan, math.nan, unknown, False)
    beta = _most_likely((x - middle) / scale, counts, n)
    dispersion = scale / float(beta[1])
    median = _exp(middle - float(beta[0]) * dispersion)
    if not 0.0 < median < math.inf:
        # The share increases, but so slowly that the median is not a finite number.
        return Lognormal(math.nan, math.nan, unknown, False)
    covariance, groups = _sandwich((np.log(stripes) - middle) / scale, hits, beta, earthquakes)
    shift = np.array([[1.0, -middle / scale], [0.0, 1.0 / scale]])
    return Lognormal(median, dispersion, shift @ covariance @ shift.T, False, float(groups - 2))


def _most_likely(x: np.ndarray, counts: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Return intercept and slope with the largest likelihood, for x with mean 0 and standard deviation 1.

    The likelihood is concave, so that its derivative vanishes at the maximum.
    """
    basis = np.stack([np.ones_like(x), x])

    def score(beta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        eta = beta @ basis
        up, down = _density_over(eta), _density_over(-eta)
        curvature = counts * up * (up + eta) + (n - counts) * down * (down - eta)
        return basis @ (counts * up - (n - counts) * down), -(basis * curvature) @ basis.T

    solution = root(score, [float(ndtri(counts.sum() / n.sum())), 0.0], jac=True, tol=1e-14)
    # `solution.success` is false if rounding ends the iteration, so that the derivative is tested instead.
    if not np.abs(solution.fun).max() <= _CONVERGED * n.sum():
        raise RuntimeError(f"the fit of a lognormal curve does not end: counts {counts} of {n}")
    return solution.x


def _sandwich(
    x: np.ndarray, hits: np.ndarray, beta: np.ndarray, earthquakes: np.ndarray | None
) -> tuple[np.ndarray, int]:
    """Return the covariance of the coefficients, and the number of earthquakes with a known outcome.

    The scores of one earthquake at all stripes are added, because they are not independent.
    """
    answered = np.isfinite(hits)
    n = int(added_up(answered, earthquakes).any(axis=1).sum())
    # The scores of all earthquakes add up to zero, so that a single one shows no variance. Two earthquakes
    # leave one direction without variance, and the curve would be certain at one intensity.
    if n < 3:
        return np.full((2, 2), math.nan), n
    basis = np.stack([np.ones_like(x), x])
    eta = beta @ basis
    up, down = _density_over(eta), _density_over(-eta)
    bread = np.linalg.inv((basis * answered.sum(axis=0) * up * down) @ basis.T)
    # One row for each earthquake, because its motions and stripes are not independent observations.
    scores = added_up(np.where(answered, np.where(hits == 1.0, up, -down), 0.0) @ basis.T, earthquakes)
    # Earthquakes that are all alike show no variance either.
    if np.abs(scores).max() < _ROUNDING * answered.sum():
        return np.full((2, 2), math.nan), n
    return n / (n - 1) * bread @ (scores.T @ scores) @ bread, n


def _density_over(eta: np.ndarray) -> np.ndarray:
    """Return the ratio of density and distribution function of the normal distribution."""
    return math.sqrt(2.0 / math.pi) / erfcx(-eta / math.sqrt(2.0))


def _exp(x: float) -> float:
    """Return the exponential of x; infinite if it exceeds the largest double."""
    return math.exp(x) if x < 709.0 else math.inf
