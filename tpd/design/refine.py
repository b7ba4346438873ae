"""Refinement: evaluate designs by trial runs, follow their trend to the best design, and compare the best.

All designs have the same trial runs (common random numbers; B. L. Nelson and F. J. Matejcik, Management
Science 41, 1995). The difference of two designs is then three times as accurate as with separate runs. A
smoothing spline through all trials averages the fine structure that is left, separately for the risk and for
each limited quantity (see `tpd.design.trend`). The next designs are those of smallest trend within the
limits, at a distance from all earlier ones (R. G. Regis and C. A. Shoemaker, INFORMS J. Computing 19, 2007;
for expensive limits R. G. Regis, Comput. Oper. Res. 38, 2011).

Trial runs are few, and of the linear equations. The best designs are therefore compared by more runs of the
nonlinear equations, which neither the trials nor the validation use. They also show by how much the trends of
the limited quantities are wrong, and the next designs allow for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tpd.answers.paired import REST_LOSS
from tpd.answers.run_table import Runs
from tpd.core.progress import Progress
from tpd.design.problem import Problem
from tpd.design.trend import Trend, fit, least_values
from tpd.design.trials import Trials
from tpd.theory.equations import Terms

_BATCH = 8
"""Number of designs of a round: the trends are fitted again after each round."""
_DISTANCES = 0.05, 0.02
"""Smallest distances of a new design from all others, as relative changes: usually, and at the end."""
_SPREAD_PROPOSALS, _LOCAL_PROPOSALS, _BEST_COUNT = 1500, 1500, 12
"""Numbers of proposed designs anywhere in the space and near the best designs, and number of these."""
_WIDTHS = 0.02, 0.5
"""Smallest and largest relative change of a proposal near a good design."""
_CHUNK, _MOST_PROPOSALS = 32, 320
"""Number of proposals whose limits without runs are computed together, and largest number of a round."""
_COUNTS, _COMPARISONS = (1, 2), 4
"""Numbers of designs of the first comparison, which corrects the trends, and of later ones; and largest
number of comparisons."""
_NOISE = 0.005
"""Accuracy of the logarithm of a limited quantity in a comparison. A design that exceeds a limit by less may
well keep it."""
_MOST_EXCESS = 0.05
"""Largest excess of a trial over a limit, according to the trends and in the logarithm, at which it may still
be compared."""
_INCREMENT = 0.01
"""Increase of the distance from the limits from one comparison to the next, in the logarithm."""
_LEAST_RUNS = 4
"""Smallest number of standing runs that determine a limited quantity."""
_RESTS, _LEAST_RESTS = "fewer_runs_at_rest", 0.01
"""Name of the limit on the decrease of the runs at rest, and share of runs at rest without a pendulum below
which they are not compared."""
_TILT = 0.25
"""Weight of the mean tilt if the share of overturned runs must fall. The share alone would need more runs."""
_SIZES = 1e-6, 1e3
"""Smallest and largest limited quantity over its limit. A run whose quantity is unknown has the largest."""


@dataclass(frozen=True)
class Comparison:
    """Design that was compared by runs of the nonlinear equations."""

    design: np.ndarray
    """(mu, lam, zeta)."""
    merit: float
    """Merit of its runs."""
    sizes: dict[str, float]
    """Logarithms of the limited quantities over their limits, by name."""


@dataclass
class Refinement:
    """Trials of a problem so far, with the trends through them."""

    problem: Problem
    progress: Progress
    total: int
    """Planned number of trials, for the progress."""
    designs: list[np.ndarray] = field(default_factory=list)
    """Designs (mu, lam, zeta) of the trials, each (3,)."""
    runs: list[Runs] = field(default_factory=list)
    """Runs of each trial."""
    sizes: list[dict[str, float]] = field(default_factory=list)
    """Logarithms of the limited quantities of each trial over their limits, by name."""
    fixed: dict[str, np.ndarray] = field(default_factory=dict)
    """Limited quantities of the trials that need no run, over their limits, by name, (m,)."""
    comparisons: list[Comparison] = field(default_factory=list)
    """Designs that were compared by runs of the nonlinear equations."""
    merit: Trend | None = None
    """Trend of the merit, which orders the designs."""
    limits: dict[str, Trend] = field(default_factory=dict)
    """Trend of each limited quantity, by name: negative where the limit is kept."""
    allowance: dict[str, float] = field(default_factory=dict)
    """Amount by which the logarithm of a limited quantity must stay further below zero, by name, after the
    validation has shown that a design exceeds the limit."""

    def __post_init__(self) -> None:
        self._seed, self._turn = self.problem.run_seed(1, 0), 0
        # The runs without a pendulum are the reference of every trial.
        runs = self.problem.trial_runs(None, self._seed)
        self.without, self._rests = runs, float(runs.share_at_rest.value)
        # The search reduces what the verdict compares.
        self._tilt = 1.0 if self.problem.reduces(runs) == "tilt" else _TILT

    def at(self, designs: np.ndarray | list[np.ndarray]) -> np.ndarray:
        """Return designs (m, 3) in the coordinates of the trends, (m, d)."""
        return self.problem.space.logarithms(np.asarray(designs))

    @property
    def possible(self) -> np.ndarray:
        """Whether each trial keeps the limits that need no run, (m,)."""
        return np.all([np.ones(len(self.designs)), *(x <= 1.0 for x in self.fixed.values())], axis=0)

    search: None = None
    """A refinement has no descents."""

    def merit_of(self, runs: Runs) -> float:
        """Return the merit of a design from its runs: the risk, or mostly the share of overturned runs if
        this must fall. It is NaN if no run has a result."""
        severity = self._tilt * runs.severity + (1.0 - self._tilt) * runs.is_overturned
        severity = severity[~runs.is_unanswered]
        return self.problem.risk_of(severity) if len(severity) else np.nan

    def evaluate(self, designs: np.ndarray) -> None:
        """Simulate the trial runs of designs (m, 3), and fit the trends again."""
        for name, x in self.problem.fixed_sizes(designs).items():
            self.fixed[name] = np.append(self.fixed.get(name, []), x)
        # The comparisons add trials to the planned ones.
        self.total = max(self.total, len(self.runs) + len(designs))
        for design in designs:
            self.progress("trial runs", len(self.runs) + 1, self.total)
            runs = self.problem.trial_runs(design, self._seed)
            self.designs.append(design)
            self.runs.append(runs)
            self.sizes.append(self._sizes_of(design, runs, self._rests))
        self.fit()

    def _sizes_of(self, design: np.ndarray, runs: Runs, rests: float) -> dict[str, float]:
        """Return the logarithm of every limited quantity over its limit that only the safe share of the
        allowed excesses exceeds, by name; NaN if too few runs stand."""
        level, spare = self.problem.safe_level, np.log1p(-self.problem.spare)
        out = dict[str, float]()
        for name, x in self.problem.sizes_in_runs(design, runs).items():
            # Sizes are positive and cover decades, so that their logarithms are smooth functions.
            x = np.log(np.clip(np.nan_to_num(x, nan=_SIZES[1]), *_SIZES))
            out[name] = float(np.quantile(x, level) - spare) if len(x) >= _LEAST_RUNS else np.nan
        if rests > _LEAST_RESTS:
            out[_RESTS] = (1.0 - REST_LOSS) * rests - float(runs.share_at_rest.value)
        return out

    def fit(self) -> None:
        """Fit the trends to all trials that have a result."""
        self.merit = self._trend_of([self.merit_of(runs) for runs in self.runs])
        trends = {name: self._trend_of([s[name] for s in self.sizes]) for name in self.sizes[0]}
        # A quantity with too few values for a trend is not known to keep its limit.
        self._unknown = None in trends.values()
        self.limits = {name: trend for name, trend in trends.items() if trend is not None}

    def _trend_of(self, values: Sequence[float]) -> Trend | None:
        """Return the trend of a value of each trial; None if too few of them have a value."""
        x, at = np.array(values), self.at(self.designs)
        rows = np.flatnonzero(np.isfinite(x))
        return fit(at[rows], x[rows]) if len(rows) >= least_values(at.shape[1]) else None

    def excess(self, designs: np.ndarray | list[np.ndarray]) -> np.ndarray:
        """Return the largest logarithm of a limited quantity over its limit, (m,), according to the trends.

        It is not positive if a design keeps all limits that need runs, and infinite if one is unknown.
        """
        x = self.at(designs)
        if self._unknown:
            return np.full(len(x), np.inf)
        excess = [trend.at(x)[0] + self._shift(name) for name, trend in self.limits.items()]
        return np.max([np.full(len(x), -np.inf), *excess], axis=0)

    def _shift(self, name: str) -> float:
        """Return the amount to add to the trend of a limited quantity: by how much the runs of the
        comparisons exceed the trend, and the allowance."""
        allowance, others = self.allowance.get(name, 0.0), [c for c in self.comparisons if name in c.sizes]
        # Without a comparison the trend of the linear equations is the best estimate.
        size = np.array([c.sizes[name] for c in others])
        if not np.isfinite(size).any():
            return allowance
        trend = self.limits[name].at(self.at([c.design for c in others]))[0]
        return allowance + float(np.nanmean(size - trend))

    def _score(self, designs: np.ndarray | list[np.ndarray], inside: float = 0.0) -> np.ndarray:
        """Return numbers that order designs: those within the limits by their trend, then the others by their
        excess. `inside` is the distance that they must keep from the limits."""
        excess = self.excess(designs) + inside
        assert self.merit is not None
        trend = self.merit.at(self.at(designs))[0]
        return np.where(excess <= 0.0, trend, _SIZES[1] + excess)

    def order(self) -> np.ndarray:
        """Return the order of the trials: designs that keep the limits first, then by trend."""
        if self.merit is None:
            return np.arange(len(self.designs))
        # Trials of impossible designs exist only if too few others were drawn.
        score = self._score(self.designs) + np.where(self.possible, 0.0, 1e6)
        unanswered = [runs.is_unanswered.all() for runs in self.runs]
        return np.argsort(np.where(unanswered, np.inf, score), kind="stable")

    def next(self, count: int, apart: float, inside: float = 0.0) -> np.ndarray:
        """Return designs (m, 3) of smallest trend for the next trials, at most `count`, at a distance `apart`
        from each other and from all earlier ones, and `inside` from the limits."""
        space, self._turn = self.problem.space, self._turn + 1
        rng = np.random.default_rng([self.problem.seed, 12, self._turn])
        if self.merit is None:
            return space.sample(rng, count)
        chosen, seen, x = np.empty((0, 3)), self.at(self.designs), self._proposals(rng)
        # Many proposals lie on a bound, next to earlier designs. They must not displace the others.
        x = x[np.linalg.norm(self.at(x)[:, None] - seen, axis=-1).min(axis=1) > apart]
        if not len(x):
            return chosen
        x = x[np.argsort(self._score(x, inside), kind="stable")[:_MOST_PROPOSALS]]
        # Limits that need no run are cheap to check, but not for thousands of proposals.
        for some in np.split(x, range(_CHUNK, len(x), _CHUNK)):
            for design in some[self.problem.possible(some)]:
                here = self.at(design[None])
                if len(chosen) < count and np.linalg.norm(seen - here, axis=1).min() > apart:
                    chosen, seen = np.concatenate([chosen, design[None]]), np.concatenate([seen, here])
            if len(chosen) == count:
                break
        return chosen

    def _proposals(self, rng: np.random.Generator) -> np.ndarray:
        """Draw designs (m, 3) that are compared by their trend: anywhere in the space, and near the best
        trials."""
        space, best = self.problem.space, np.array(self.designs)[self.order()[:_BEST_COUNT]]
        low, high = space.logarithms(space.ends)
        # All widths, because the distance of the best designs is not known in advance. Along the difference
        # of two good designs a proposal follows the limits, between which the best designs often lie.
        start, i, j = self.at(best)[rng.integers(len(best), size=(3, _LOCAL_PROPOSALS))]
        narrow, wide = np.log(_WIDTHS)
        width = np.exp(rng.uniform(narrow, wide, (_LOCAL_PROPOSALS, 1)))
        along = rng.normal(size=(_LOCAL_PROPOSALS, 1)) * (i - j) * (rng.random((_LOCAL_PROPOSALS, 1)) < 0.5)
        near = start + along + width * rng.normal(size=start.shape)
        shares = (np.clip(near, low, high) - low) / (high - low)
        return space.unscaled(np.concatenate([shares, rng.random((_SPREAD_PROPOSALS, len(low)))]))

    def best(self, rejected: Sequence[np.ndarray]) -> np.ndarray | None:
        """Return the best design (3,) by comparisons of the nonlinear equations, apart from designs that the
        validation rejected; None if no design is likely to keep the limits."""
        # The first comparison only corrects the trends, before which the choice would be one of chance. After
        # a rejection they are corrected already.
        apart = list[Comparison]()
        for turn in range(len(rejected) > 0, _COMPARISONS):
            # The comparisons show by how much the trends of the limits are wrong. If that is not enough,
            # designs further inside follow. Otherwise only trials far away would keep the limits.
            if turn and len(new := self.next(_BATCH, _DISTANCES[1], (turn - 1) * _INCREMENT)):
                self.evaluate(new)
            for design in self._pool([*rejected, *(c.design for c in self.comparisons)])[: _COUNTS[turn > 0]]:
                self.progress("comparing", done := len(self.comparisons) + 1, max(done, sum(_COUNTS)))
                self.compare(design)
            apart = [c for c in self.comparisons if self._is_apart(c.design, rejected)]
            kept = [c for c in apart if self._excess_of(c) <= _NOISE]
            if kept and turn:
                return min(kept, key=lambda c: c.merit).design
        # A design that exceeds a limit by more is no pendulum that the validation should call a danger.
        every = [c for c in apart if self._excess_of(c) <= _MOST_EXCESS]
        return min(every, key=self._excess_of).design if every else None

    def compare(self, design: np.ndarray) -> None:
        """Simulate runs of the nonlinear equations of a design, the same for all designs."""
        runs = self.problem.trial_runs(design, self.problem.run_seed(3, 0), Terms.nonlinear.value)
        # The rests are compared by the linear equations only, which have the same runs without a pendulum.
        sizes = self._sizes_of(design, runs, 0.0)
        self.comparisons.append(Comparison(design, self.merit_of(runs), sizes))

    def _excess_of(self, c: Comparison) -> float:
        """Return the largest logarithm of a limited quantity over its limit in the runs of a comparison."""
        excess = [x + self.allowance.get(name, 0.0) for name, x in c.sizes.items()]
        return float(np.max(np.nan_to_num([-np.inf, *excess], nan=np.inf)))

    def _pool(self, others: Sequence[np.ndarray]) -> np.ndarray:
        """Return the trials (m, 3) that keep the limits, best first, apart from each other and from other
        designs. If there is none, the trials count that according to the trends exceed a limit a little: a
        comparison is more accurate."""
        trials = self.trials()
        chosen, rows = list(others), trials.feasible
        if not rows.any():
            nearly = self.possible & (self.excess(self.designs) <= _MOST_EXCESS)
            rows = nearly[self.order()] & np.isfinite(trials.value)
        for design in trials.designs[rows]:
            if self._is_apart(design, chosen):
                chosen.append(design)
        return np.array(chosen[len(others) :]).reshape(-1, 3)

    def _is_apart(self, design: np.ndarray, others: Sequence[np.ndarray]) -> bool:
        """Return whether a design has a distance from all other designs."""
        distances = self.at(np.array(others).reshape(-1, 3)) - self.at(design)
        return bool(np.all(np.linalg.norm(distances, axis=1) > _DISTANCES[1]))

    def learn(self, design: np.ndarray, runs: Runs) -> None:
        """Learn from the validation runs of a rejected design by how much the comparisons underestimate the
        limited quantities."""
        for name, x in self._sizes_of(design, runs, 0.0).items():
            # The whole excess counts: another rejection would cost more than a design further inside.
            if x > 0.0:
                self.allowance[name] = self.allowance.get(name, 0.0) + x

    def equivalent(self, design: np.ndarray) -> np.ndarray | None:
        """Return the smallest and the largest designs, (2, 3), that perform as well as one design within the
        accuracy of the trials.

        Their trend exceeds the trend of the design by at most two standard deviations, and they keep the
        limits.
        """
        if self.merit is None:
            return None
        trend, deviation = (float(v[0]) for v in self.merit.at(self.at(design[None])))
        x = self._proposals(np.random.default_rng([self.problem.seed, 14]))
        # Two standard deviations: the trials cannot distinguish such designs.
        good = x[(self.merit.at(self.at(x))[0] <= trend + 2.0 * deviation) & (self.excess(x) <= 0.0)]
        # The design itself comes first, and it may be the only one.
        good = np.concatenate([design[None], good])
        equivalent = good[self.problem.possible(good) | (np.arange(len(good)) == 0)]
        return np.stack([equivalent.min(axis=0), equivalent.max(axis=0)])

    def trials(self) -> Trials:
        """Return all trials as a table, best first."""
        designs, limited = np.array(self.designs), dict[str, np.ndarray]()
        # If no trend could be fitted, only the validation can show whether a design keeps the limits.
        feasible = self.possible & ((self.excess(designs) <= 0.0) | (self.merit is None))
        for name, fixed in self.fixed.items():
            # The comparisons show by how much trials underestimate a quantity.
            more = self._shift(name) if name in self.limits else 0.0
            by_runs = [(1.0 - self.problem.spare) * np.exp(s.get(name, -np.inf) + more) for s in self.sizes]
            limited[name] = np.maximum(fixed, by_runs)
            feasible &= np.isfinite(limited[name]) | (self.merit is None)
        value = np.array([self.problem.value_of(runs) for runs in self.runs])
        risk = self._trend_of(value.tolist())
        trend = np.full(len(designs), np.nan) if risk is None else risk.at(self.at(designs))[0]
        more = {"designs": designs, "value": value, "trend": trend, "feasible": feasible, "risk": risk}
        # A spline with a constant added to all values is the spline plus this constant.
        limits = {n: replace(t, values=t.values + self._shift(n)) for n, t in self.limits.items()}
        without = self.problem.value_of(self.without)
        return Trials.of(self.order(), self.runs, limited, without_pendulum=without, limits=limits, **more)


def refine(problem: Problem, candidates: np.ndarray, further: int, progress: Progress) -> Refinement:
    """Evaluate candidates (m, 3) of a problem by trial runs, then `further` designs of small trend."""
    total = len(candidates) + further
    refinement = Refinement(problem, progress, total)
    refinement.evaluate(candidates)
    while (more := total - len(refinement.designs)) > 0:
        designs = refinement.next(min(more, _BATCH), _DISTANCES[more <= _BATCH])
        if not len(designs):
            break
        refinement.evaluate(designs)
    return refinement
