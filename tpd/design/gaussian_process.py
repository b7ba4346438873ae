"""Gaussian process through noisy values at designs: their trend, and which design is worth a trial next.

A mean over runs is a smooth trend with a fine structure on top, because a block that rocks for long forgets
its initial state. The process estimates the trend, and its noise absorbs the fine structure and the sampling
error of the runs (C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, 2006,
chapters 2 and 5). The next design is that of the largest expected improvement of the trend (D. R. Jones,
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
"""Bounds of the noise's standard deviation, over that of the values."""
_AMPLITUDE = (0.5, 30.0)
"""Bounds of the standard deviation of the trend, over that of the values."""
_CONSTANT = 10.0
"""Variance of the unknown mean, over that of the trend."""
_JITTER = 1e-10
_ANYWHERE, _NEAR = 1500, 500
"""Designs that are compared by their trend: anywhere in the space, and near the best ones."""
_WIDTHS = (0.03, 0.5)
"""Widths of those near the best, in shares of the space."""


class Observations(NamedTuple):
    """Values at designs in shares of the space."""

    at: Float[np.ndarray, "n d"]
    value: Float[np.ndarray, " n"]


@dataclass(frozen=True)
class GaussianProcess:
    """A fitted process."""

    seen: Observations
    numbers: np.ndarray
    """Logarithms of the length scales (d,), the amplitude, and the noise."""
    middle: float
    spread: float
    """Mean and standard deviation of the values."""
    factor: np.ndarray
    """Cholesky factor of the covariance."""
    weights: np.ndarray
    loss: float
    """Minus the logarithm of the likelihood."""

    def at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Trend and its standard deviation at places (m, d)."""
        size = float(np.exp(2.0 * self.numbers[-2]))
        k = size * _covariance(np.asarray(x), self.seen.at, np.exp(self.numbers[:-2]))
        solved = np.linalg.solve(self.factor, k.T)
        variance = np.maximum(size * (1.0 + _CONSTANT) - np.sum(solved**2, axis=0), 0.0)
        return self.middle + self.spread * (k @ self.weights), self.spread * np.sqrt(variance)


def _covariance(a: np.ndarray, b: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return squared exponential covariances of values at places (n, d) and (m, d), with that of an unknown
    mean."""
    return np.exp(-0.5 * np.sum(((a[:, None] - b[None]) / lengths) ** 2, axis=-1)) + _CONSTANT


def fit(
    seen: Observations, seed: int = 0, before: GaussianProcess | None = None, steps: int = 150
) -> GaussianProcess:
    """Return the most likely process for observations.

    Args:
        seen: designs and values.
        seed: of the search for the few hyperparameters.
        before: process of fewer observations, at whose hyperparameters the search begins.
        steps: of the search.
    """
    d = seen.at.shape[1]
    middle, spread = float(np.mean(seen.value)), float(np.std(seen.value)) or 1.0
    low, high = np.log([*[_LENGTHS] * d, _AMPLITUDE, _NOISE]).T
    start = np.log([*[0.7] * d, 2.0, 0.1]) if before is None else before.numbers
    best = _at(seen, start, middle, spread)
    # Few hyperparameters and a likelihood that takes a millisecond: no gradient is needed.
    rng, width = np.random.default_rng([seed, len(seen.value)]), 0.8
    for _ in range(steps if len(seen.value) > 3 else 0):
        trial = np.clip(best.numbers + width * rng.standard_normal(d + 2), low, high)
        other = _at(seen, trial, middle, spread)
        # One fifth of the steps should succeed (I. Rechenberg, Evolutionsstrategie, 1973).
        better = other.loss < best.loss
        best, width = (other if better else best), width * (1.5 if better else 0.9)
    return best


def _at(seen: Observations, numbers: np.ndarray, middle: float, spread: float) -> GaussianProcess:
    """Return the process of given hyperparameters."""
    lengths, (size, noise) = np.exp(numbers[:-2]), np.exp(numbers[-2:])
    k = size**2 * _covariance(seen.at, seen.at, lengths)
    # Noise makes the matrix safe to factor as well.
    k[np.diag_indices_from(k)] += noise**2 + _JITTER
    # Hyperparameters for which the matrix is singular to rounding are as unlikely as can be.
    try:
        factor = np.linalg.cholesky(k)
    except np.linalg.LinAlgError:
        return GaussianProcess(seen, numbers, middle, spread, np.eye(len(k)), np.zeros(len(k)), np.inf)
    half = np.linalg.solve(factor, (seen.value - middle) / spread)
    weights = np.linalg.solve(factor.T, half)
    # Length scales near one are the most likely beforehand: the trend is smooth over the space.
    prior = 0.5 * np.sum((numbers[:-2] / 1.5) ** 2)
    loss = 0.5 * float(half @ half) + float(np.sum(np.log(np.diag(factor)))) + prior
    return GaussianProcess(seen, numbers, middle, spread, factor, weights, loss)


def proposals(rng: np.random.Generator, best: np.ndarray) -> np.ndarray:
    """Draw designs to be compared by their trend, in shares of the space (m, d): some anywhere, and more
    closely where the best ones (n, d) lie."""
    d = best.shape[1]
    near = best[rng.integers(0, len(best), _NEAR)]
    # Of all widths, since it is not known beforehand how far the best designs lie apart.
    low, high = np.log(_WIDTHS)
    width = np.exp(rng.uniform(low, high, (_NEAR, 1)))
    near = np.clip(near + width * rng.standard_normal((_NEAR, d)), 0.0, 1.0)
    return np.concatenate([rng.random((_ANYWHERE, d)), near])


def probability_below_zero(limits: Sequence[GaussianProcess], x: np.ndarray) -> np.ndarray:
    """Return the probability that all limited quantities are below zero at places (m, d), by their trends."""
    out = np.ones(len(x))
    for limit in limits:
        middle, deviation = limit.at(x)
        out *= ndtr(-middle / np.maximum(deviation, 1e-9))
    return out


def improvement(process: GaussianProcess, x: np.ndarray, best: float) -> np.ndarray:
    """Return the expected improvement of the trend at places (m, d) on a value of it."""
    mean, deviation = process.at(x)
    gain, s = best - mean, np.maximum(deviation, 1e-12)
    z = gain / s
    return gain * ndtr(z) + s * np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi)
