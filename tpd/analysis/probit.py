"""Lognormal fragility curves: the most likely one for counts at stripes, and its uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

_NORMAL = NormalDist()
_STEEPEST, _FLATTEST = 1e3, 1e-2
"""Bounds on the slope of the probit in the logarithm of the intensity: dispersions from 0.001 to 100."""


@dataclass(frozen=True)
class Lognormal:
    """Probability of a damage state: Phi(ln(x/median)/dispersion) at the intensity x."""

    median: float
    """NaN where the counts do not determine it: no stripe, or every stripe, reaches the state."""
    dispersion: float
    covariance: np.ndarray
    """Covariance of the probit's intercept and slope in ln x, shape (2, 2)."""
    separated: bool
    """Whether no stripe has both outcomes, so that the dispersion is anything below what the stripes see."""

    def __str__(self) -> str:
        if math.isnan(self.median):
            return "median beyond the stripes"
        low, high = self.interval()
        spread = "less than the stripes see" if self.separated else f"{self.dispersion:.3g}"
        return f"median {self.median:.4g} ({low:.4g} to {high:.4g}), dispersion {spread}"

    def probability(self, x: np.ndarray) -> np.ndarray:
        """Probability of the state at intensities x > 0."""
        return _cdf(np.log(np.asarray(x, dtype=float) / self.median) / self.dispersion)

    def band(self, x: np.ndarray, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Pointwise confidence band of the probability at intensities x > 0, by the delta method."""
        basis = np.stack([np.ones_like(np.asarray(x, dtype=float)), np.log(x)])
        slope = 1.0 / self.dispersion
        middle = slope * (basis[1] - math.log(self.median))
        variance = np.einsum("in,ij,jn->n", basis, self.covariance, basis)
        width = _NORMAL.inv_cdf(0.5 + 0.5 * level) * np.sqrt(np.maximum(variance, 0.0))
        return _cdf(middle - width), _cdf(middle + width)

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval of the median, by the delta method."""
        slope = 1.0 / self.dispersion
        toward = np.array([-1.0 / slope, -math.log(self.median) / slope])
        width = _NORMAL.inv_cdf(0.5 + 0.5 * level) * math.sqrt(max(toward @ self.covariance @ toward, 0.0))
        return self.median * math.exp(-width), self.median * math.exp(width)


def fit_lognormal(stripes: np.ndarray, counts: np.ndarray, total: np.ndarray) -> Lognormal:
    """Most likely lognormal distribution for `counts` of `total` motions at each stripe, all of shape (n,).

    Fisher's scoring on the intercept and the slope in the logarithm of the intensity. Where the likelihood
    has no maximum inside, because no stripe has both outcomes, the median lies between the stripes and the
    dispersion is a twelfth of their distance.
    """
    known = total > 0
    x, hits, n = np.log(stripes[known]), counts[known].astype(float), total[known].astype(float)
    nothing = Lognormal(math.nan, math.nan, np.full((2, 2), math.nan), True)
    if not len(x) or hits.sum() == 0.0 or np.all(hits == n):
        return nothing
    mixed = (hits > 0.0) & (hits < n)
    if not np.any(mixed):
        below, above = x[hits == 0.0], x[hits == n]
        if not len(below) or not len(above) or below.max() > above.min():
            return nothing
        gap = above.min() - below.max()
        return Lognormal(math.exp(0.5 * (below.max() + above.min())), gap / 12.0, np.zeros((2, 2)), True)
    return _scored(x, hits, n)


def _scored(x: np.ndarray, hits: np.ndarray, n: np.ndarray) -> Lognormal:
    """Maximum of the likelihood by Fisher's scoring with halved steps."""
    middle = np.average(x, weights=n)
    basis = np.stack([np.ones_like(x), x - middle])
    beta = np.array([_NORMAL.inv_cdf(float(np.clip(hits.sum() / n.sum(), 0.01, 0.99))), 1.0])
    information = np.eye(2)
    for _ in range(200):
        eta = beta @ basis
        p, density = np.clip(_cdf(eta), 1e-15, 1.0 - 1e-15), np.exp(-0.5 * eta**2) / math.sqrt(2.0 * math.pi)
        weight = n * density**2 / (p * (1.0 - p))
        information = (basis * weight) @ basis.T
        gradient = basis @ (density * (hits - n * p) / (p * (1.0 - p)))
        try:
            step = np.linalg.solve(information, gradient)
        except np.linalg.LinAlgError:
            break
        base = _likelihood(beta @ basis, hits, n)
        while _likelihood((beta + step) @ basis, hits, n) < base - 1e-12 and np.max(np.abs(step)) > 1e-12:
            step = 0.5 * step
        beta = beta + step
        if np.max(np.abs(step)) < 1e-10 or not _FLATTEST <= beta[1] <= _STEEPEST:
            break
    if not beta[1] >= _FLATTEST:
        # The share does not grow with the intensity: no lognormal distribution describes it.
        return Lognormal(math.nan, math.nan, np.full((2, 2), math.nan), False)
    shift = np.array([[1.0, -middle], [0.0, 1.0]])
    covariance = shift @ np.linalg.pinv(information) @ shift.T
    return Lognormal(math.exp(middle - beta[0] / beta[1]), 1.0 / beta[1], covariance, False)


def _likelihood(eta: np.ndarray, hits: np.ndarray, n: np.ndarray) -> float:
    p = np.clip(_cdf(eta), 1e-300, 1.0)
    q = np.clip(_cdf(-eta), 1e-300, 1.0)
    return float(np.sum(hits * np.log(p) + (n - hits) * np.log(q)))


def _cdf(x: np.ndarray) -> np.ndarray:
    """Normal distribution function."""
    return 0.5 * np.vectorize(math.erfc, otypes=[float])(-np.asarray(x, dtype=float) / math.sqrt(2.0))
