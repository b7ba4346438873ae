"""Power law of a factor over designs, by Bayesian linear regression.

An orbit is the settled motion. A limit must also be kept by runs, with their transients and with motions that
are not symmetric. A descent therefore multiplies the limited quantity of the orbit by a factor,

    log factor = a + b . log(mu, lam, zeta),

which follows from runs of a few designs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_LARGEST = 3.0
"""Largest logarithm of a factor. The smallest one is zero, because the orbit itself must keep every limit."""
_LEAST = 1e-3
"""Parameter of a design below which it has no effect on a factor. A damping ratio can be zero."""


@dataclass(frozen=True)
class PowerLaw:
    """Power law of a factor with its uncertainty."""

    mean: np.ndarray
    """a and b, (4,)."""
    covariance: np.ndarray
    """Covariance of a and b, (4, 4)."""

    def with_values(self, designs: np.ndarray, logarithms: np.ndarray, noise: np.ndarray) -> PowerLaw:
        """Return the law after logarithms of the factor (m,) at designs (m, 3), with the standard deviation
        of each value, (m,)."""
        # In this form a law without any value needs no special case, nor does one with fewer values than
        # parameters.
        rows = _rows(designs)
        gain = self.covariance @ rows.T
        gain = gain @ np.linalg.inv(rows @ gain + np.diag(noise**2))
        mean = self.mean + gain @ (logarithms - rows @ self.mean)
        return PowerLaw(mean, self.covariance - gain @ rows @ self.covariance)

    def at(self, designs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the factors at designs (m, 3), shape (m,), and their derivatives with respect to the
        designs, (m, 3)."""
        logarithm = _rows(designs) @ self.mean
        # At a bound of the factor, and without damping, the factor is constant.
        moves = (designs > _LEAST) & ((logarithm > 0.0) & (logarithm < _LARGEST))[:, None]
        factor = np.exp(np.clip(logarithm, 0.0, _LARGEST))
        return factor, factor[:, None] * np.where(moves, self.mean[1:], 0.0) / np.maximum(designs, _LEAST)


def _rows(designs: np.ndarray) -> np.ndarray:
    return np.column_stack([np.ones(len(designs)), np.log(np.maximum(designs, _LEAST))])
