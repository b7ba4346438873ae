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
    """0 where every motion reaches the state at every stripe, infinite where none does, NaN where the share
    does not grow with the intensity."""
    dispersion: float
    covariance: np.ndarray
    """Covariance of the probit's intercept and slope in ln x, shape (2, 2), by the sandwich over motions: one
    motion at several stripes counts as one."""
    separated: bool
    """Whether no stripe has both outcomes, so that the dispersion is anything below what the stripes see."""

    def __str__(self) -> str:
        if not 0.0 < self.median < math.inf:
            where = {0.0: "below the stripes", math.inf: "above the stripes"}
            return f"median {where.get(self.median, 'unknown: the share does not grow with the intensity')}"
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


def fit_lognormal(stripes: np.ndarray, hits: np.ndarray) -> Lognormal:
    """Most likely lognormal distribution for the outcomes of motions at stripes.

    Args:
        stripes: intensities, shape (stripes,).
        hits: 1 where a motion reaches the state, 0 where not, NaN where nothing is known; shape (motions,
            stripes).

    Fisher's scoring on the intercept and the slope in the logarithm of the intensity. Where the likelihood
    has no maximum inside, because no stripe has both outcomes, the median lies between the stripes and the
    dispersion is a twelfth of their distance.
    """
    known = np.isfinite(hits)
    n, counts = known.sum(axis=0), np.where(known, hits, 0.0).sum(axis=0)
    if not n.sum() or counts.sum() == 0.0:
        return _unbounded(math.inf)
    if counts.sum() == n.sum():
        return _unbounded(0.0)
    x, counts, n = np.log(stripes[n > 0]), counts[n > 0], n[n > 0].astype(float)
    if not np.any((counts > 0.0) & (counts < n)):
        return _separated(x, counts > 0.0)
    beta, middle = _scored(x, counts, n)
    if not beta[1] >= _FLATTEST:
        return _unbounded(math.nan)
    covariance = _sandwich(np.log(stripes) - middle, hits, beta)
    shift = np.array([[1.0, -middle], [0.0, 1.0]])
    return Lognormal(math.exp(middle - beta[0] / beta[1]), 1.0 / beta[1], shift @ covariance @ shift.T, False)


def _unbounded(median: float) -> Lognormal:
    """Distribution of which the stripes see nothing but on which side of them it lies."""
    return Lognormal(median, math.nan, np.full((2, 2), math.nan), True)


def _separated(x: np.ndarray, reached: np.ndarray) -> Lognormal:
    """Distribution where every stripe has one outcome."""
    # The maximum is at a dispersion of zero, for any median between both stripes.
    below, above = x[~reached].max(), x[reached].min()
    if below > above:
        return _unbounded(math.nan)
    return Lognormal(math.exp(0.5 * (below + above)), (above - below) / 12.0, np.zeros((2, 2)), True)


def _weights(eta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Probability, and the slope of its logarithm's odds: density over p (1 - p)."""
    p = np.clip(_cdf(eta), 1e-15, 1.0 - 1e-15)
    return p, np.exp(-0.5 * eta**2) / math.sqrt(2.0 * math.pi) / (p * (1.0 - p))


def _scored(x: np.ndarray, counts: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, float]:
    """Maximum of the likelihood by Fisher's scoring with halved steps; x counts from the middle returned."""
    middle = float(np.average(x, weights=n))
    basis = np.stack([np.ones_like(x), x - middle])
    beta = np.array([_NORMAL.inv_cdf(float(np.clip(counts.sum() / n.sum(), 0.01, 0.99))), 1.0])
    for _ in range(200):
        p, ratio = _weights(beta @ basis)
        information = (basis * n * ratio**2 * p * (1.0 - p)) @ basis.T
        step = np.linalg.pinv(information) @ (basis @ (ratio * (counts - n * p)))
        # Far from the maximum a whole step may lead away from it.
        base = _likelihood(beta @ basis, counts, n)
        while _likelihood((beta + step) @ basis, counts, n) < base - 1e-12 and np.max(np.abs(step)) > 1e-12:
            step = 0.5 * step
        beta = beta + step
        if np.max(np.abs(step)) < 1e-10 or not _FLATTEST <= beta[1] <= _STEEPEST:
            break
    return beta, middle


def _sandwich(x: np.ndarray, hits: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """Covariance of the coefficients, in which the scores of one motion at all stripes belong together."""
    known = np.isfinite(hits)
    basis = np.stack([np.ones_like(x), x])
    p, ratio = _weights(beta @ basis)
    bread = np.linalg.pinv((basis * known.sum(axis=0) * ratio**2 * p * (1.0 - p)) @ basis.T)
    # One row a motion: its stripes are no independent observations.
    scores = np.where(known, ratio * (np.where(known, hits, 0.0) - p), 0.0) @ basis.T
    motions = len(hits)
    return motions / max(motions - 1, 1) * bread @ (scores.T @ scores) @ bread


def _likelihood(eta: np.ndarray, hits: np.ndarray, n: np.ndarray) -> float:
    p = np.clip(_cdf(eta), 1e-300, 1.0)
    q = np.clip(_cdf(-eta), 1e-300, 1.0)
    return float(np.sum(hits * np.log(p) + (n - hits) * np.log(q)))


def _cdf(x: np.ndarray) -> np.ndarray:
    """Normal distribution function."""
    return 0.5 * np.vectorize(math.erfc, otypes=[float])(-np.asarray(x, dtype=float) / math.sqrt(2.0))
