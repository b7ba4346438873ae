"""Refinement: the best designs by trial runs, through which Gaussian processes estimate trends.

A hundred runs of one design leave its mean tilt unknown by several points, so that the design with the least
mean is the one whose runs are the most favourable by chance. Here every design has runs of its own, and a
process through the means of all designs averages their errors. It says which designs to evaluate next, and
which is the best. How far the bob swings differs little from run to run: a process through a quantile of each
limited quantity, with the tail that all designs near the limit share, says which designs exceed it too often
before one design alone has enough runs to show that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tpd.answers.paired import FEWER
from tpd.answers.runs import Runs
from tpd.core.progress import Progress
from tpd.design.criteria import STILL, first_apart
from tpd.design.gaussian_process import (
    GaussianProcess,
    Observations,
    fit,
    improvement,
    probability_below_zero,
    proposals,
)
from tpd.design.problem import Problem

_APART = 0.02
"""Least distance of designs that are proposed or validated, in shares of the space."""
_BULK, _ENOUGH, _SHARED = 0.9, 20, 16
"""Share of the runs below the quantile of a limited quantity that a process fits; runs that must stand for a
quantile; and designs near the limit that share the tail beyond it."""
_SAFE = 0.6
"""Share of the allowed excesses that a design may have: it leaves room for chance in the validation runs."""
_FIRST, _LATER = 150, 30
"""Steps of the fit of a process in the first round, and later."""
_LIKELY = 0.5
"""Least probability of keeping to the limits of a design that counts as keeping to them."""
_FEW_RESTS = 0.01
"""Share of the runs at rest without a pendulum below which no design is compared with it."""
_LEAST = 1e-6
_WEIGHED = 200


@dataclass(frozen=True, kw_only=True)
class Trials:
    """Designs that were evaluated by trial runs: arrays with a row for each of m designs."""

    designs: np.ndarray
    """(mu, lam, zeta), (m, 3)."""
    value: np.ndarray
    """Risk of the severities, (m,); NaN where no run has an answer."""
    trend: np.ndarray
    """The value as the Gaussian process estimates it, (m,)."""
    names: tuple[str, ...]
    """Limited quantities."""
    sizes: np.ndarray
    """These over their limits, (m, sizes), each exceeded in the allowed share of the runs that stand."""
    overturned: np.ndarray
    """Share of the runs that overturn, of those with an answer, (m,)."""
    undecided: np.ndarray
    """Number of the runs without an answer, which everything else leaves out, (m,)."""
    feasible: np.ndarray
    """Whether the design is likely to keep to all limits, (m,)."""
    without_pendulum: float
    """Risk without a pendulum."""
    process: GaussianProcess | None
    """Process through the values, in shares of the space; None where too few runs have an answer."""

    def best_without(self, *limits: str) -> int | None:
        """Return the index of the design of least trend that keeps to all limits but those named, or None."""
        others = [i for i, name in enumerate(self.names) if name not in limits]
        keeps = np.all(self.sizes[:, others] <= 1.0, axis=1) & np.isfinite(self.value)
        return int(np.argmin(np.where(keeps, self.trend, np.inf))) if keeps.any() else None


@dataclass
class Refinement:
    """Trials of a problem so far, and the processes through them."""

    problem: Problem
    progress: Progress
    total: int
    """Number of trials that are planned, for the progress."""
    designs: list[np.ndarray] = field(default_factory=list)
    runs: list[Runs] = field(default_factory=list)
    process: GaussianProcess | None = None
    limits: dict[str, GaussianProcess] = field(default_factory=dict)
    likely: float = _LIKELY

    def __post_init__(self) -> None:
        runs = self.problem.trial_runs(None, self.problem.run_seed(1, 0))
        self.without, self.rests = self.problem.value_of(runs), float(runs.share_at_rest.value)
        self._tail: dict[str, np.ndarray] = {}

    def evaluate(self, designs: np.ndarray) -> None:
        """Follow the trial runs of designs (m, 3), and fit the processes again."""
        for design in designs:
            self.progress("trial runs", len(self.runs) + 1, self.total)
            self.add(design, self.problem.trial_runs(design, self.problem.run_seed(1, len(self.runs) + 1)))
        self.fit()

    def add(self, design: np.ndarray, runs: Runs) -> None:
        """Add the runs of one design."""
        self.designs.append(design)
        self.runs.append(runs)

    def fit(self) -> None:
        """Fit the processes to all trials that have an answer."""
        values = np.array([self.problem.value_of(r) for r in self.runs])
        known = np.flatnonzero(np.isfinite(values))
        if len(known) < 4:
            return
        at = self.problem.space.scaled(np.array(self.designs))

        def fitted(rows: np.ndarray, x: np.ndarray, before: GaussianProcess | None) -> GaussianProcess:
            # The hyperparameters change little from one round to the next.
            steps = _FIRST if before is None else _LATER
            return fit(Observations(at[rows], x), self.problem.seed, before, steps)

        self.process = fitted(known, values[known], self.process)
        # Sizes are positive and range over decades: their logarithms are smooth.
        for name, size in self._quantiles().items():
            x = size - np.log1p(-self.problem.spare)
            rows = np.flatnonzero(np.isfinite(x))
            # A quantity that is far from its limit everywhere needs no process.
            if len(rows) >= 4 and np.any(x[rows] > -0.7):
                self.limits[name] = fitted(rows, x[rows], self.limits.get(name))
        if self.rests > _FEW_RESTS:
            fewer = (1.0 - FEWER) * self.rests - np.array([r.share_at_rest.value for r in self.runs])
            self.limits["rests"] = fitted(known, fewer[known], self.limits.get("rests"))

    def _quantiles(self) -> dict[str, np.ndarray]:
        """Logarithms of the limited quantities that the safe share of the standing runs keeps to, by name,
        (m,); NaN where too few runs stand."""
        level = 1.0 - _SAFE * self.problem.allowed
        sizes = [self.problem.sizes_in_runs(*pair) for pair in zip(self.designs, self.runs, strict=True)]
        out = {}
        for name in sizes[0]:
            if name in STILL:
                continue
            each = [np.log(np.maximum(s[name], _LEAST)) for s in sizes]
            bulk = np.array([np.quantile(x, _BULK) if len(x) >= _ENOUGH else np.nan for x in each])
            known = np.flatnonzero(np.isfinite(bulk))
            if not len(known):
                continue
            # The tail beyond the bulk is alike for designs near the limit, and one design has few runs in it.
            near = known[np.argsort(np.abs(bulk[known]))][:_SHARED]
            tail = np.concatenate([each[i] - bulk[i] for i in near])
            out[name] = bulk + np.quantile(tail, level)
        return out

    def keeps(self, x: np.ndarray) -> np.ndarray:
        """Return the probability that designs at places (m, d) keep to the limits, by their trends."""
        return probability_below_zero(list(self.limits.values()), x)

    def possible(self, designs: np.ndarray) -> np.ndarray:
        """Return whether designs (m, 3) keep to the limits that need no run."""
        sizes = self.problem.fixed_sizes(designs)
        return np.max([np.zeros(len(designs)), *sizes.values()], axis=0) <= 1.0

    def order(self) -> np.ndarray:
        """Return the order of the trials: those that are likely to keep to the limits first, then by
        trend."""
        designs = np.array(self.designs)
        x = self.problem.space.scaled(designs)
        if self.process is None:
            return np.arange(len(x))
        keeps = np.where(self.possible(designs), self.keeps(x), 0.0)
        known = np.isfinite([self.problem.value_of(r) for r in self.runs])
        keeps = np.where(known, keeps, -1.0)
        return np.lexsort((self.process.at(x)[0], np.where(keeps >= self.likely, 0.0, 1.0 - keeps)))

    def next(self, turn: int, count: int, last: bool) -> np.ndarray:
        """Return designs (m, 3) worth a trial, at most `count`: those of the largest expected improvement, or
        at last those of the least trend."""
        space, rng = self.problem.space, np.random.default_rng([self.problem.seed, 12, turn])
        if self.process is None:
            return space.unscaled(rng.random((count, len(space.names))))
        best = space.scaled(np.array(self.designs))[self.order()[:4]]
        x = proposals(rng, best)
        keeps = self.keeps(x)
        if self.keeps(best[:1])[0] < self.likely:
            # There is nothing to improve on yet.
            promise = keeps
        elif last:
            promise = np.where(keeps >= self.likely, -self.process.at(x)[0], -np.inf)
        else:
            promise = keeps * improvement(self.process, x, float(self.process.at(best[:1])[0][0]))
        order = np.argsort(-promise, kind="stable")[:_WEIGHED]
        order = order[self.possible(space.unscaled(x[order]))]
        return space.unscaled(x[first_apart(x, order, count, _APART)])

    def equivalent(self, design: np.ndarray) -> np.ndarray | None:
        """Return the least and the largest designs, (2, 3), that the trials cannot tell from one of them: the
        trend of their tilt is at most two deviations above its trend, and they keep to the limits."""
        if self.process is None:
            return None
        space = self.problem.space
        here = space.scaled(design[None])
        x = np.clip(proposals(np.random.default_rng([self.problem.seed, 14]), here), 0.0, 1.0)
        trend, deviation = (float(v[0]) for v in self.process.at(here))
        good = (self.process.at(x)[0] <= trend + 2.0 * deviation) & (self.keeps(x) >= self.likely)
        designs = space.unscaled(x[good])
        both = np.concatenate([design[None], designs[self.possible(designs)]])
        return np.stack([both.min(axis=0), both.max(axis=0)])

    def trials(self) -> Trials:
        """Return all trials as a table, the best first."""
        order = self.order()
        designs = np.array(self.designs)
        fixed = self.problem.fixed_sizes(designs)
        quantiles = {name: np.exp(x) for name, x in self._quantiles().items()}
        # A design whose block stands in too few runs has no quantile: its tilt says enough.
        sizes = [np.fmax(fixed[name], quantiles.get(name, fixed[name])) for name in fixed]
        x = self.problem.space.scaled(designs)
        trend = np.full(len(x), np.nan) if self.process is None else self.process.at(x)[0]
        counts = [(r.is_overturned.sum(), r.is_unanswered.sum(), len(r.outcome)) for r in self.runs]
        fell, unknown, runs = np.array(counts, dtype=float).T
        return Trials(
            designs=designs[order],
            value=np.array([self.problem.value_of(r) for r in self.runs])[order],
            trend=trend[order],
            names=tuple(fixed),
            sizes=np.array(sizes, dtype=float).reshape(len(fixed), len(designs)).T[order],
            overturned=(fell / np.maximum(runs - unknown, 1.0))[order],
            undecided=unknown.astype(int)[order],
            feasible=((self.keeps(x) >= self.likely) & self.possible(designs))[order],
            without_pendulum=self.without,
            process=self.process,
        )


def refine(problem: Problem, candidates: np.ndarray, progress: Progress) -> Refinement:
    """Evaluate candidates (m, 3) of a problem by trial runs, and further designs where the trend promises the
    largest improvement."""
    rounds, batch = problem.rounds
    found = Refinement(problem, progress, len(candidates) + rounds * batch)
    found.evaluate(candidates)
    for turn in range(rounds):
        designs = found.next(turn, batch, turn == rounds - 1)
        if len(designs):
            found.evaluate(designs)
    return found


def apart(problem: Problem, designs: np.ndarray, others: Sequence[np.ndarray]) -> np.ndarray:
    """Return the designs (m, 3) that are no neighbours of others."""
    units = problem.space.scaled(designs)
    near = problem.space.scaled(np.array(others).reshape(-1, 3))
    distance = np.linalg.norm(units[:, None] - near[None], axis=-1).min(axis=1, initial=np.inf)
    return designs[distance > _APART]
