"""Trend of a noisy quantity over designs, by a thin-plate spline that smooths the values at all designs.

The mean over runs is a smooth function of the design with a fine structure, because a block that rocks for a
long time forgets its initial state. In the logarithms of the design the smooth part is close to a plane, and
a spline with a plane as its limit predicts it within the noise of one trial (G. Wahba, Spline Models for
Observational Data, 1990, chapters 2 and 4). SciPy computes the spline. The smoothing is the one that predicts
each value best from all other values.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

_SMOOTHINGS = 1e-3, 0.03, 1.0
"""Weights of the curvature of the spline that are tried."""


@dataclass(frozen=True)
class Trend:
    """Smoothing spline through values at designs."""

    smoother: Any
    """`RBFInterpolator` of SciPy through the unit vectors: at each point the weights of all values."""
    values: Float[np.ndarray, " n"]
    """Values at the designs, (n,)."""
    noise: float
    """Standard deviation of a value about the trend."""

    def at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the trend and its standard deviation at points (m, d)."""
        weights = self.smoother(np.asarray(x))
        return weights @ self.values, self.noise * np.linalg.norm(weights, axis=1)


def least_values(dimensions: int) -> int:
    """Return the smallest number of values that determine a trend."""
    return dimensions + 2


def fit(at: Float[np.ndarray, "n d"], values: Float[np.ndarray, " n"]) -> Trend:
    """Return the trend of values at designs, given by the logarithms of their parameters.

    Raises:
        ValueError: there are fewer values than `least_values`.
    """
    # The import takes a third of a second, and only searches under ground motions need it.
    from scipy.interpolate import RBFInterpolator

    best, least = None, np.inf
    for smoothing in _SMOOTHINGS:
        smoother = RBFInterpolator(at, np.eye(len(values)), smoothing=smoothing, degree=1)
        weights = smoother(at)
        residual = values - weights @ values
        free = np.maximum(1.0 - np.diag(weights), 1e-9)
        # The error of a prediction without the value itself has a closed form.
        error = float(np.sum((residual / free) ** 2))
        if best is None or error < least:
            least = error
            best = Trend(smoother, values, float(np.sqrt(residual @ residual / np.sum(free))))
    assert best is not None
    return best
