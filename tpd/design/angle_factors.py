"""Factors by which the angles of runs exceed those of the settled orbit, for the limits of a search.

An orbit is the settled motion. A limit must also be kept by runs, with their transients and with motions that
are not symmetric. A descent therefore multiplies the angles of the orbit by a factor for each limit. The
factor is a power law of the design,

    log factor = a + b . log(mu, lam, zeta),

and follows from cheap runs of many designs by Bayesian linear regression. Accurate runs of the candidates
correct it in their neighbourhood. The angles are corrected, and not the limited
quantities, because a distance from a wall consists of the angle and of the size of the bob, and runs change
only the angle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

_LARGEST = 3.0
"""Largest logarithm of a factor. The smallest one is zero, because the orbit itself must keep every limit."""

_REACH = 1.0
"""Distance in the logarithms of a design over which an accurate value corrects the power law."""
_NOISE = 0.01
"""Variance of accurate values over that of their differences from the power law."""
_LEAST = 1e-3
"""Parameter of a design below which it has no effect on a factor. A damping ratio can be zero."""


@dataclass(frozen=True)
class PowerLaw:
    """Power law of a factor with its uncertainty, and accurate values that correct it near their designs."""

    mean: np.ndarray
    """a and b, (4,)."""
    covariance: np.ndarray
    """Covariance of a and b, (4, 4)."""
    places: np.ndarray = field(default_factory=lambda: np.empty((0, 4)))
    """Row of one and of the logarithms of each design that has an accurate value, (k, 4)."""
    offsets: np.ndarray = field(default_factory=lambda: np.empty(0))
    """Differences of the accurate logarithms from the power law, (k,)."""

    def with_values(self, designs: np.ndarray, logarithms: np.ndarray, noise: float) -> PowerLaw:
        """Return the law after logarithms of the factor (m,) at designs (m, 3), with a noise."""
        # In this form a law without any value needs no special case, nor does one with fewer values than
        # parameters.
        rows = _rows(designs)
        gain = self.covariance @ rows.T
        gain = gain @ np.linalg.inv(rows @ gain + noise**2 * np.eye(len(rows)))
        mean = self.mean + gain @ (logarithms - rows @ self.mean)
        return PowerLaw(mean, self.covariance - gain @ rows @ self.covariance)

    def corrected(self, design: np.ndarray, logarithm: float) -> PowerLaw:
        """Return the law with an accurate value at a design (3,), which replaces an earlier one at the same
        design. Far from the design the law is unchanged."""
        # A value at a design that was corrected before is newer, for example after a rejection.
        row = _rows(design[None])
        others = np.any(self.places != row, axis=1)
        offsets = np.append(self.offsets[others], logarithm - row @ self.mean)
        return replace(self, places=np.concatenate([self.places[others], row]), offsets=offsets)

    def at(self, designs: np.ndarray) -> np.ndarray:
        """Return the logarithms of the factor at designs (m, 3), shape (m,)."""
        rows = _rows(designs)
        near, weights, _ = self._near(rows)
        return np.clip(rows @ self.mean + near @ weights, 0.0, _LARGEST)

    def slopes(self, designs: np.ndarray) -> np.ndarray:
        """Return the derivatives of these logarithms with respect to the designs, (m, 3)."""
        # At a bound of the factor, and without damping, the factor is constant.
        logarithms = self.at(designs)
        is_inside = (logarithms > 0.0) & (logarithms < _LARGEST)
        moves = (designs > _LEAST) & is_inside[:, None]
        near, weights, apart = self._near(_rows(designs))
        local = -np.einsum("mk,k,mkj->mj", near, weights, apart)[:, 1:] / _REACH**2
        return np.where(moves, self.mean[1:] + local, 0.0) / np.maximum(designs, _LEAST)

    def _near(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return how near rows (m, 4) are to the accurate values, (m, k), from 0 to 1; the weights of the
        values, (k,); and the differences, (m, k, 4)."""
        # The first column is one everywhere, so that it adds nothing to the distance.
        apart = rows[:, None] - self.places
        between = _nearness(self.places[:, None] - self.places) + _NOISE * np.eye(len(self.places))
        return _nearness(apart), np.linalg.solve(between, self.offsets), apart


def _nearness(apart: np.ndarray) -> np.ndarray:
    return np.exp(-0.5 * np.sum(apart**2, axis=-1) / _REACH**2)


def _rows(designs: np.ndarray) -> np.ndarray:
    return np.column_stack([np.ones(len(designs)), np.log(np.maximum(designs, _LEAST))])


@dataclass(frozen=True)
class AngleFactors:
    """Factors on the angles of an orbit, by the name of the limit. The factor of any other limit is one."""

    laws: Mapping[str, PowerLaw] = field(default_factory=dict)
    sizes: Mapping[str, float] = field(default_factory=dict)
    """Factors on limited quantities that angles do not change, such as the length of a rod that is not built
    exactly."""

    def of(self, names: Sequence[str], designs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the factors of k limits at designs (m, 3), shape (m, k), and their derivatives with respect
        to the design, (m, k, 3)."""
        value, slope = np.ones((len(designs), len(names))), np.zeros((len(designs), len(names), 3))
        for i, name in enumerate(names):
            # A limit on the orbit itself, such as its reserve, has no law.
            if (law := self.laws.get(name)) is not None:
                value[:, i] = np.exp(law.at(designs))
                slope[:, i] = value[:, i, None] * law.slopes(designs)
        return value, slope
