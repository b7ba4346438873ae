"""Results of the runs of an ensemble: shares with their confidence intervals, and quantiles."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tpd.core.formatting import Printed
from tpd.scene.status import SETTLED

if TYPE_CHECKING:
    from tpd.answers.ensemble import Ensemble

_Z = 1.959964
"""Quantile of the normal distribution for a two-sided interval of 95 %."""
LOST = ("overturned",)
"""Statuses of runs that count as overturned."""
UNANSWERED = ("event_bound", "failed")
"""Statuses of runs without an answer: they are counted apart, and are neither falls nor rest."""


class Share(NamedTuple):
    """A share of the runs, with its 95 % confidence interval (Wilson's)."""

    value: float
    low: float
    high: float

    @staticmethod
    def of(hits: np.ndarray) -> Share:
        """Share of the true entries in a vector; NaN, between 0 and 1, of none."""
        if not len(hits):
            return Share(math.nan, 0.0, 1.0)
        # Wilson's interval stays within 0 to 1 and is not empty where no run, or every run, is a hit.
        n, s = len(hits), float(np.mean(hits))
        middle = (s + _Z**2 / (2 * n)) / (1 + _Z**2 / n)
        half = _Z / (1 + _Z**2 / n) * math.sqrt(s * (1 - s) / n + _Z**2 / (4 * n**2))
        return Share(s, max(0.0, middle - half), min(1.0, middle + half))

    def __str__(self) -> str:
        return f"{self.value:.1%} ({self.low:.1%} to {self.high:.1%})"


@dataclass(frozen=True, kw_only=True, repr=False)
class Outcomes(Printed):
    """Outcomes of the runs of an ensemble: arrays of shape (size,), angles in rad. All shares and quantiles
    are of the runs with an answer; sizes of the others are NaN."""

    ensemble: Ensemble
    status: np.ndarray
    """Names of statuses; a run that has not settled within its periods is not_settled."""
    peak: np.ndarray
    """Largest |phi| from the start on; infinite where the block overturns."""
    amplitude: np.ndarray
    """Settled |phi|, or the largest of the last periods; infinite where the block overturns."""
    peak_stroke: np.ndarray
    """Largest |psi| from the start on."""
    stroke: np.ndarray
    """Settled |psi|, or the largest of the last periods."""
    ramp: np.ndarray
    """Seconds (or units of tau) over which the shaking grew."""
    nu: np.ndarray | None = None
    """Slenderness of the block in every run, as it scatters; None where it is not known."""
    mu: np.ndarray | None = None
    """Mass ratio of the pendulum."""
    lam: np.ndarray | None = None
    """Length ratio."""
    equations: str = "linear"
    """Equations by which the runs were followed, "linear" or "nonlinear"."""

    @property
    def overturned(self) -> Share:
        """Share of the runs in which the block overturns."""
        return self._share(self.lost)

    @property
    def lost(self) -> np.ndarray:
        """Whether a run overturned."""
        return np.isin(self.status, LOST)

    @property
    def undecided(self) -> np.ndarray:
        """Whether a run has no answer: it met the bound on events, or ended without finite numbers."""
        return np.isin(self.status, UNANSWERED)

    def _share(self, hits: np.ndarray) -> Share:
        return Share.of(hits[~self.undecided])

    def at(self, rows: np.ndarray) -> Outcomes:
        """Some of the runs."""
        names = "status", "peak", "amplitude", "peak_stroke", "stroke", "ramp", "nu", "mu", "lam"
        values = {name: getattr(self, name) for name in names}
        return replace(self, **{name: x[rows] for name, x in values.items() if x is not None})

    def ended(self, falls: bool) -> Outcomes:
        """The runs with an end for each that has none: an overturning, or rest."""
        size, name = (math.inf, "overturned") if falls else (0.0, "rest")
        sizes = {
            of: np.where(self.undecided, size, getattr(self, of))
            for of in ("peak", "amplitude", "peak_stroke", "stroke")
        }
        return replace(self, status=np.where(self.undecided, name, self.status), **sizes)

    @property
    def at_rest(self) -> Share:
        """Share of the runs in which the block comes to rest for good."""
        return self._share(self.status == "rest")

    @property
    def settled(self) -> Share:
        """Share of the runs that reach a periodic motion, or rest."""
        return self._share(np.isin(self.status, SETTLED))

    def summary(self) -> dict[str, Any]:
        """Equations, shares with their intervals, and quantiles, for JSON."""
        shares = {"overturned": self.overturned, "at_rest": self.at_rest, "settled": self.settled}
        quantiles = {n: self.quantiles(n) for n in ("peak", "amplitude", "peak_stroke", "stroke")}
        intervals = {n: tuple(s) for n, s in shares.items()}
        unknown = int(self.undecided.sum())
        shares_and_sizes = {"shares": intervals, "quantiles_50_90_99": quantiles}
        return {"equations": self.equations, "undecided": unknown, **shares_and_sizes}

    def quantiles(self, of: str, at: tuple[float, ...] = (0.5, 0.9, 0.99)) -> tuple[float, ...]:
        """Quantiles of `peak`, `amplitude`, `peak_stroke` or `stroke` over all runs, overturned ones at
        infinity: the least number that at least such a share of the runs does not exceed."""
        # An overturned run has an infinite size: quantiles stay defined, and say so.
        values = np.sort(getattr(self, of)[~self.undecided])
        if not len(values):
            return (math.nan,) * len(at)
        return tuple(float(values[min(len(values) - 1, math.ceil(q * len(values)) - 1)]) for q in at)

    def by_ramp(self) -> dict[float, Share]:
        """Share overturned for each duration over which the shaking grows."""
        known = ~self.undecided
        return {float(r): Share.of(self.lost[known & (self.ramp == r)]) for r in np.unique(self.ramp)}

    def rows(self) -> list[tuple[str, str]]:
        """Lines of a table: a name, and a share or quantiles as text."""
        out = [("overturned", str(self.overturned))]
        for ramp, share in self.by_ramp().items():
            name = "sudden" if ramp == 0.0 else f"growing for {ramp:g} s"
            out.append((f"  {name}", f"{share.value:.1%}"))
        out.append(("at rest in the end", str(self.at_rest)))
        for name, of in _QUANTILES.items():
            sizes = "  ".join(_size(v) for v in self.quantiles(of))
            out.append((f"{name}: 50, 90, 99 %", sizes))
        return out

    def __str__(self) -> str:
        e = self.ensemble
        runs = f"Ensemble of {e.size} runs of up to {e.periods} periods, seed {e.seed}"
        head = f"{runs}, {self.equations} equations"
        lines = [head, *(f"  {name:36}{text:>26}" for name, text in self.rows())]
        if self.undecided.any():
            lines.append(f"  {UNDECIDED_ROW:36}{self.undecided.sum():>26}")
        return "\n".join(lines)


def _size(value: float) -> str:
    return "unknown" if math.isnan(value) else f"{value:.4f}" if math.isfinite(value) else "lost"


UNDECIDED_ROW = "runs without an answer"
_QUANTILES = {
    "largest tilt, rad": "peak",
    "settled tilt, rad": "amplitude",
    "bob's angle, rad": "peak_stroke",
}
