"""Shares, means and paired tests of runs, with intervals of 95 % confidence.

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
from typing import NamedTuple

import numpy as np
from scipy.special import bdtr, ndtri, stdtrit

from tpd.core.formatting import confidence, interval, percent

SIGNIFICANT = 0.05
"""Probability below which a difference between two shares is significant."""
LEVEL = 0.95
"""Confidence level of all intervals."""
_WEIGHT = 1.2
"""Weight, in runs, of each of the two runs that are added to paired runs. If differences in one direction are
rare, the smallest coverage is 94.3 % with this weight and 93.2 % with a weight of 1."""
_MANY = 1e12
"""Degrees of freedom above which Student's distribution equals the normal distribution."""
_MOST_GROWTH = 9.0
"""Largest relative increase at the end of an interval that also contains reductions."""
ROUNDING = 1e-12
"""Relative size below which a number is due to rounding."""


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
        s, z = float(np.mean(hits)), float(ndtri(0.5 * (1.0 + LEVEL)))
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


def unseen(n: int) -> float:
    """Return the largest share (95 % confidence) of outcomes that n independent observations do not show."""
    return 1.0 - (1.0 - LEVEL) ** (1.0 / n)


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
    clusters, if B is not significantly above zero, or if B is so uncertain that the mean may fall or grow
    tenfold. Without runs all numbers are NaN.

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
        # A constant instead of the mean does not vary between runs.
        sizes, extremes = np.full_like(falls, size), ((1.0, size), (-1.0, size))
    low, high = _limits_of_ratio(falls, sizes, extremes, clusters)
    if -math.inf < low < -_MOST_GROWTH and high > 0.0:
        return Interval(float(falls.mean()) / size, -math.inf, 1.0)
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
    above, below, sizes = sums.T
    shares, ratio = sizes / len(tops), above.sum() / (below.sum() or 1.0)
    # Clusters that are all alike contain no information on single runs. Each added run then has the weight of
    # a cluster.
    is_alike = np.abs(above - ratio * below).max() < ROUNDING * len(tops)
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
    quantile = float(stdtrit(min(freedom, _MANY), 0.5 * (1.0 + LEVEL)))
    # (top - r bottom)^2 = quantile^2 times its variance is a quadratic equation for r. If the leading
    # coefficient is not positive, the denominator is not significantly above zero.
    (c, b), (_, a) = np.outer([top, bottom], [top, bottom]) - quantile**2 * deviations.T @ deviations
    if a <= ROUNDING * bottom**2:
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
    error = stdtrit(n - 1, LEVEL) * spread / math.sqrt(n)
    return bool(mean > (error if spread > ROUNDING else unseen(n) * (mean - least)))


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


def quantile_of(values: np.ndarray, share: float) -> float:
    """Return the smallest value of a vector that at least this share of the values does not exceed.

    It is also the smallest value that at most the share 1 - `share` of the values exceeds, which is the rule
    of the validation for limits. NaN counts as larger than any number. The result is NaN without values.
    """
    # The result is never between two values, because it would belong to no run. Without the rounding to
    # 9 decimals, 0.07 * 100 = 7.000000000000001 would count as eight values.
    place = math.ceil(round(share * len(values), 9)) - 1
    return float(np.sort(values)[max(0, place)]) if len(values) else math.nan


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
