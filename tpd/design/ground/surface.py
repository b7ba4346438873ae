"""Response surface through noisy values and derivatives: a Gaussian process.

A mean over ground motions is a smooth trend with a fine structure on top, because a block that rocks for long
forgets where it came from. The surface estimates the trend: its noise takes the fine structure, and each
derivative counts as much as its own standard error allows (C. E. Rasmussen and C. K. I. Williams, Gaussian
Processes for Machine Learning, 2006, chapters 2, 5 and 9.4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

_LENGTHS = (0.15, 3.0)
"""Bounds of the length scales, in shares of the design space."""
_NOISE = (1e-4, 0.7)
"""Bounds of the noise's standard deviation, over that of the values."""
_ROUGHNESS = (1e-3, 30.0)
"""Bounds of the standard deviation of the fine structure's derivatives, over that of the values."""
_AMPLITUDE = (0.5, 30.0)
"""Bounds of the standard deviation of the trend, over that of the values."""
_CONSTANT = 10.0
"""Variance of the unknown mean, over that of the trend."""
_JITTER = 1e-10
_STEPS = 150
"""Steps of the search for the numbers of the process."""


class Observations(NamedTuple):
    """Values at designs in shares of the space, and derivatives along these shares."""

    at: Float[np.ndarray, "n d"]
    value: Float[np.ndarray, " n"]
    slope: Float[np.ndarray, "n d"] | None = None
    """NaN where nothing is known."""
    slope_error: Float[np.ndarray, "n d"] | None = None
    """Standard errors."""


@dataclass(frozen=True)
class Surface:
    """A fitted process."""

    seen: Observations
    numbers: np.ndarray
    """Logarithms of the length scales (d,), the amplitude, and the noise of values and of derivatives."""
    middle: float
    spread: float
    """Mean and standard deviation of the values."""
    which: np.ndarray
    """Derivatives that are used, as indices into the flattened array."""
    factor: np.ndarray
    """Cholesky factor of the covariance."""
    weights: np.ndarray
    loss: float
    """Minus the logarithm of the likelihood."""

    def at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Trend and its standard deviation at places (m, d)."""
        lengths, size = np.exp(self.numbers[:-3]), float(np.exp(2.0 * self.numbers[-3]))
        cross = _covariance(np.asarray(x), self.seen.at, lengths)
        k = size * np.concatenate([cross.value, cross.by_slope.reshape(len(x), -1)[:, self.which]], axis=1)
        mean = k @ self.weights
        solved = np.linalg.solve(self.factor, k.T)
        variance = np.maximum(size * (1.0 + _CONSTANT) - np.sum(solved**2, axis=0), 0.0)
        return self.middle + self.spread * mean, self.spread * np.sqrt(variance)

    @property
    def noise(self) -> float:
        """Standard deviation of the values about the trend."""
        return float(self.spread * np.exp(self.numbers[-2]))


class _Blocks(NamedTuple):
    value: np.ndarray
    by_slope: np.ndarray
    """Covariance of a value at the first place and derivatives at the second, (n, m, d)."""
    both: np.ndarray | None = None
    """Covariance of derivatives at both, (n, d, m, d)."""


def _covariance(a: np.ndarray, b: np.ndarray, lengths: np.ndarray, both: bool = False) -> _Blocks:
    """Squared exponential covariances of values and derivatives at places (n, d) and (m, d)."""
    x = (a[:, None] - b[None]) / lengths
    k = np.exp(-0.5 * np.sum(x**2, axis=-1))
    # Derivatives of a Gaussian process are Gaussian: their covariances are those of the covariance.
    by_slope = k[..., None] * x / lengths
    if not both:
        return _Blocks(k + _CONSTANT, by_slope)
    d = a.shape[1]
    inner = (np.eye(d) - x[..., :, None] * x[..., None, :]) / (lengths[:, None] * lengths[None])
    return _Blocks(k + _CONSTANT, by_slope, (k[..., None, None] * inner).transpose(0, 2, 1, 3))


def fit(seen: Observations, seed: int = 0, before: Surface | None = None, steps: int = _STEPS) -> Surface:
    """The most likely process for observations.

    A seeded search for its few numbers, from those of the process `before` if there is one.
    """
    d = seen.at.shape[1]
    middle, spread = float(np.mean(seen.value)), float(np.std(seen.value)) or 1.0
    which = _used(seen, spread)
    bounds = *[_LENGTHS] * d, _AMPLITUDE, _NOISE, _ROUGHNESS
    low, high = np.log(bounds).T
    start = np.log([*[0.7] * d, 2.0, 0.1, 0.3]) if before is None else before.numbers
    best = _at(seen, start, middle, spread, which)
    # Five numbers and a likelihood of half a millisecond: no gradient is needed.
    rng, width = np.random.default_rng([seed, len(seen.value)]), 0.8
    for _ in range(steps if len(seen.value) > 3 else 0):
        tried = np.clip(best.numbers + width * rng.standard_normal(d + 3), low, high)
        other = _at(seen, tried, middle, spread, which)
        # One fifth of the steps should succeed (I. Rechenberg, Evolutionsstrategie, 1973).
        better = other.loss < best.loss
        best, width = (other if better else best), width * (1.5 if better else 0.9)
    return best


def _used(seen: Observations, spread: float) -> np.ndarray:
    """Indices of the derivatives that say more than nothing."""
    if seen.slope is None or seen.slope_error is None:
        return np.zeros(0, int)
    # Over the whole space a trend moves by a few times the spread of its values.
    useful = np.isfinite(seen.slope) & (seen.slope_error < 10.0 * spread)
    return np.flatnonzero(useful)


def _at(seen: Observations, numbers: np.ndarray, middle: float, spread: float, which: np.ndarray) -> Surface:
    """Process of given numbers."""
    n, d = seen.at.shape
    lengths, (size, noise, rough) = np.exp(numbers[:-3]), np.exp(numbers[-3:])
    blocks = _covariance(seen.at, seen.at, lengths, both=len(which) > 0)
    k = np.empty((n + len(which), n + len(which)))
    k[:n, :n] = blocks.value
    y, variance = [(seen.value - middle) / spread], [np.full(n, noise**2 + _JITTER)]
    if blocks.both is not None and seen.slope is not None and seen.slope_error is not None:
        k[:n, n:] = blocks.by_slope.reshape(n, n * d)[:, which]
        k[n:, :n] = k[:n, n:].T
        k[n:, n:] = blocks.both.reshape(n * d, n * d)[np.ix_(which, which)]
        y.append(seen.slope.ravel()[which] / spread)
        # The fine structure has derivatives of its own, which say nothing of the trend.
        variance.append((seen.slope_error.ravel()[which] / spread) ** 2 + rough**2)
    k *= size**2
    # Noise makes the matrix safe to factor as well.
    k[np.diag_indices_from(k)] += np.concatenate(variance)
    target = np.concatenate(y)
    # Numbers for which the matrix is singular to rounding are as unlikely as can be.
    try:
        factor = np.linalg.cholesky(k)
    except np.linalg.LinAlgError:
        return Surface(seen, numbers, middle, spread, which, np.eye(len(k)), np.zeros(len(k)), np.inf)
    half = np.linalg.solve(factor, target)
    weights = np.linalg.solve(factor.T, half)
    # Length scales near one are the most likely beforehand: the trend is smooth over the space.
    prior = 0.5 * np.sum((numbers[:-3] / 1.5) ** 2)
    loss = 0.5 * float(half @ half) + float(np.sum(np.log(np.diag(factor)))) + prior
    return Surface(seen, numbers, middle, spread, which, factor, weights, loss)
