"""Lognormal fragility curves: the most likely one for counts at stripes, and its uncertainty.

The likelihood of a probit has a finite maximum just where the outcomes overlap: some motion reaches the state
at an intensity below one at which some motion does not, and the other way about (M. J. Silvapulle, J. R.
Statist. Soc. B 43, 1981). Where the outcomes are separated, no dispersion is most likely. What is known then
is what the stripes see, and that the share grows with the intensity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv, erfcx, log_ndtr, ndtr, ndtri, stdtrit

_ROUNDING = 1e-12
_STEPS = 200
"""Steps of Newton's method, at most; ten are usual."""
_SAFE, _DONE = 1e-6, 1e-18
"""Squares of a Newton step over the standard errors. From the first on whole steps converge by themselves and
differences of the likelihood are lost in its rounding; at the second nothing moves any more."""


@dataclass(frozen=True)
class Lognormal:
    """Probability of a damage state: Phi(ln(x/median)/dispersion) at the intensity x."""

    median: float
    """Where the outcomes are separated, the middle of the stripes between which the share passes a half, in
    the logarithm: 0 if it is above a half at all stripes, infinite if it is below at all of them. NaN where
    the share does not grow with the intensity, and where no outcome is known."""
    dispersion: float
    """NaN where it is not known."""
    covariance: np.ndarray
    """Covariance of the probit's intercept and slope in ln x, shape (2, 2), by the sandwich over earthquakes:
    all motions of one at all stripes count as one. NaN where nothing is known of it: of separated outcomes,
    and of fewer than three earthquakes."""
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
        return f"median {where}{self._spread()}"

    def _spread(self) -> str:
        """Words about the dispersion."""
        if self.seen is None:
            return f", dispersion {self.dispersion:.3g}"
        stripes, counts, n = self.seen
        # Where all outcomes are the same, the median says it all.
        if not 0.0 < counts.sum() < n.sum():
            return ""
        return f", dispersion {'less than the stripes see' if len(stripes) > 1 else 'not seen by one stripe'}"

    def probability(self, x: np.ndarray) -> np.ndarray:
        """Probability of the state at intensities x > 0. Of separated outcomes the share of the stripes
        around x where it is the same at both, else NaN."""
        if self.seen is None:
            return ndtr(np.log(np.asarray(x, dtype=float) / self.median) / self.dispersion)
        share = self.seen[1] / self.seen[2]
        low, high = self._around(share, share, x)
        return np.where(low == high, low, np.nan)

    def band(self, x: np.ndarray, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Pointwise confidence band of the probability at intensities x > 0, by the delta method.

        Of separated outcomes by the exact binomial limits of the stripes around x (C. J. Clopper and E. S.
        Pearson, Biometrika 26, 1934), since the probability grows. From 0 to 1 where nothing is known.
        """
        x = np.asarray(x, dtype=float)
        if self.seen is not None:
            return self._around(*self._limits(level), x)
        if not np.isfinite(self.covariance).all():
            return np.zeros_like(x), np.ones_like(x)
        basis = np.stack([np.ones_like(x), np.log(x)])
        middle = (basis[1] - math.log(self.median)) / self.dispersion
        variance = np.einsum("in,ij,jn->n", basis, self.covariance, basis)
        width = stdtrit(self.freedom, 0.5 + 0.5 * level) * np.sqrt(np.maximum(variance, 0.0))
        return ndtr(middle - width), ndtr(middle + width)

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval of the median, by the delta method. Of separated outcomes the intensities at
        which the band holds a half; from 0 to infinity where nothing is known."""
        if self.seen is not None:
            low, high = self._limits(level)
            below, above = self.seen[0][high < 0.5], self.seen[0][low > 0.5]
            return float(below.max(initial=0.0)), float(above.min(initial=math.inf))
        if not np.isfinite(self.covariance).all():
            return 0.0, math.inf
        toward = -self.dispersion * np.array([1.0, math.log(self.median)])
        variance = max(toward @ self.covariance @ toward, 0.0)
        width = float(stdtrit(self.freedom, 0.5 + 0.5 * level)) * math.sqrt(variance)
        return self.median * _exp(-width), self.median * _exp(width)

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
    """Most likely lognormal distribution for the outcomes of motions at stripes.

    Args:
        stripes: intensities, increasing, shape (stripes,).
        hits: 1 where a motion reaches the state, 0 where not, NaN where nothing is known; shape (motions,
            stripes).
        earthquakes: number of the earthquake of every motion, shape (motions,); by default each has its own.

    Newton's method on the intercept and the slope in the logarithm of the intensity: the likelihood is
    concave, and has one maximum unless the outcomes are separated.

    Raises:
        RuntimeError: the maximum is not reached (not known to happen).
    """
    known = np.isfinite(hits)
    n, counts = known.sum(axis=0), np.where(known, hits, 0.0).sum(axis=0)
    independent = (added_up(known, earthquakes) > 0).sum(axis=0)
    some = n > 0
    x, counts, n = np.log(stripes[some]), counts[some], n[some].astype(float)
    # The highest intensity without the state is no higher than the lowest with it.
    if x[counts < n].max(initial=-math.inf) <= x[counts > 0.0].min(initial=math.inf):
        return _separated(np.stack([stripes[some], counts / n * independent[some], independent[some]]))
    middle = float(np.average(x, weights=n))
    scale = math.sqrt(float(np.average((x - middle) ** 2, weights=n)))
    # The most likely slope has the sign of the likelihood's derivative at the slope of zero.
    if not counts @ (x - middle) > _ROUNDING * (counts @ np.abs(x - middle)):
        return Lognormal(math.nan, math.nan, np.full((2, 2), math.nan), False)
    beta = _most_likely((x - middle) / scale, counts, n)
    covariance = _sandwich((np.log(stripes) - middle) / scale, hits, beta, earthquakes)
    shift = np.array([[1.0, -middle / scale], [0.0, 1.0 / scale]])
    dispersion = scale / float(beta[1])
    median = _exp(middle - float(beta[0]) * dispersion)
    if not 0.0 < median < math.inf:
        # The share grows, but so little that no number is its median.
        return Lognormal(math.nan, math.nan, np.full((2, 2), math.nan), False)
    freedom = float(int(added_up(known, earthquakes).any(axis=1).sum()) - 2)
    return Lognormal(median, dispersion, shift @ covariance @ shift.T, False, freedom)


def _separated(seen: np.ndarray) -> Lognormal:
    """Distribution where the outcomes are separated; see `Lognormal.seen`."""
    stripes, counts, n = seen
    # The last stripe up to a half, and the first from a half on: the same one if it is just at a half.
    below = stripes[2.0 * counts <= n].max(initial=0.0)
    above = stripes[2.0 * counts >= n].min(initial=math.inf)
    median = math.sqrt(below * above) if stripes.size else math.nan
    return Lognormal(median, math.nan, np.full((2, 2), math.nan), True, seen=seen)


def _most_likely(x: np.ndarray, counts: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Intercept and slope of the largest likelihood, for x of the mean 0 and the deviation 1."""
    basis = np.stack([np.ones_like(x), x])
    beta = np.array([float(ndtri(counts.sum() / n.sum())), 0.0])
    for _ in range(_STEPS):
        eta = beta @ basis
        up, down = _density_over(eta), _density_over(-eta)
        gradient = basis @ (counts * up - (n - counts) * down)
        curvature = (basis * (counts * up * (up + eta) + (n - counts) * down * (down - eta))) @ basis.T
        step = np.linalg.solve(curvature, gradient)
        size, base = float(gradient @ step), _likelihood(eta, counts, n)
        # Far from the maximum a whole step may lead away from it.
        while size > _SAFE and _likelihood((beta + step) @ basis, counts, n) < base:
            step = 0.5 * step
        beta = beta + step
        if size < _DONE:
            return beta
    raise RuntimeError(f"the fit of a lognormal curve is not done in {_STEPS} steps: counts {counts} of {n}")


def added_up(values: np.ndarray, earthquakes: np.ndarray | None) -> np.ndarray:
    """Sums of rows, one a motion, over the motions of each earthquake; without numbers each is of its own."""
    if earthquakes is None:
        return values
    found, numbers = np.unique(earthquakes, return_inverse=True)
    sums = np.zeros((len(found), *values.shape[1:]))
    np.add.at(sums, numbers, values)
    return sums


def _sandwich(
    x: np.ndarray, hits: np.ndarray, beta: np.ndarray, earthquakes: np.ndarray | None
) -> np.ndarray:
    """Covariance of the coefficients, in which the scores of an earthquake at all stripes belong together."""
    known = np.isfinite(hits)
    n = int(added_up(known, earthquakes).any(axis=1).sum())
    # The scores of all earthquakes add up to zero: those of a single one show no spread.
    # Two leave one direction without spread, and with it one intensity at which nothing would be in doubt.
    if n < 3:
        return np.full((2, 2), math.nan)
    basis = np.stack([np.ones_like(x), x])
    eta = beta @ basis
    up, down = _density_over(eta), _density_over(-eta)
    bread = np.linalg.inv((basis * known.sum(axis=0) * up * down) @ basis.T)
    # One row an earthquake: its motions and stripes are no independent observations.
    scores = added_up(np.where(known, np.where(hits == 1.0, up, -down), 0.0) @ basis.T, earthquakes)
    return n / (n - 1) * bread @ (scores.T @ scores) @ bread


def _density_over(eta: np.ndarray) -> np.ndarray:
    """Density of the normal distribution over its distribution function, without loss of digits."""
    return math.sqrt(2.0 / math.pi) / erfcx(-eta / math.sqrt(2.0))


def _likelihood(eta: np.ndarray, counts: np.ndarray, n: np.ndarray) -> float:
    """Logarithm of the likelihood."""
    return float(np.sum(counts * log_ndtr(eta) + (n - counts) * log_ndtr(-eta)))


def _exp(x: float) -> float:
    """Exponential, infinite where it is no number of a double."""
    return math.exp(x) if x < 709.0 else math.inf
