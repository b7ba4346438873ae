"""Shares, means, paired tests and lognormal curves of runs, with their confidence of 95 %.

Runs of one cluster, such as an earthquake, are no independent observations: the variance is that between
clusters (a bias-reduced cluster-robust variance), and the quantile is Student's. Distributions are those of
`scipy.special`, because `scipy.stats`, which the tests compare with, takes most of a second to load.

Clusters that are all alike show no spread between them, and yet others may differ. `_limits_of_ratio`
therefore adds two extreme runs to paired runs, and `is_positive` allows for a share `unseen(n)` of others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import root
from scipy.special import bdtr, betaincinv, erfcx, ndtr, ndtri, stdtrit

SIGNIFICANT = 0.05
"""Chance below which a difference between two shares is not put down to luck."""
_LEVEL = 0.95
_WEIGHT = 1.2
"""Weight, in runs, of each of the two runs that are added to paired runs. Where differences of one direction
are rare, the worst coverage is 94.3 % with this weight and 93.2 % with a weight of 1."""
_MANY = 1e12
"""Degrees of freedom at which Student's distribution is the normal distribution."""
_ROUNDING = 1e-12
_DONE = 1e-8
"""Derivative of the likelihood of one outcome at its maximum, at most: some 1e-13 is usual."""


class Share(NamedTuple):
    """A share of the runs, with its 95 % confidence interval (Wilson's)."""

    value: float
    low: float
    high: float

    @staticmethod
    def of(hits: np.ndarray) -> Share:
        """Share of the true entries in a vector; NaN, between 0 and 1, of none."""
        if not len(hits):
            return Share(math.nan, 0.0, 1.0)
        # Wilson's interval stays within 0 to 1 and is not empty where no run, or every run, is a hit.
        n, s, z = len(hits), float(np.mean(hits)), float(ndtri(0.5 * (1.0 + _LEVEL)))
        middle = (s + z**2 / (2 * n)) / (1 + z**2 / n)
        half = z / (1 + z**2 / n) * math.sqrt(s * (1 - s) / n + z**2 / (4 * n**2))
        return Share(s, max(0.0, middle - half), min(1.0, middle + half))

    def __str__(self) -> str:
        return f"{self.value:.1%} ({self.low:.1%} to {self.high:.1%})"


@dataclass(frozen=True)
class Interval:
    """A mean with its interval of 95 % confidence."""

    mean: float
    low: float
    high: float

    def words(self, share: bool = True) -> str:
        """The mean and its interval, in per cent if it is a share."""
        form = "{:+.1%}" if share else "{:+.3f}"
        # Of a single earthquake nothing is known but the mean.
        if math.isinf(self.low):
            return f"{form.format(self.mean)} (unknown)"
        return f"{form.format(self.mean)} ({form.format(self.low)} to {form.format(self.high)})"

    def fall_in_words(self) -> tuple[bool, str, str]:
        """Return whether a relative fall is no rise, its size, and, if it is known, its interval."""
        # A share that rounds to zero must not read "-0 %".
        less = self.mean > -0.005
        ends = (self.mean, self.low, self.high) if less else (-self.mean, -self.high, -self.low)
        mean, low, high = (100.0 * x + 0.0 for x in ends)
        around = f" (95 % interval {low:.0f} to {high:.0f} %)" if math.isfinite(low) else ""
        return less, f"{abs(mean):.0f} %", around

    @property
    def is_above(self) -> bool:
        """Whether the whole interval is above zero."""
        return self.low > 0.0


def unseen(n: int) -> float:
    """Return the largest share (95 % confidence) of what n independent observations never show."""
    return 1.0 - (1.0 - _LEVEL) ** (1.0 / n)


def change(
    with_pendulum: np.ndarray, without_pendulum: np.ndarray, clusters: np.ndarray | None = None
) -> Interval:
    """Return the mean difference of paired runs, with the pendulum minus without, and its interval.

    The interval is infinite if there are fewer than two clusters, and the mean of no runs is NaN.

    Args:
        with_pendulum: a number from 0 to 1 for each run, such as its severity, shape (runs,).
        without_pendulum: the same for the runs without the pendulum, shape (runs,).
        clusters: a number for each run, equal for runs that depend on each other; by default every run is
            independent.

    Example:
        >>> overturned = np.array([True] * 30 + [False] * 70)
        >>> change(np.zeros(100), overturned).words()
        '-30.0% (-38.8% to -19.8%)'
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
    """Return the share by which the mean of paired runs falls with the pendulum, and its interval.

    The fall is (B - H) / B with the means B without and H with the pendulum; 0 if both means are 0. A mean B
    below `least` counts as `least`. The interval is infinite if there are fewer than two clusters, and if B
    is not significantly above zero. All numbers are NaN if there are no runs.

    Args:
        with_pendulum: a number from 0 to 1 for each run, such as its severity, shape (runs,).
        without_pendulum: the same for the runs without the pendulum, shape (runs,).
        clusters: see `change`.
        least: smallest mean without the pendulum.

    Example:
        >>> overturned = np.array([True] * 30 + [False] * 70)
        >>> fall(overturned & (np.arange(100) < 12), overturned).words()
        '+60.0% (+37.2% to +77.0%)'
    """
    if not without_pendulum.size:
        return Interval(math.nan, math.nan, math.nan)
    falls = without_pendulum.astype(float) - with_pendulum
    mean = float(without_pendulum.mean())
    size = max(mean, least) or 1.0
    if mean >= least:
        # Of the two extreme runs one is severe only with the pendulum and the other only without it.
        sizes, extremes = without_pendulum.astype(float), ((1.0, 1.0), (-1.0, 0.0))
    else:
        # A constant in place of the mean does not vary from run to run.
        sizes, extremes = np.full_like(falls, size), ((1.0, size), (-1.0, size))
    low, high = _limits_of_ratio(falls, sizes, extremes, clusters)
    return Interval(float(falls.mean()) / size, low, high if math.isinf(low) else min(1.0, high))


def _limits_of_ratio(
    tops: np.ndarray,
    bottoms: np.ndarray,
    extremes: tuple[tuple[float, float], tuple[float, float]],
    clusters: np.ndarray | None,
) -> tuple[float, float]:
    """Return the 95 % limits of sum(tops) / sum(bottoms): Fieller's interval (E. C. Fieller, J. R. Statist.
    Soc. B 16, 1954).

    The limits hold the ratios r for which the mean of tops - r * bottoms is not significant. The variance of
    this mean is the bias-reduced cluster-robust one (CR2) with the degrees of freedom of R. M. Bell and D. F.
    McCaffrey (Survey Methodology 28, 2002), for clusters of different sizes.

    Rare events make this variance too small if the sample has few of them, and zero if it has none. Therefore
    two runs are added at the extremes, one in either direction, as D. G. Bonett and R. M. Price do for paired
    proportions (J. Educ. Behav. Statist. 37, 2012). Their variance is known. Satterthwaite's rule gives the
    degrees of freedom of the sum.

    Args:
        tops: shape (runs,).
        bottoms: shape (runs,).
        extremes: top and bottom of either added run.
        clusters: see `change`.
    """
    sums = added_up(np.stack([tops, bottoms, np.ones_like(tops)], axis=1), clusters)
    if len(sums) < 2:
        return -math.inf, math.inf
    shares = sums[:, 2] / len(tops)
    ratio = sums[:, 0].sum() / (sums[:, 1].sum() or 1.0)
    # Clusters that are all alike say nothing about runs. Then the added runs weigh as much as a cluster.
    is_alike = np.abs(sums[:, 0] - ratio * sums[:, 1]).max() < _ROUNDING * len(tops)
    weight = _WEIGHT * (len(tops) / len(sums) if is_alike else 1.0)
    added = weight * np.column_stack([extremes, np.ones(2)])
    top, bottom, size = sums.sum(axis=0) + added.sum(axis=0)
    # Deviations of the sums from what clusters of these sizes have on average, with the factor of CR2.
    deviations = np.concatenate([sums, added])
    deviations = deviations[:, :2] - np.outer(deviations[:, 2] / size, [top, bottom])
    deviations[:-2] /= np.sqrt(1.0 - shares)[:, None]
    squares = (deviations @ [1.0, -top / bottom]) ** 2
    of_clusters = float(squares[:-2].sum())
    freedom = math.inf
    if not is_alike:
        freedom = degrees_of_freedom(shares) * (float(squares.sum()) / of_clusters) ** 2
    quantile = float(stdtrit(min(freedom, _MANY), 0.5 * (1.0 + _LEVEL)))
    # (top - r bottom)^2 = quantile^2 times its variance, a quadratic equation in r.
    (c, b), (_, a) = np.outer([top, bottom], [top, bottom]) - quantile**2 * deviations.T @ deviations
    if a <= _ROUNDING * bottom**2:
        return -math.inf, math.inf
    width = math.sqrt(max(0.0, b**2 - a * c))
    return float((b - width) / a), float((b + width) / a)


def degrees_of_freedom(shares: np.ndarray) -> float:
    """Return Bell and McCaffrey's degrees of freedom of a mean over clusters.

    Clusters of equal size have their number minus one, and those of different sizes have fewer.

    Args:
        shares: share of the runs that each cluster has, shape (clusters,).

    Example:
        >>> [round(degrees_of_freedom(np.array(x)), 3) for x in ([0.25] * 4, [0.8, 0.1, 0.1])]
        [3.0, 1.246]
    """
    # Covariances of the clusters' terms, over the trace: w_g on the diagonal and b_g b_h beside it, both
    # squared and summed.
    b = shares**2 / (1.0 - shares)
    return float(1.0 / (np.sum(shares**2) + np.sum(b) ** 2 - np.sum(b**2)))


def is_positive(values: np.ndarray, least: float = -1.0, clusters: np.ndarray | None = None) -> bool:
    """Whether the mean of values is above zero, at 5 %: Student's one-sided test between clusters or, where
    all are alike, with the unseen share of others at the `least` value that there may be."""
    if clusters is not None:
        sizes = added_up(np.ones(len(values)), clusters)
        values = added_up(values, clusters) / (sizes.mean() if sizes.size else 1.0)
    n = len(values)
    if n < 2:
        return False
    mean, spread = float(values.mean()), float(values.std(ddof=1))
    error = stdtrit(n - 1, _LEVEL) * spread / math.sqrt(n)
    return bool(mean > (error if spread > _ROUNDING else unseen(n) * (mean - least)))


def added_up(values: np.ndarray, clusters: np.ndarray | None) -> np.ndarray:
    """Sums of rows, one a run, over the runs of each cluster; without numbers each is a cluster of its
    own."""
    if clusters is None:
        return values
    found, numbers = np.unique(clusters, return_inverse=True)
    sums = np.zeros((len(found), *values.shape[1:]))
    np.add.at(sums, numbers, values)
    return sums


def chance_of(worse: int, better: int) -> float:
    """Chance that of all runs that differ at least `worse` would go against the pendulum, were either way
    equally likely (McNemar's test, exact and one-sided)."""
    # Runs that end alike with and without say nothing about the difference, so that only the others count.
    return float(bdtr(better, worse + better, 0.5))


def chance_of_either(x: int, y: int) -> float:
    """Chance of so uneven a split to either side (McNemar's test, exact and two-sided)."""
    return min(1.0, 2.0 * chance_of(max(x, y), min(x, y)))


def mcnemar(a: np.ndarray, b: np.ndarray, quakes: np.ndarray | None = None) -> np.ndarray:
    """Two-sided exact probability, at each stripe, of so uneven a split of the earthquakes that differ: those
    in which more motions reach the state in one case than in the other. The largest that is possible where
    outcomes are not known.

    Args:
        a, b: 1 where a motion reaches the state, 0 where not, NaN where nothing is known; (motions, stripes).
        quakes: number of the earthquake of every motion; by default each has its own.
    """
    # Motions of each earthquake that reach it in case a less those in case b, as few and as many as may be.
    low, high = (
        added_up(np.nan_to_num(a, nan=x) - np.nan_to_num(b, nan=1.0 - x), quakes) for x in (0.0, 1.0)
    )
    only_a, only_b = np.sum(low > 0.0, axis=0), np.sum(high < 0.0, axis=0)
    may_a, may_b = np.sum((low <= 0.0) & (high > 0.0), axis=0), np.sum((high >= 0.0) & (low < 0.0), axis=0)
    # The rarer outcome comes as near to the other as it can.
    x = np.where(only_a < only_b, np.minimum(only_a + may_a, only_b), only_a)
    y = np.where(only_b < only_a, np.minimum(only_b + may_b, only_a), only_b)
    return np.array([chance_of_either(int(i), int(j)) for i, j in zip(x, y, strict=True)])


@dataclass(frozen=True)
class Lognormal:
    """Probability of a damage state: Phi(ln(x/median)/dispersion) at the intensity x.

    The likelihood has a finite maximum just where the outcomes overlap: some motion reaches the state at an
    intensity below one at which some motion does not, and the other way about (M. J. Silvapulle, J. R.
    Statist. Soc. B 43, 1981). Else what is known is what the stripes see, and that the share grows with the
    intensity.
    """

    median: float
    """Where the outcomes are separated, the middle of the stripes between which the share passes a half, in
    the logarithm: 0 if it is above a half at all stripes, infinite if it is below at all of them. NaN where
    the share does not grow with the intensity, and where no outcome is known."""
    dispersion: float
    """NaN where it is not known."""
    covariance: np.ndarray
    """Covariance of the probit's intercept and slope in ln x, shape (2, 2), by the sandwich over earthquakes:
    all motions of one at all stripes count as one. NaN where nothing is known of it: of separated outcomes,
    of fewer than three earthquakes, and of earthquakes that are all alike."""
    separated: bool
    """Whether the likelihood has no finite maximum: no motion reaches the state at a lower intensity than one
    at which some motion does not. The dispersion is anything below what the stripes see."""
    freedom: float = math.nan
    """Degrees of freedom of Student's distribution: earthquakes less the two coefficients."""
    seen: np.ndarray | None = None
    """Intensities of the stripes, earthquakes that reach the state (the share of the motions times all), and
    earthquakes with a motion whose outcome is known, shape (3, stripes); None unless separated."""

    def __str__(self) -> str:
        if math.isnan(self.median):
            nothing = self.seen is not None and not self.seen.size
            why = "no outcome is known" if nothing else "the share does not grow with the intensity"
            return f"median unknown: {why}"
        where = median_words(self.median)
        if 0.0 < self.median < math.inf:
            low, high = self.interval()
            where += f" ({low:.4g} to {high:.4g})"
        if self.seen is None:
            return f"median {where}, dispersion {self.dispersion:.3g}"
        stripes, counts, n = self.seen
        # Where all outcomes are the same, the median says it all.
        if not 0.0 < counts.sum() < n.sum():
            return f"median {where}"
        spread = "less than the stripes see" if len(stripes) > 1 else "not seen by one stripe"
        return f"median {where}, dispersion {spread}"

    def probability(self, x: np.ndarray) -> np.ndarray:
        """Probability of the state at intensities x > 0. Of separated outcomes the share of the stripes
        around x where it is the same at both, else NaN."""
        if self.seen is None:
            return ndtr(np.log(np.asarray(x, dtype=float) / self.median) / self.dispersion)
        share = self.seen[1] / self.seen[2]
        low, high = self._around(share, share, x)
        return np.where(low == high, low, np.nan)

    def band(self, x: np.ndarray, level: float = _LEVEL) -> tuple[np.ndarray, np.ndarray]:
        """Pointwise confidence band of the probability at intensities x > 0, by the delta method.

        Of separated outcomes by the exact binomial limits of the stripes around x (C. J. Clopper and E. S.
        Pearson, Biometrika 26, 1934), since the probability grows. From 0 to 1 where nothing is known.
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
        """Confidence interval of the median, by the delta method. Of separated outcomes the intensities at
        which the band holds a half; from 0 to infinity where nothing is known."""
        if self.seen is not None:
            low, high = self._limits(level)
            below, above = self.seen[0][high < 0.5], self.seen[0][low > 0.5]
            return float(below.max(initial=0.0)), float(above.min(initial=math.inf))
        if not np.isfinite(self.covariance).all():
            return 0.0, math.inf
        width = float(self._width(-self.dispersion * np.array([1.0, math.log(self.median)]), level))
        return self.median * _exp(-width), self.median * _exp(width)

    def _width(self, toward: np.ndarray, level: float) -> Any:
        """Half widths of the intervals of linear forms in both coefficients, shape (..., 2)."""
        variance = np.einsum("...i,ij,...j->...", toward, self.covariance, toward)
        return stdtrit(self.freedom, 0.5 + 0.5 * level) * np.sqrt(np.maximum(variance, 0.0))

    def _limits(self, level: float) -> tuple[np.ndarray, np.ndarray]:
        """Exact binomial limits of the probability at the stripes that are seen."""
        assert self.seen is not None
        sure, (_, counts, n) = 0.5 * (1.0 + level), self.seen
        # The share of what does not happen is limited in the same way. Where it always happens, the function
        # has no number, and the limit is 1.
        limits = [np.nan_to_num(betaincinv(k + 1.0, n - k, sure), nan=1.0) for k in (n - counts, counts)]
        return 1.0 - limits[0], limits[1]

    def _around(self, low: np.ndarray, high: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lower limit of all stripes up to x, and upper limit of all from x on."""
        assert self.seen is not None
        least = np.maximum.accumulate(np.concatenate([[0.0], low]))
        most = np.minimum.accumulate(np.concatenate([high, [1.0]])[::-1])[::-1]
        at = [np.searchsorted(self.seen[0], x, side=side) for side in ("right", "left")]
        return least[at[0]], most[at[1]]


def median_words(median: float) -> str:
    """The median of a `Lognormal` in words."""
    if math.isnan(median):
        return "unknown"
    return {0.0: "below the stripes", math.inf: "above the stripes"}.get(median, f"{median:.4g}")


def fit_lognormal(stripes: np.ndarray, hits: np.ndarray, earthquakes: np.ndarray | None = None) -> Lognormal:
    """Most likely lognormal distribution for the outcomes of motions at stripes (probit regression).

    Args:
        stripes: intensities, increasing, shape (stripes,).
        hits: 1 where a motion reaches the state, 0 where not, NaN where nothing is known; shape (motions,
            stripes).
        earthquakes: number of the earthquake of every motion, shape (motions,); by default each has its own.

    Raises:
        RuntimeError: the maximum is not reached (not known to happen).
    """
    known = np.isfinite(hits)
    n, counts = known.sum(axis=0), np.where(known, hits, 0.0).sum(axis=0)
    some, unknown = n > 0, np.full((2, 2), math.nan)
    x, counts, n = np.log(stripes[some]), counts[some], n[some].astype(float)
    # The highest intensity without the state is no higher than the lowest with it.
    if x[counts < n].max(initial=-math.inf) <= x[counts > 0.0].min(initial=math.inf):
        independent = (added_up(known, earthquakes) > 0).sum(axis=0)[some]
        seen = np.stack([stripes[some], counts / n * independent, independent])
        # The last stripe up to a half, and the first from a half on: the same one if it is just at a half.
        below = seen[0][2.0 * seen[1] <= seen[2]].max(initial=0.0)
        above = seen[0][2.0 * seen[1] >= seen[2]].min(initial=math.inf)
        return Lognormal(math.sqrt(below * above) if x.size else math.nan, math.nan, unknown, True, seen=seen)
    middle = float(np.average(x, weights=n))
    scale = math.sqrt(float(np.average((x - middle) ** 2, weights=n)))
    # The most likely slope has the sign of the likelihood's derivative at the slope of zero.
    if not counts @ (x - middle) > _ROUNDING * (counts @ np.abs(x - middle)):
        return Lognormal(math.nan, math.nan, unknown, False)
    beta = _most_likely((x - middle) / scale, counts, n)
    dispersion = scale / float(beta[1])
    median = _exp(middle - float(beta[0]) * dispersion)
    if not 0.0 < median < math.inf:
        # The share grows, but so little that no number is its median.
        return Lognormal(math.nan, math.nan, unknown, False)
    covariance, groups = _sandwich((np.log(stripes) - middle) / scale, hits, beta, earthquakes)
    shift = np.array([[1.0, -middle / scale], [0.0, 1.0 / scale]])
    return Lognormal(median, dispersion, shift @ covariance @ shift.T, False, float(groups - 2))


def _most_likely(x: np.ndarray, counts: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Intercept and slope of the largest likelihood, for x of the mean 0 and the deviation 1: where its
    derivative vanishes, since it is concave."""
    basis = np.stack([np.ones_like(x), x])

    def score(beta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        eta = beta @ basis
        up, down = _density_over(eta), _density_over(-eta)
        curvature = counts * up * (up + eta) + (n - counts) * down * (down - eta)
        return basis @ (counts * up - (n - counts) * down), -(basis * curvature) @ basis.T

    found = root(score, [float(ndtri(counts.sum() / n.sum())), 0.0], jac=True, tol=1e-14)
    # `found.success` is false where rounding ends the steps.
    if not np.abs(found.fun).max() <= _DONE * n.sum():
        raise RuntimeError(f"the fit of a lognormal curve does not end: counts {counts} of {n}")
    return found.x


def _sandwich(
    x: np.ndarray, hits: np.ndarray, beta: np.ndarray, earthquakes: np.ndarray | None
) -> tuple[np.ndarray, int]:
    """Covariance of the coefficients, in which the scores of an earthquake at all stripes belong together,
    and the number of earthquakes with a motion whose outcome is known."""
    known = np.isfinite(hits)
    n = int(added_up(known, earthquakes).any(axis=1).sum())
    # The scores of all earthquakes add up to zero: those of a single one show no spread.
    # Two leave one direction without spread, and with it one intensity at which nothing would be in doubt.
    if n < 3:
        return np.full((2, 2), math.nan), n
    basis = np.stack([np.ones_like(x), x])
    eta = beta @ basis
    up, down = _density_over(eta), _density_over(-eta)
    bread = np.linalg.inv((basis * known.sum(axis=0) * up * down) @ basis.T)
    # One row an earthquake: its motions and stripes are no independent observations.
    scores = added_up(np.where(known, np.where(hits == 1.0, up, -down), 0.0) @ basis.T, earthquakes)
    # Earthquakes that all end alike show no spread between them either.
    if np.abs(scores).max() < _ROUNDING * known.sum():
        return np.full((2, 2), math.nan), n
    return n / (n - 1) * bread @ (scores.T @ scores) @ bread, n


def _density_over(eta: np.ndarray) -> np.ndarray:
    """Density of the normal distribution over its distribution function, without loss of digits."""
    return math.sqrt(2.0 / math.pi) / erfcx(-eta / math.sqrt(2.0))


def _exp(x: float) -> float:
    """Exponential, infinite where it is no number of a double."""
    return math.exp(x) if x < 709.0 else math.inf
