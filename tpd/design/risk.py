"""Risk measure of a search: how the tilts under all conditions become one number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpd.core import checks


@dataclass(frozen=True, kw_only=True)
class Risk:
    """Risk measure: the mean over the worst `share` of the conditions.

    Under harmonic excitation only the descents minimise it, for their objective under each condition, by
    default what remains of a disturbance (`limits.Settling`). Under ground motions there are no descents, and
    the trial runs compare designs by the measure over all runs. Trial runs apply it to the tilt, or, if
    overturning must fall, to the sum of a quarter of the tilt and three quarters of the outcome (1 if the
    block overturns).

    Use `Risk.worst()`, `Risk.expected()` or `Risk.cvar(share)`. The field `share` is between 0 (only the
    worst condition) and 1 (all conditions); `name` is the name in reports.

    Raises:
        ValueError: the share is not between 0 and 1.

    Example:
        >>> import numpy as np
        >>> import tpd
        >>> tilts = np.array([0.1, 0.2, 0.6])
        >>> [round(float(risk.of(tilts)), 4) for risk in (tpd.Risk.worst(), tpd.Risk.expected())]
        [0.6, 0.3]
    """

    share: checks.Real
    """Share of the conditions that count, the worst ones."""
    name: str
    """Name in reports."""

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.within, "share", 0.0, 1.0)
        checks.instance("name", self.name, str)

    @staticmethod
    def worst() -> Risk:
        """Return the measure that is the largest value over all conditions."""
        return Risk(share=0.0, name="worst")

    @staticmethod
    def expected() -> Risk:
        """Return the measure that is the mean over all conditions."""
        return Risk(share=1.0, name="expected")

    @staticmethod
    def cvar(share: checks.Real = 0.5) -> Risk:
        """Return the conditional value at risk: the mean tilt over the worst `share` of the conditions.

        Raises:
            ValueError: the share is not above 0 and at most 1.
        """
        share = checks.within("share", share, 1e-9, 1.0)
        return Risk(share=share, name=f"mean of the worst {share:.3g}")

    def cap(self, n: int) -> float:
        """Return the largest weight that one of n conditions can have."""
        # A share below one condition selects the worst condition.
        return min(1.0, 1.0 / max(self.share * n, 1.0))

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the measure over the last axis: the largest weighted mean with no weight above the cap."""
        n = values.shape[-1]
        # Sort the conditions, worst first, and give each the cap as its weight until the weights sum to one.
        # The result is the mean over the worst share.
        cap = self.cap(n)
        ordered = -np.sort(-values, axis=-1)
        weights = np.clip(1.0 - cap * np.arange(n), 0.0, cap)
        # A value of a condition without weight may be infinite: replace it by zero, because 0 times infinity
        # is NaN. `asarray` is needed because the sum over a single design is a NumPy scalar.
        return np.asarray(np.sum(np.where(weights > 0.0, ordered, 0.0) * weights, axis=-1))
