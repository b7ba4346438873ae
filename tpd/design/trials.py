"""Designs that a search has evaluated by runs, as a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tpd.answers.run_table import Runs
from tpd.design.trend import Trend


@dataclass(frozen=True, kw_only=True)
class Trials:
    """Designs that were evaluated by trial runs: arrays with one row for each of m designs."""

    designs: np.ndarray
    """(mu, lam, zeta), (m, 3)."""
    value: np.ndarray
    """Risk of the severities, (m,); NaN if no run has a result."""
    trend: np.ndarray
    """Risk as the trend over all designs estimates it, (m,)."""
    names: tuple[str, ...]
    """Names of the limited quantities."""
    sizes: np.ndarray
    """Limited quantities over their limits, (m, sizes): the value that only the allowed share of the standing
    runs exceeds; NaN if too few runs stand."""
    overturned: np.ndarray
    """Share of the runs with a result that overturn, (m,); NaN if there are none."""
    undecided: np.ndarray
    """Number of runs without a result, (m,). All other columns leave these runs out."""
    feasible: np.ndarray
    """Whether the design keeps all limits according to their trends, (m,)."""
    without_pendulum: float
    """Risk without a pendulum."""
    risk: Trend | None
    """Trend of the risk over the logarithms of the design; None if too few runs have a result."""
    limits: dict[str, Trend] = field(default_factory=dict)
    """Trends of the logarithms of the limited quantities over their limits, by name."""

    @staticmethod
    def of(order: np.ndarray, runs: Sequence[Runs], limited: dict[str, np.ndarray], **more: Any) -> Trials:
        """Return the table in an order of the designs.

        Args:
            order: indices of the designs.
            runs: runs of each design.
            limited: limited quantities over their limits, by name, each (m,).
            more: other fields. Arrays are put into the order.
        """
        more |= {
            "sizes": np.column_stack([np.empty((len(runs), 0)), *limited.values()]),
            "overturned": np.array([x.share_overturned.value for x in runs]),
            "undecided": np.array([x.is_unanswered.sum() for x in runs]),
        }
        for name, x in more.items():
            more[name] = x[order] if isinstance(x, np.ndarray) else x
        return Trials(names=tuple(limited), **more)

    def best_without(self, *limits: str) -> int | None:
        """Return the index of the design of smallest trend that keeps all limits except those named, or
        None."""
        others = [i for i, name in enumerate(self.names) if name not in limits]
        keeps = np.all(self.sizes[:, others] <= 1.0, axis=1) & np.isfinite(self.value)
        return int(np.argmin(np.where(keeps, self.trend, np.inf))) if keeps.any() else None
