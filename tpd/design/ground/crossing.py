"""Intensity from which each motion overturns a block with a pendulum.

As `tpd.critical_scale`, for many designs and motions at once: the first crossing of a scan, bisected.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tpd.analysis.critical_scale import bisected, standing, verdicts
from tpd.design.ground.objective import GroundObjective

_AT_ONCE = 8
"""Factors that are tried at once: a scan ends with the first of them that overturns the block."""
_ROUNDS = 5
"""Steps of the bisection, each by a factor of 32."""


class Crossings(NamedTuple):
    """First intensities that overturn the block, for m designs under n conditions."""

    intensity: np.ndarray
    """(m, n); infinite where no factor of the scan overturns the block, and where there is no answer up to
    which factor it stands, the largest up to which it is known to stand."""
    undecided: np.ndarray
    """Whether a run below the first overturning of the scan has no answer, (m, n)."""


def crossings(objective: GroundObjective, designs: np.ndarray, scan: float, highest: float) -> Crossings:
    """Follow a scan up to the first intensity that overturns the block, by the linear equations.

    Args:
        objective: conditions; their scales are not used, but the intensity that they count.
        designs: (mu, lam, zeta), shape (m, 3).
        scan: relative step of the scan.
        highest: its end, over the intensity that lifts the bare block.
    """
    c, m = objective.conditions, len(designs)
    others = np.stack([v for k, v in sorted(c.factors.items()) if k != "amplitude"] or [np.zeros(len(c))])
    # Stripes of one motion on one block have the same crossing.
    _, first, back = np.unique(
        np.vstack([np.asarray(c.which)[None], others]), axis=1, return_index=True, return_inverse=True
    )
    rows = objective.rows(designs)
    every = (np.arange(m)[:, None] * len(c) + first).ravel()
    x, which = rows[every], np.tile(np.asarray(c.which)[first], m)
    x[:, 5] /= np.tile(c.column("amplitude")[first], m)
    found = _first(_Follow(objective, x, which), scan, highest)
    return Crossings(*(a.reshape(m, -1)[:, np.ravel(back)] for a in found))


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

    def status(self, rows: np.ndarray, intensity: np.ndarray) -> np.ndarray:
        """Statuses of rows at intensities, shape (rows,) or (rows, k)."""
        from tpd.models.compiled_shaken import follow_all

        every = np.repeat(rows, intensity.size // max(rows.size, 1))
        found, _ = follow_all(*self.at(every, intensity.ravel()), brief=True)
        return found.status.reshape(intensity.shape)


def _first(follow: _Follow, scan: float, highest: float) -> tuple[np.ndarray, np.ndarray]:
    """First crossing of the scan of every row, and whether a run below it has no answer."""
    from tpd.models.shaken_kernel import STOOD

    x = follow.x
    lifts = ((1.0 + x[:, 1]) * x[:, 0] + x[:, 4]) / x[:, 5]
    top = highest * lifts
    # Below half of what lifts the bare block, only a pendulum can lift it.
    low = standing(lambda rows, factor: follow.status(rows, factor) == STOOD, 0.5 * lifts, scan)
    found, undecided, left = np.full(len(x), np.inf), np.zeros(len(x), dtype=bool), np.arange(len(x))
    begun = 0
    while left.size:
        tried = low[left, None] * (1.0 + scan) ** np.arange(begun, begun + _AT_ONCE)
        tried = np.minimum(tried, top[left, None])
        falls = verdicts(follow.status(left, tried))
        # The first factor at which the block is not known to stand.
        hit, at = (falls != 0.0).any(axis=1), np.argmax(falls != 0.0, axis=1)
        rows, at = left[hit], at[hit]
        under, over = low[rows] * (1.0 + scan) ** (begun + at - 1.0), tried[hit, at]
        found[rows], undecided[rows] = under, True
        # Nothing is known to stand below the beginning of a scan.
        fell = (falls[hit, at] == 1.0) & (begun + at > 0)
        rows, under, over = rows[fell], under[fell], over[fell]
        if rows.size:
            stands = np.zeros(rows.size, dtype=bool)

            def verdict(some: np.ndarray, factors: np.ndarray, rows: np.ndarray = rows) -> np.ndarray:
                return verdicts(follow.status(rows[some], factors))

            lo, hi, sure = bisected(verdict, under, over, stands, _ROUNDS)
            found[rows], undecided[rows] = np.where(sure, hi, lo), ~sure
        left = left[~hit & (tried[:, -1] < top[left])]
        begun += _AT_ONCE
    return found, undecided
