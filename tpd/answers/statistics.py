"""Shares, means, paired tests and lognormal curves of runs, with their confidence of 95 %.

Runs of one cluster, such as an earthquake, are no independent observations: the variance is that between
clusters (a cluster-robust variance), and the quantile is Student's. Distributions are those of
`scipy.special`, because `scipy.stats`, which the tests compare with, takes most of a second to load.

Clusters that are all alike show no spread between them, and yet others may differ. The chance of n like ones
is at most 1 - `_LEVEL` where the share of others is `unseen(n)` or more (the rule of three, one-sided and
exact). So intervals reach as far as that share of others, whatever these are, could move the mean.
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

    @property
    def is_below(self) -> bool:
        """Whether the whole interval is below zero."""
        return self.high < 0.0

    @property
    def is_above(self) -> bool:
        """Whether the whole interval is above zero."""
        return self.low > 0.0


def unseen(n: int) -> float:
    """Return the largest share (95 % confidence) of what n independent observations never show."""
    return 1.0 - (1.0 - _LEVEL) ** (1.0 / n)


def change(hung: np.ndarray, bare: np.ndarray, clusters: np.ndarray | None = None) -> Interval:
    """Mean of what each run has with the pendulum less what it has without, numbers from 0 to 1. Of a single
    cluster nothing is known: the interval is infinite; and without any run the mean is NaN.

    Args:
        hung, bare: shape (runs,).
        clusters: a number for each run, the same for runs that are alike; default each run its own.
    """
    found = _mean(hung.astype(float) - bare, clusters)
    if math.isinf(found.low):
        return found
    if _is_narrow(found):
        others = unseen(_count(hung, clusters))
        return Interval(
            found.mean, found.mean - others * (found.mean + 1.0), found.mean + others * (1.0 - found.mean)
        )
    # Shares and tilts over that of toppling lie between nought and one, so that changes end at one.
    return Interval(found.mean, max(-1.0, found.low), min(1.0, found.high))


def fall(
    hung: np.ndarray, bare: np.ndarray, clusters: np.ndarray | None = None, least: float = 0.0
) -> Interval:
    """Share by which the mean of runs falls, a ratio of means, with the interval of its linearisation; 0
    where both means are 0. A mean without the pendulum below `least` counts as that."""
    if not bare.size:
        return Interval(math.nan, math.nan, math.nan)
    size = max(float(bare.mean()), least) or 1.0
    ratio = float(bare.mean() - hung.mean()) / size
    # A mean that counts as another number does not vary.
    varies = ratio * bare if bare.mean() > least else np.full_like(bare, ratio * size)
    around = _mean((bare - hung - varies) / size, clusters)
    if math.isinf(around.low):
        return Interval(ratio, around.low, around.high)
    if _is_narrow(around):
        # Others have the largest tilt with the pendulum and none without it, or none with it.
        share = unseen(_count(hung, clusters))
        with_it, without = (1.0 - share) * hung.mean(), (1.0 - share) * bare.mean()
        low = (without - with_it - share) / (max(without, least) or 1.0)
        return Interval(ratio, low, (without + share - with_it) / max(without + share, least))
    return Interval(ratio, ratio + around.low, min(1.0, ratio + around.high))


def _is_narrow(around: Interval) -> bool:
    """Whether an interval has no width but rounding."""
    return around.high - around.low < _ROUNDING


def _count(values: np.ndarray, clusters: np.ndarray | None) -> int:
    """Number of independent observations."""
    return len(values if clusters is None else np.unique(clusters))


def _mean(values: np.ndarray, clusters: np.ndarray | None) -> Interval:
    """Mean of values, (runs,), with its interval."""
    mean = float(np.mean(values)) if len(values) else math.nan
    # Within a cluster the deviations add up, and only their sums are independent.
    sums = added_up(values - mean, clusters)
    # One cluster has no spread between clusters.
    if len(sums) < 2:
        return Interval(mean, -math.inf, math.inf)
    error = math.sqrt(len(sums) / (len(sums) - 1) * float(np.sum(sums**2))) / len(values)
    width = float(stdtrit(len(sums) - 1, 0.5 * (1.0 + _LEVEL))) * error
    return Interval(mean, mean - width, mean + width)


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
