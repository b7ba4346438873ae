"""Intensity from which each motion overturns a block with a pendulum, and its derivatives in the design.

As `tpd.critical_scale`, for many designs and motions at once: the first crossing of a scan, bisected, and the
derivative by the implicit function theorem, since the growing coordinate of the last arc vanishes there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tpd.analysis.critical_scale import bisected
from tpd.design.ground.objective import GroundObjective

_AT_ONCE = 8
"""Factors that are tried at once: a scan ends with the first of them that overturns the block."""
_ROUNDS = 5
"""Steps of the bisection, each by a factor of 32."""


def crossings(
    objective: GroundObjective, designs: np.ndarray, scan: float, highest: float, *, slopes: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """First intensity of a scan that overturns the block, by the linear equations.

    Args:
        objective: conditions; their scales are not used, but the intensity that they count.
        designs: (mu, lam, zeta), shape (m, 3).
        scan: relative step of the scan.
        highest: its end, over the intensity that lifts the bare block.
        slopes: whether to compute derivatives.

    Returns:
        Intensities (m, n), infinite where no factor of the scan overturns the block; and their derivatives
        (m, n, 3), NaN where there is no crossing or where they were not asked for.
    """
    c, m = objective.conditions, len(designs)
    others = np.stack([v for k, v in sorted(c.factors.items()) if k != "amplitude"] or [np.zeros(len(c))])
    # Stripes of one motion on one block have the same crossing.
    _, first, back = np.unique(
        np.vstack([np.asarray(c.which)[None], others]), axis=1, return_index=True, return_inverse=True
    )
    rows, by_mass = objective.rows(designs)
    every = (np.arange(m)[:, None] * len(c) + first).ravel()
    x, which = rows[every], np.tile(np.asarray(c.which)[first], m)
    x[:, 5] /= np.tile(c.column("amplitude")[first], m)
    follow = _Follow(objective, x, which)
    found = _first(follow, scan, highest)
    slope = np.full((len(x), 3), np.nan)
    if slopes and np.isfinite(found).any():
        chain = np.stack([c.column(k)[first] for k in ("mass", "length", "damping")], axis=1)
        slope = follow.slopes(found, by_mass[every]) * np.tile(chain, (m, 1))
    back = np.ravel(back)
    return found.reshape(m, -1)[:, back], slope.reshape(m, -1, 3)[:, back]


class _Follow:
    """Rows of parameters at intensity 1, followed at others."""

    def __init__(self, objective: GroundObjective, x: np.ndarray, which: np.ndarray) -> None:
        self.objective, self.x, self.which = objective, x, which
        self.late = objective.free * objective.rate

    def at(self, rows: np.ndarray, intensity: np.ndarray) -> tuple[Any, ...]:
        """Rows at intensities, as arguments of the compiled code."""
        x = self.x[rows].copy()
        x[:, 5] *= intensity
        return x, self.objective.pieces, self.which[rows], np.full(len(x), self.late)

    def overturns(self, rows: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """Function of intensities (rows, k): whether each overturns the block."""
        from tpd.models.compiled_shaken import follow_all
        from tpd.models.shaken_kernel import OVERTURNED

        def function(intensity: np.ndarray) -> np.ndarray:
            every = np.repeat(rows, intensity.shape[1])
            found, _ = follow_all(*self.at(every, intensity.ravel()), brief=True)
            return (found.status == OVERTURNED).reshape(intensity.shape)

        return function

    def slopes(self, found: np.ndarray, by_mass: np.ndarray) -> np.ndarray:
        """Derivatives of the crossings in (mu, lam, zeta)."""
        from tpd.models.compiled_shaken import follow_all

        slope = np.full((len(found), 3), np.nan)
        rows = np.flatnonzero(np.isfinite(found))
        _, by = follow_all(*self.at(rows, found[rows]), slopes=True)
        assert by is not None
        growing = by[:, 7]
        # The velocity ratio may depend on the mass ratio.
        growing[:, 1] += growing[:, 8] * by_mass[rows]
        by_intensity = growing[:, 5] * self.x[rows, 5]
        slope[rows] = -growing[:, 1:4] / by_intensity[:, None]
        return slope


def _first(follow: _Follow, scan: float, highest: float) -> np.ndarray:
    """First crossing of the scan of every row."""
    x = follow.x
    lifts = ((1.0 + x[:, 1]) * x[:, 0] + x[:, 4]) / x[:, 5]
    # Below half of what lifts the bare block, a pendulum would have to throw it over.
    low, steps = 0.5 * lifts, 1 + int(np.ceil(np.log(2.0 * highest) / np.log1p(scan)))
    found, left = np.full(len(x), np.inf), np.arange(len(x))
    for begun in range(0, steps, _AT_ONCE):
        if not left.size:
            break
        tried = low[left, None] * (1.0 + scan) ** np.arange(begun, min(begun + _AT_ONCE, steps))
        falls = follow.overturns(left)(tried)
        hit, at = falls.any(axis=1), np.argmax(falls, axis=1)
        rows, top = left[hit], tried[hit, at[hit]]
        if rows.size:
            stands = np.zeros(rows.size, dtype=bool)
            found[rows] = bisected(follow.overturns(rows), top / (1.0 + scan), top, stands, _ROUNDS)
        left = left[~hit]
    return found
