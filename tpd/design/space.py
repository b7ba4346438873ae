"""The design space: bounds of the mass ratio, the length ratio and the damping ratio of the pendulum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpd.core import checks
from tpd.core.scene import LARGEST_DAMPING

HEAVIEST_RATIO = 1.0
"""Largest mass ratio m/M: no bob within a block is heavier than the block."""
LONGEST_RATIO = 2.0
"""Largest length ratio l/b: a pendulum longer than the whole block would swing through the floor."""


@dataclass(frozen=True, kw_only=True)
class DesignSpace:
    """Bounds of the search.

    Raises:
        ValueError: a bound out of range, reversed or empty.
    """

    mass_ratio: tuple[float, float] = (0.01, 0.2)
    """Lower and upper bound of mu = m/M."""
    length_ratio: tuple[float, float] = (0.1, 1.5)
    """Lower and upper bound of lam = l/b."""
    damping_ratio: float | tuple[float, float] = 0.1
    """zeta of the hinge: one number, or a lower and an upper bound if it is searched as well."""

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "mass_ratio", checks.interval("mass_ratio", self.mass_ratio, 0.0, HEAVIEST_RATIO))
        set_(self, "length_ratio", checks.interval("length_ratio", self.length_ratio, 1e-3, LONGEST_RATIO))
        # One number is fixed, a pair is searched: the search has two or three coordinates.
        if np.ndim(self.damping_ratio) == 0:
            checks.within("damping_ratio", self.damping_ratio, 0.0, LARGEST_DAMPING)
            set_(self, "damping_ratio", float(self.damping_ratio))  # type: ignore[arg-type]
        else:
            set_(
                self,
                "damping_ratio",
                checks.interval("damping_ratio", self.damping_ratio, 0.0, LARGEST_DAMPING),
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Symbols of the searched parameters."""
        return ("mu", "lam", "zeta") if isinstance(self.damping_ratio, tuple) else ("mu", "lam")

    @property
    def bounds(self) -> np.ndarray:
        """Lower and upper bounds of the searched parameters, shape (2, len(names))."""
        pairs = [self.mass_ratio, self.length_ratio]
        if isinstance(self.damping_ratio, tuple):
            pairs.append(self.damping_ratio)
        return np.array(pairs).T

    def full(self, x: np.ndarray) -> np.ndarray:
        """(mu, lam, zeta) of searched values `x`, shape (..., 2 or 3) to (..., 3)."""
        if isinstance(self.damping_ratio, tuple):
            return np.asarray(x)
        return np.concatenate([x, np.full((*np.shape(x)[:-1], 1), self.damping_ratio)], axis=-1)

    def scaled(self, designs: np.ndarray) -> np.ndarray:
        """Searched values of designs (..., 3) as shares of the bounds, shape (..., len(names))."""
        # Searches work in shares: a kilogramme and a metre have no common length of step.
        low, high = self.bounds
        return (np.asarray(designs)[..., : low.size] - low) / (high - low)

    def unscaled(self, unit: np.ndarray) -> np.ndarray:
        """(mu, lam, zeta) of shares of the bounds, shape (..., len(names)) to (..., 3)."""
        low, high = self.bounds
        return self.full(low + np.asarray(unit) * (high - low))
