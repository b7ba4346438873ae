"""Gaussian process through noisy values at designs: their trend, and the design for the next trial.

The mean over runs is a smooth trend with a fine structure, because a block that rocks for a long time forgets
its initial state. The process estimates the trend. Its noise represents the fine structure and the sampling
error of the runs (C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, 2006,
chapters 2 and 5). The next design is the one with the largest expected improvement of the trend (D. R. Jones,
M. Schonlau and W. J. Welch, J. Global Optim. 13, 1998).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import ndtr

_LENGTHS = (0.15, 3.0)
"""Bounds of the length scales, in shares of the design space."""
_NOISE = (1e-4, 0.7)
"""Bounds of the standard deviation of the noise, over the standard deviation of the values."""
_AMPLITUDE = (0.5, 30.0)
"""Bounds of the standard deviation of the trend, over the standard deviation of the values."""
_CONSTANT = 10.0
"""Variance of the unknown mean, over the variance of the trend."""
_JITTER = 1e-10
_ANYWHERE, _NEAR = 1500, 500
"""Numbers of proposed designs: anywhere in the space, and near the best designs."""
_WIDTHS = (0.03, 0.5)
"""Smallest and largest width of the region near the best designs, in shares of the space."""


class Observations(NamedTuple):
    """Values that were observed at designs in shares of the space."""

    at: Float[np.ndarray, "n d"]
    """Designs, (n, d)."""
    value: Float[np.ndarray, " n"]
    """Observed values, (n,)."""


@dataclass(frozen=True)
class GaussianProcess:
    """Gaussian process that is fitted to observations."""

    seen: Observations
    """Observations of the fit."""
    numbers: np.ndarray
    """Logarithms of the hyperparameters: length scales (d,), amplitude and noise."""
    middle: float
    """Mean of the values."""
    spread: float
    """Standard deviation of the values."""
    factor: np.ndarray
    """Cholesky factor of the covariance of the observations."""
    weights: np.ndarray
    """Inverse covariance times the normalised values."""
    loss: float
    """Negative logarithm of the posterior density of the hyperparameters."""

    def at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the trend and its standard deviation at points (m, d)."""
        size = float(np.exp(2.0 * self.numbers[-2]))
        k = size * _covariance(np.asarray(x), self.seen.at, np.exp(self.numbers[:-2]))
        # The variance of the trend is the prior variance minus the part that the observations explain.
        solved = np.linalg.solve(self.factor, k.T)
        variance = np.maximum(size * (1.0 + _CONSTANT) - np.sum(solved**2, axis=0), 0.0)
        return self.middle + self.spread * (k @ self.weights), self.spread * np.sqrt(variance)


def _covariance(a: np.ndarray, b: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return squared exponential covariances between points (n, d) and (m, d), plus that of an unknown
    mean."""
    return np.exp(-0.5 * np.sum(((a[:, None] - b[None]) / lengths) ** 2, axis=-1)) + _CONSTANT


def fit(
    seen: Observations, seed: int = 0, before: GaussianProcess | None = None, steps: int = 150
) -> GaussianProcess:
    """Return the most likely process for observations.

    Args:
        seen: designs and values.
        seed: seed of the search for the hyperparameters.
        before: process of fewer observations, whose hyperparameters are the starting point.
        steps: number of steps of the search.
    """
    # Values are normalised by their mean and their spread; a constant sample has the spread 1.
    d = seen.at.shape[1]
    middle, spread = float(np.mean(seen.value)), float(np.std(seen.value)) or 1.0
    low, high = np.log([*[_LENGTHS] * d, _AMPLITUDE, _NOISE]).T
    start = np.log([*[0.7] * d, 2.0, 0.1]) if before is None else before.numbers
    best = _at(seen, start, middle, spread)
    # There are few hyperparameters, and the likelihood takes a millisecond: a random search needs no
    # gradient.
    rng, width = np.random.default_rng([seed, len(seen.value)]), 0.8
    for _ in range(steps if len(seen.value) > 3 else 0):
        trial = np.clip(best.numbers + width * rng.standard_normal(d + 2), low, high)
        other = _at(seen, trial, middle, spread)
        # The width is adapted so that one fifth of the steps succeed (I. Rechenberg, Evolutionsstrategie,
        # 1973).
        better = other.loss < best.loss
        best, width = (other if better else best), width * (1.5 if better else 0.9)
    return best


def _at(seen: Observations, numbers: np.ndarray, middle: float, spread: float) -> GaussianProcess:
    """Return the process with certain hyperparameters."""
    lengths, (size, noise) = np.exp(numbers[:-2]), np.exp(numbers[-2:])
    k = size**2 * _covariance(seen.at, seen.at, lengths)
    # The noise on the diagonal also makes the factorisation stable.
    k[np.diag_indices_from(k)] += noise**2 + _JITTER
    # Hyperparameters with a numerically singular matrix get an infinite loss, and are never chosen.
    try:
        factor = np.linalg.cholesky(k)
    except np.linalg.LinAlgError:
        return GaussianProcess(seen, numbers, middle, spread, np.eye(len(k)), np.zeros(len(k)), np.inf)
    half = np.linalg.solve(factor, (seen.value - middle) / spread)
    weights = np.linalg.solve(factor.T, half)
    # The prior prefers length scales near one, because the trend is expected to be smooth over the space.
    prior = 0.5 * np.sum((numbers[:-2] / 1.5) ** 2)
    loss = 0.5 * float(half @ half) + float(np.sum(np.log(np.diag(factor)))) + prior
    return GaussianProcess(seen, numbers, middle, spread, factor, weights, loss)


def proposals(rng: np.random.Generator, best: np.ndarray) -> np.ndarray:
    """Draw designs that are compared by their trend, in shares of the space (m, d).

    Some are anywhere in the space, and others are near the best designs (n, d).
    """
    d = best.shape[1]
    near = best[rng.integers(0, len(best), _NEAR)]
    # Use widths of all sizes, because the distance between the best designs is not known in advance.
    low, high = np.log(_WIDTHS)
    width = np.exp(rng.uniform(low, high, (_NEAR, 1)))
    near = np.clip(near + width * rng.standard_normal((_NEAR, d)), 0.0, 1.0)
    return np.concatenate([rng.random((_ANYWHERE, d)), near])


def probability_below_zero(limits: Sequence[GaussianProcess], x: np.ndarray) -> np.ndarray:
    """Return the probability that all limited quantities are below zero at points (m, d), according to their
    trends."""
    trends = (limit.at(x) for limit in limits)
    below = (ndtr(-middle / np.maximum(deviation, 1e-9)) for middle, deviation in trends)
    return np.prod([np.ones(len(x)), *below], axis=0)


def improvement(process: GaussianProcess, x: np.ndarray, best: float) -> np.ndarray:
    """Return the expected improvement of the trend at points (m, d) over the value `best`."""
    mean, deviation = process.at(x)
    # Closed form of the expectation of max(best - trend, 0) for a normal distribution.
    gain, s = best - mean, np.maximum(deviation, 1e-12)
    z = gain / s
    return gain * ndtr(z) + s * np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi)
