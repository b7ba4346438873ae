"""Refinement: evaluate designs by trial runs, and estimate trends over the designs with Gaussian processes.

The mean tilt of one design over a hundred runs is uncertain by several percentage points. The design with the
smallest mean would therefore be the one with the most favourable runs. Here every design has runs of its own,
and a process through the means of all designs averages their errors. The process selects the designs to
evaluate next, and the best design.

The swing of the bob varies little from run to run. For each limited quantity a process is fitted to a
quantile, extrapolated with a tail that is common to all designs near the limit. This process identifies
designs that exceed the limit too often, although each design alone has too few runs to show it. A limit whose
quantile is unknown does not count as kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tpd.answers.paired import FEWER
from tpd.answers.run_table import Runs
from tpd.core.progress import Progress
from tpd.design.gaussian_process import (
    GaussianProcess,
    Observations,
    fit,
    improvement,
    probability_below_zero,
    proposals,
)
from tpd.design.problem import Problem
from tpd.design.space import first_apart
from tpd.limits import STILL

_APART = 0.02
"""Smallest distance between designs that are proposed or validated, in shares of the space."""
_BULK, _SHARED = ((0.9, 20), (0.5, 4)), 16
"""Quantile levels of a limited quantity that are computed for each design alone, each with the number of
standing runs that it requires; and the number of designs near the limit whose tails are combined."""
_SAFE = 0.6
"""Share of the allowed excesses that a design may use. The rest is a margin for chance in the validation
runs."""
_FIRST, _LATER = 150, 30
"""Steps of the fit of a process in the first round, and in later rounds."""
_LIKELY = 0.5
"""Smallest probability of keeping all limits for a design that counts as feasible."""
_RESTS, _FEW_RESTS = "fewer_runs_at_rest", 0.01
"""Name of the limit on the decrease of the runs at rest, and share of runs at rest without a pendulum below
which they are not compared."""
_SIZES = 1e-6, 1e3
"""Smallest and largest limited quantity over its limit. A run whose quantity is unknown has the largest."""
_WEIGHED = 200


@dataclass(frozen=True, kw_only=True)
class Trials:
    """Designs that were evaluated by trial runs: arrays with one row for each of m designs."""

    designs: np.ndarray
    """(mu, lam, zeta), (m, 3)."""
    value: np.ndarray
    """Risk of the severities, (m,); NaN if no run has a result."""
    trend: np.ndarray
    """Risk as the Gaussian process estimates it, (m,)."""
    names: tuple[str, ...]
    """Names of the limited quantities."""
    sizes: np.ndarray
    """Limited quantities over their limits, (m, sizes): the value that only the allowed share of the standing
    runs exceeds; NaN if too few runs stand."""
    overturned: np.ndarray
    """Share of the runs with a result that overturn, (m,)."""
    undecided: np.ndarray
    """Number of runs without a result, (m,). All other columns leave these runs out."""
    feasible: np.ndarray
    """Whether the design is likely to keep all limits, (m,)."""
    without_pendulum: float
    """Risk without a pendulum."""
    process: GaussianProcess | None
    """Process through the risks, in shares of the space; None if too few runs have a result."""
    limits: dict[str, GaussianProcess] = field(default_factory=dict)
    """Processes of the limited quantities that decide which designs are feasible, by name, in shares of the
    space: negative where the limit is kept. A quantity that is far below its limit has none."""

    def best_without(self, *limits: str) -> int | None:
        """Return the index of the design of smallest trend that keeps all limits except those named, or
        None."""
        others = [i for i, name in enumerate(self.names) if name not in limits]
        keeps = np.all(self.sizes[:, others] <= 1.0, axis=1) & np.isfinite(self.value)
        return int(np.argmin(np.where(keeps, self.trend, np.inf))) if keeps.any() else None


@dataclass
class Refinement:
    """Trials of a problem so far, with the processes that are fitted to them."""

    problem: Problem
    progress: Progress
    total: int
    """Planned number of trials, for the progress."""
    designs: list[np.ndarray] = field(default_factory=list)
    """Designs (mu, lam, zeta) of the trials, each (3,)."""
    runs: list[Runs] = field(default_factory=list)
    """Runs of each trial."""
    process: GaussianProcess | None = None
    """Process through the risks of the trials."""
    limits: dict[str, GaussianProcess] = field(default_factory=dict)
    """Process of each limited quantity, by name: negative where the limit is kept."""
    likely: float = _LIKELY
    """Smallest probability of keeping all limits for a design that counts as feasible."""

    def __post_init__(self) -> None:
        # The runs without a pendulum are the reference of every trial.
        runs = self.problem.trial_runs(None, self.problem.run_seed(1, 0))
        self.without, self.rests = self.problem.value_of(runs), float(runs.share_at_rest.value)
        self._unknown = False

    @property
    def at(self) -> np.ndarray:
        """Designs of the trials in shares of the space, (m, d)."""
        return self.problem.space.scaled(np.array(self.designs))

    @property
    def values(self) -> np.ndarray:
        """Risk of each trial, (m,); NaN if no run has a result."""
        return np.array([self.problem.value_of(runs) for runs in self.runs])

    def evaluate(self, designs: np.ndarray) -> None:
        """Simulate the trial runs of designs (m, 3), and fit the processes again."""
        for design in designs:
            self.progress("trial runs", len(self.runs) + 1, self.total)
            self.add(design, self.problem.trial_runs(design, self.problem.run_seed(1, len(self.runs) + 1)))
        self.fit()

    def add(self, design: np.ndarray, runs: Runs) -> None:
        """Add a design with its runs."""
        self.designs.append(design)
        self.runs.append(runs)

    def fit(self) -> None:
        """Fit the processes to all trials that have a result."""
        values, at = self.values, self.at
        finite = np.flatnonzero(np.isfinite(values))
        # With very few values a trend would be meaningless.
        if len(finite) < 4:
            return

        def fitted(rows: np.ndarray, x: np.ndarray, before: GaussianProcess | None) -> GaussianProcess:
            # The hyperparameters change little from one round to the next, so that later rounds need fewer
            # steps.
            steps = _FIRST if before is None else _LATER
            return fit(Observations(at[rows], x), self.problem.seed, before, steps)

        self.process = fitted(finite, values[finite], self.process)
        # Sizes are positive and cover decades, so that their logarithms are smooth functions of the design.
        self._unknown = False
        for name, size in self._quantiles().items():
            x = size - np.log1p(-self.problem.spare)
            rows = np.flatnonzero(np.isfinite(x))
            # A quantity that is far from its limit everywhere needs no process. A quantity with too few
            # values for a process is not known to keep its limit.
            self._unknown |= len(rows) < 4
            if len(rows) >= 4 and np.any(x[rows] > -0.7):
                self.limits[name] = fitted(rows, x[rows], self.limits.get(name))
        if self.rests > _FEW_RESTS:
            fewer = (1.0 - FEWER) * self.rests - np.array([r.share_at_rest.value for r in self.runs])
            self.limits[_RESTS] = fitted(finite, fewer[finite], self.limits.get(_RESTS))

    def _quantiles(self) -> dict[str, np.ndarray]:
        """Return the logarithm of a quantile of every limited quantity over its limit, by name, (m,).

        The level of the quantile leaves the safe share of the allowed excesses. NaN if too few runs stand.
        """
        level = 1.0 - _SAFE * self.problem.allowed
        sizes = [self.problem.sizes_in_runs(*pair) for pair in zip(self.designs, self.runs, strict=True)]
        stands = [r.stands.sum() for r in self.runs]
        # All designs have the same level, because the tail beyond it is common to them. If few runs stand,
        # the level is lower, and more of the result comes from the tail.
        bulk, least = _BULK[int(np.median(stands) < _BULK[0][1])]
        out = {}
        for name in sizes[0]:
            if name in STILL:
                continue
            each = [np.log(np.clip(np.nan_to_num(s[name], nan=_SIZES[1]), *_SIZES)) for s in sizes]
            own = np.array([np.quantile(x, bulk) if len(x) >= least else np.nan for x in each])
            # One design has only a few runs beyond the computed quantile. The distribution beyond it is
            # similar for all designs near the limit, so that their runs are combined.
            near = [i for i in np.argsort(np.abs(own)) if np.isfinite(own[i])][:_SHARED]
            tail = np.concatenate([each[i] - own[i] for i in near]) if near else [0.0]
            out[name] = own + np.quantile(tail, level)
        return out

    def keeps(self, x: np.ndarray) -> np.ndarray:
        """Return the probability that designs at points (m, d) keep the limits, according to their trends."""
        return probability_below_zero(list(self.limits.values()), x) * (not self._unknown)

    def order(self) -> np.ndarray:
        """Return the order of the trials: designs that are likely to keep the limits first, then by trend."""
        x = self.at
        if self.process is None:
            return np.arange(len(x))
        keeps = np.where(self.problem.possible(np.array(self.designs)), self.keeps(x), 0.0)
        keeps = np.where(np.isfinite(self.values), keeps, -1.0)
        # Among infeasible designs the one with the highest probability comes first, which guides the next
        # trials.
        return np.lexsort((self.process.at(x)[0], np.where(keeps >= self.likely, 0.0, 1.0 - keeps)))

    def next(self, turn: int, count: int, last: bool) -> np.ndarray:
        """Return designs (m, 3) for the next trials, at most `count`.

        They are the designs of largest expected improvement; in the last round those of smallest trend.
        """
        space, rng = self.problem.space, np.random.default_rng([self.problem.seed, 12, turn])
        if self.process is None:
            return space.unscaled(rng.random((count, len(space.names))))
        # Proposals near the best four designs refine them; the others explore the space.
        best = self.at[self.order()[:4]]
        x = proposals(rng, best)
        keeps = self.keeps(x)
        if self.keeps(best[:1])[0] < self.likely:
            # No trial is likely to keep the limits, so that there is no value to improve on: look for a
            # feasible design.
            promise = keeps
        elif last:
            promise = np.where(keeps >= self.likely, -self.process.at(x)[0], -np.inf)
        else:
            promise = keeps * improvement(self.process, x, float(self.process.at(best[:1])[0][0]))
        # Limits that need no run are cheap to check, but not for thousands of proposals.
        order = np.argsort(-promise, kind="stable")[:_WEIGHED]
        order = order[self.problem.possible(space.unscaled(x[order]))]
        return space.unscaled(x[first_apart(x, order, count, _APART)])

    def equivalent(self, design: np.ndarray) -> np.ndarray | None:
        """Return the smallest and the largest designs, (2, 3), that perform as well as one design within the
        accuracy of the trials.

        Their trend exceeds the trend of the design by at most two standard deviations, and they keep the
        limits.
        """
        if self.process is None:
            return None
        space = self.problem.space
        here = space.scaled(design[None])
        x = np.clip(proposals(np.random.default_rng([self.problem.seed, 14]), here), 0.0, 1.0)
        trend, deviation = (float(v[0]) for v in self.process.at(here))
        # Two standard deviations: the trials cannot distinguish such designs.
        good = (self.process.at(x)[0] <= trend + 2.0 * deviation) & (self.keeps(x) >= self.likely)
        designs = space.unscaled(x[good])
        equivalent = np.concatenate([design[None], designs[self.problem.possible(designs)]])
        return np.stack([equivalent.min(axis=0), equivalent.max(axis=0)])

    def trials(self) -> Trials:
        """Return all trials as a table, best first."""
        order = self.order()
        designs = np.array(self.designs)
        fixed = self.problem.fixed_sizes(designs)
        quantiles = {name: np.exp(x) for name, x in self._quantiles().items()}
        columns = [np.maximum(fixed[name], quantiles.get(name, fixed[name])) for name in fixed]
        sizes = np.array(columns, dtype=float).reshape(len(fixed), len(designs)).T
        x = self.at
        # If no process could be fitted, only the validation can show whether a design keeps the limits.
        feasible = (self.keeps(x) >= self.likely) & self.problem.possible(designs)
        feasible &= np.isfinite(sizes).all(axis=1) | (self.process is None)
        trend = np.full(len(x), np.nan) if self.process is None else self.process.at(x)[0]
        counts = [(r.is_overturned.sum(), r.is_unanswered.sum(), len(r.outcome)) for r in self.runs]
        overturned, unanswered, runs = np.array(counts, dtype=float).T
        return Trials(
            designs=designs[order],
            value=self.values[order],
            trend=trend[order],
            names=tuple(fixed),
            sizes=sizes[order],
            overturned=(overturned / np.maximum(runs - unanswered, 1.0))[order],
            undecided=unanswered.astype(int)[order],
            feasible=feasible[order],
            without_pendulum=self.without,
            process=self.process,
            limits=dict(self.limits),
        )


def refine(problem: Problem, candidates: np.ndarray, progress: Progress) -> Refinement:
    """Evaluate candidates (m, 3) of a problem by trial runs, then further designs of large expected
    improvement."""
    rounds, batch = problem.rounds
    refinement = Refinement(problem, progress, len(candidates) + rounds * batch)
    refinement.evaluate(candidates)
    for turn in range(rounds):
        designs = refinement.next(turn, batch, turn == rounds - 1)
        if len(designs):
            refinement.evaluate(designs)
    return refinement


def apart(problem: Problem, designs: np.ndarray, others: Sequence[np.ndarray]) -> np.ndarray:
    """Return the designs (m, 3) that have a distance from all other designs."""
    units = problem.space.scaled(designs)
    near = problem.space.scaled(np.array(others).reshape(-1, 3))
    distance = np.linalg.norm(units[:, None] - near[None], axis=-1).min(axis=1, initial=np.inf)
    return designs[distance > _APART]
