"""Search for the design of least rocking under ground motions.

Designs spread over the whole space come first. A response surface through their values then says which design
is worth following next, and which of all is the best: that of least trend, not the luckiest.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from tpd.core import checks
from tpd.core.progress import Count, unreported
from tpd.design.criteria import DesignSpace, Risk
from tpd.design.ground.objective import GroundObjective
from tpd.design.surface import Observations, Surface, candidates, fit, promise
from tpd.scene.conditions import latin_hypercube

DEFAULT_SPACE = DesignSpace(damping_ratio=(0.05, 1.0))
_LEAST_SIZE = 1e-6
SPARE = 0.05
"""Share of every limit that the search leaves free: other earthquakes and other blocks take more room than
those that a design is tuned to, by which it would lie on its limits."""


@dataclass(frozen=True, kw_only=True)
class GroundSearch:
    """How a space is searched on ground motions.

    Raises:
        ValueError: a count below its least.
    """

    starts: checks.Whole = 32
    """Designs spread over the space."""
    steps: checks.Whole = 32
    """Designs that follow one by one."""

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.count, "starts", 4)
        checks.set_checked(self, checks.count, "steps", 0)


class Evaluated(NamedTuple):
    """Designs that were followed: arrays with a row for each of m designs."""

    designs: np.ndarray
    """(mu, lam, zeta), (m, 3)"""
    value: np.ndarray
    """Risk of the severities, (m,)."""
    sizes: np.ndarray
    """Limited quantities over their limits, (m, sizes)."""
    overturned: np.ndarray
    """Share of the runs that overturn the block, of those with an answer, (m,)."""
    undecided: np.ndarray
    """Number of the runs without an answer, which value, sizes and share leave out, (m,)."""

    @property
    def feasible(self) -> np.ndarray:
        """Whether each design is within its limits, (m,); one of which no run has an answer is not."""
        return np.all(self.sizes <= 1.0, axis=1) & np.isfinite(self.value)

    @property
    def spares(self) -> np.ndarray:
        """Whether each design is within its limits with `SPARE` to spare, (m,)."""
        return self.feasible & np.all(self.sizes <= 1.0 - SPARE, axis=1)

    def at(self, rows: np.ndarray) -> Evaluated:
        """Some of the designs."""
        return Evaluated(*(x[rows] for x in self))


@dataclass
class Searcher:
    """One search."""

    objective: GroundObjective
    risk: Risk
    space: DesignSpace
    method: GroundSearch
    seed: int
    progress: Count = unreported
    names: tuple[str, ...] = ()
    """Limited quantities."""
    found: Evaluated | None = None
    surface: Surface | None = None
    limits: list[Surface] = field(default_factory=list)

    def run(self) -> None:
        """Follow designs until all are done."""
        d = len(self.space.names)
        total = self.method.starts + self.method.steps
        # One design after the other: its motions alone keep all cores busy.
        spread = latin_hypercube(np.random.default_rng([self.seed, 7]), self.method.starts, d)
        for i in range(total):
            unit = spread[i] if i < len(spread) else self._next(i, last=total - 4)
            one = self.evaluate(self.space.unscaled(np.asarray(unit)[None]))
            if self.found is not None:
                one = Evaluated(*map(np.concatenate, zip(self.found, one, strict=True)))
            self.found = one
            self.progress(i + 1, total)
        self._fit(full=True)

    def best(self) -> int | None:
        """Index of the design of least trend of those that keep to their limits with some to spare, or of
        those that keep to them; None without any."""
        if self.found is None or self.surface is None or not self.found.feasible.any():
            return None
        # The lowest value of many noisy ones is low by luck; the trend has averaged the luck out.
        trend, _ = self.surface.at(self.space.scaled(self.found.designs))
        allowed = self.found.spares if self.found.spares.any() else self.found.feasible
        return int(np.argmin(np.where(allowed, trend, np.inf)))

    def evaluate(self, designs: np.ndarray) -> Evaluated:
        """Follow designs through all motions."""
        runs = self.objective.evaluate(designs)
        self.names, sizes = self.objective.sizes(runs, designs)
        undecided = runs.undecided.sum(axis=1)
        share = runs.overturned.sum(axis=1) / np.maximum(runs.overturned.shape[1] - undecided, 1)
        value = risk_of_known(self.risk, runs.severity)
        return Evaluated(designs, value, sizes, share, undecided)

    def _fit(self, full: bool) -> None:
        """Fit the surfaces of risk and limits to all that was followed."""
        if self.found is None:
            return
        # A design of which no run has an answer says nothing.
        e = self.found.at(np.isfinite(self.found.value))
        if len(e.value) < 4:
            return
        at = self.space.scaled(e.designs)
        steps = 150 if full else 15
        self.surface = fit(Observations(at, e.value), self.seed, self.surface, steps)
        # Sizes are positive and range over decades: their logarithms are smooth.
        before = self.limits or [None] * e.sizes.shape[1]
        over = np.maximum(e.sizes, _LEAST_SIZE) / (1.0 - SPARE)
        self.limits = [
            fit(Observations(at, np.log(over[:, j])), self.seed, before[j], steps)
            for j in range(e.sizes.shape[1])
        ]

    def _next(self, i: int, last: int) -> np.ndarray:
        """The design to be followed next, in shares of the space."""
        assert self.found is not None
        # The numbers of the process change little from one design to the next.
        self._fit(full=i % 8 == 0)
        surface, e = self.surface, self.found
        rng, d = np.random.default_rng([self.seed, 8, i]), len(self.space.names)
        if surface is None:
            # Too few designs have an answer yet: anywhere.
            return rng.random(d)
        trend, _ = surface.at(self.space.scaled(e.designs))
        ranked = np.argsort(np.where(e.spares, trend, np.inf))[:4]
        x = candidates(rng, self.space.scaled(e.designs[ranked]))
        least = float(trend[ranked[0]]) if e.spares.any() else None
        return x[np.argmax(promise(surface, self.limits, x, least, i >= last))]


def risk_of_known(risk: Risk, values: np.ndarray) -> np.ndarray:
    """Risk of every row of severities over its runs with an answer; NaN where no run has one."""
    known = ~np.isnan(values)
    return np.array([float(risk.of(v[k])) if k.any() else np.nan for v, k in zip(values, known, strict=True)])
