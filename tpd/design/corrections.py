"""Correct the limits of the descents by runs, under harmonic excitation.

Descents know settled orbits. Runs begin at rest or after a disturbance, and their bob swings further. Before
the descents, cheap runs of designs all over the space show how the angles of runs depend on the design
(`tpd.design.angle_factors`). After them, accurate runs of the best design correct this relation, and the
descents continue from there. A few corrections suffice, because the relation has few numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tpd.answers.paired import FEWER
from tpd.answers.run_table import Runs
from tpd.core.progress import Progress
from tpd.design.angle_factors import AngleFactors, PowerLaw
from tpd.design.orbits import Orbits, SmoothedOrbits
from tpd.design.problem import Problem
from tpd.design.search import Ends, Search, best_apart, descend, merit_of, polish, search
from tpd.design.settings import Descent
from tpd.design.sizes import evaluate_sizes
from tpd.design.trials import Trials
from tpd.limits import STILL, Limit
from tpd.models.smoothed import Smoothed
from tpd.theory.equations import Terms

_SPREAD, _DRAWN = 24, 512
"""Number of designs all over the space with cheap runs, and number of drawn designs from which they come."""
_CHEAP = 0.98
"""Share of the cheap runs whose angles stay below the one that counts. A larger one would need more runs."""
_GRID = np.linspace(-2.0, 2.5, 91)
"""Logarithms of the factors for which the limited quantities of orbits are computed."""
_NO_SLOPE = np.zeros((len(_GRID), 1, 3))
"""Derivatives of these factors, which do not depend on the design."""
_PRIOR = np.array([1.0, 0.5, 0.5, 0.5])
"""Standard deviations of the power law before any run."""
_ROUGH = 0.15
"""Standard deviation of the logarithm of a factor in cheap runs."""
_KEPT = 0.001
"""Logarithm of a limited quantity over its limit in accurate runs that still keeps the limit."""
_NEAR = 0.05
"""Largest logarithm of a limited quantity over its limit with which a design is still validated."""
_CLOSE = 0.02
"""Distance from the limits, in the logarithm, below which no further correction is worth its time."""
_SAME = 1e-3
"""Largest distance of equal designs, in shares of the bounds."""
_HALF_A_POINT = 0.005
"""Difference of the measure between designs that perform equally well."""
_CONTINUED, _STEPS = 2, 15
"""Numbers of descents that continue after a correction, and of their steps on the smoothed model."""
_FEWEST = 4
"""Smallest number of surviving runs for a limited quantity, and of designs for a line through values."""
_LEAST, _UNKNOWN = 1e-12, 1e3
"""Smallest quantity over its limit that has a logarithm, and quantity of a run in which it is unknown."""
_FEW_RESTS = 0.01
"""Share of runs at rest without a pendulum below which they are not compared."""
_NEIGHBOURS = 1500
"""Number of designs that are compared with the best one."""


@dataclass
class Corrections:
    """Descents of a problem with limits that runs correct."""

    problem: Problem
    orbits: Orbits
    """Orbits under all conditions."""
    searched: Orbits
    """Orbits under the conditions of the descents."""
    method: Descent
    """Settings with the model of the descents."""
    progress: Progress
    guess: np.ndarray | None
    """First guess (3,), from which a descent starts."""
    designs: list[np.ndarray] = field(default_factory=list)
    """Designs (mu, lam, zeta) with runs, each (3,)."""
    runs: list[Runs] = field(default_factory=list)
    """Runs of each of these designs."""
    accurate: list[int] = field(default_factory=list)
    """Indices of the designs with accurate runs, in the order of the corrections."""
    more: dict[str, float] = field(default_factory=dict)
    """Factors on limited quantities that angles do not change, by limit."""
    kept_margin: float = 0.0
    """Share of the uplift margin without a pendulum that a pendulum must leave. The block then comes to rest
    in as many runs."""
    margin: dict[str, float] = field(default_factory=dict)
    """Amounts by which logarithms of limited quantities must stay further below zero, by limit, after a
    validation has shown that a design exceeds the limit."""

    def __post_init__(self) -> None:
        problem, seed = self.problem, self.problem.run_seed(1, 0)
        self.limits = tuple(limit for limit in problem.run_limits if limit.name not in STILL)
        self.without, self._resting = problem.trial_runs(None, seed), None
        self.laws = self._cheap_laws(seed)
        # The first descents already know from cheap runs how far the bob swings.
        corrected, every = self._corrected(self.searched), len(self.orbits.conditions)
        self._search = search(corrected, self.method, problem.seed, self.progress, self.guess)
        if (count := len(self.searched.conditions)) < every:
            description = f"{self._search.description} under {count} of the {every} conditions"
            self._search = replace(self._search, description=description)

    @property
    def search(self) -> Search:
        """History of the descents and of the corrections."""
        # The factors after the last correction draw the limits in the picture of the search.
        designs = np.array([self.designs[i] for i in self.accurate]).reshape(-1, 3)
        angles = self._corrected(self.searched).angles
        return replace(self._search, angles=angles, corrected=designs)

    def _corrected(self, orbits: Orbits) -> Orbits:
        """Return orbits with the limits as they are corrected now."""
        factors, least = AngleFactors(dict(self.laws), dict(self.more)), None
        if self.kept_margin > 0.0:
            # Where the block can stay at rest without a pendulum, a share of its margin must be left.
            (margin,) = orbits.margins(orbits.massless)
            least = np.where(margin > 0.0, self.kept_margin * margin, -np.inf)
        return replace(orbits, angles=factors, least_margins=least)

    def _cheap_laws(self, seed: int) -> dict[str, PowerLaw]:
        """Return the power law of each limit from cheap runs of designs all over the space."""
        problem, rng = self.problem, np.random.default_rng([self.problem.seed, 9])
        drawn = problem.space.sample(rng, _DRAWN)
        # Designs that exceed a limit even at rest or on their orbit come last.
        drawn = drawn[np.argsort(~problem.possible(drawn), kind="stable")[:_SPREAD]]
        # The first guess is often near the best design.
        if self.guess is not None:
            drawn = np.concatenate([self.guess[None], drawn])
        for i, design in enumerate(drawn):
            self.progress("trial runs", i + 1, len(drawn))
            self.designs.append(design)
            self.runs.append(problem.trial_runs(design, seed))
        # Before any run a factor of one is likely, and its exponents are moderate.
        laws, before = {}, PowerLaw(np.zeros(4), np.diag(_PRIOR**2))
        for limit in self.limits:
            # All designs count, also those that exceed a limit: the relation is about angles.
            every = (self._logarithm(limit, *pair, _CHEAP) for pair in zip(drawn, self.runs, strict=True))
            logarithms = np.array(list(every))
            rows = np.isfinite(logarithms)
            laws[limit.name] = before.with_values(drawn[rows], logarithms[rows], _ROUGH)
        return laws

    def _logarithm(self, limit: Limit, design: np.ndarray, runs: Runs, share: float) -> float:
        """Return the logarithm of the factor on the angles of the orbit with which its limited quantity is
        the one of `_size`; NaN if there is none."""
        size = self._size(limit, design, runs, share)
        e = self.orbits.evaluate(design[None])
        if not (np.isfinite(size) and e.attracts.all()):
            return np.nan
        many, factors = e.at([0] * len(_GRID)), np.exp(_GRID)[:, None]
        of_orbits = evaluate_sizes([limit], many, self.problem.geometry, factors=(factors, _NO_SLOPE))
        values = np.max([s.value.max(axis=1) for s in of_orbits if s.name not in STILL], axis=0)
        values = np.log(np.maximum(values, _LEAST))
        # A quantity may not depend on the angles, and very large angles need not exist.
        if np.any(np.diff(values) < 0.0) or not values[0] < size < values[-1]:
            return np.nan
        return float(np.interp(size, values, _GRID))

    def _size(self, limit: Limit, design: np.ndarray, runs: Runs, share: float) -> float:
        """Return the logarithm of a limited quantity over its limit that a share of the runs keeps, plus the
        margin of the limit; NaN if the block survives in too few runs."""
        sizes = self.problem.sizes_in_runs(design, runs, (limit,))
        x = np.max([x for name, x in sizes.items() if name not in STILL], axis=0)
        if len(x) < _FEWEST:
            return np.nan
        size = np.quantile(np.nan_to_num(x, nan=_UNKNOWN, posinf=_UNKNOWN), share)
        return float(np.log(np.maximum(size, _LEAST))) + self.margin.get(limit.name, 0.0)

    def _excess(self, i: int) -> float:
        """Return the largest logarithm of a limited quantity over its limit in the runs of a design; infinite
        if the block survives in too few runs."""
        share = self.problem.safe_level
        sizes = [self._size(limit, self.designs[i], self.runs[i], share) for limit in self.limits]
        # A block that comes to rest in too few runs exceeds no limit, but the validation would reject it.
        sizes += [_NEAR] * self._rests_less(self.runs[i])
        return np.inf if np.isnan(sizes).any() else max(sizes, default=-np.inf)

    def _rests_less(self, runs: Runs) -> bool:
        """Return whether the block ends at rest in too few accurate runs."""
        if self.without.share_at_rest.value <= _FEW_RESTS:
            return False
        # Both shares must be of the same equations, and the runs without a pendulum are needed once.
        if self._resting is None:
            seed, equations = self.problem.run_seed(3, 0), Terms.nonlinear.value
            self._resting = float(self.problem.trial_runs(None, seed, equations).share_at_rest.value)
        # Half of the allowed decrease remains for chance in the validation.
        return runs.share_at_rest.value < (1.0 - 0.5 * FEWER) * self._resting

    def best(self, rejected: Sequence[np.ndarray]) -> np.ndarray | None:
        """Return the best design (3,) that keeps the limits in accurate runs, apart from designs that the
        validation rejected; None if there is none."""
        space = self.problem.space
        x = space.scaled(self._search.ends[self._search.order] if not rejected else rejected[-1][None])
        earlier, before = len(self.accurate), None
        for turn in range(self.method.corrections + 1):
            orbits = self._corrected(self.searched)
            if turn or rejected:
                ends = self._continue(orbits, x)
                x = ends.x[np.argsort(ends.merit, kind="stable")[:_CONTINUED]]
            design = space.unscaled(x[0])
            # Far inside the limits of the runs the design is as good as possible if no such limit holds it.
            is_held = np.any(replace(orbits, limits=self.limits).at(x[:1]).limit > -_CLOSE)
            excess = self._run(design)
            self.progress("correcting", turn + 1, self.method.corrections + 1)
            is_done = excess <= _KEPT and (excess >= -_CLOSE or not is_held)
            # Nothing can be learnt from runs in which the block does not survive, or from the same design
            # again.
            is_stuck = before is not None and np.abs(x[0] - before).max() < _SAME
            if is_done or is_stuck or excess == np.inf:
                break
            before = x[0]
        kept = np.array([self.designs[i] for i in self.accurate[earlier:] if self._excess(i) <= _KEPT])
        # Corrections at one design can mislead about designs far away, of which some have cheap runs.
        if (trial := self._better_trial(kept.reshape(-1, 3), rejected)) is not None:
            self._run(trial)
        excess = {i: self._excess(i) for i in self.accurate[earlier:]}
        kept = [i for i, x in excess.items() if x <= _KEPT]
        if not kept:
            nearest = min(excess, key=lambda i: excess[i])
            # A design that exceeds a limit by more is no pendulum that the validation should call a danger.
            return self.designs[nearest] if excess[nearest] <= _NEAR else None
        designs = np.array([self.designs[i] for i in kept])
        return designs[np.argmin(self.orbits.value(self.orbits.evaluate(designs)))]

    def _better_trial(self, kept: np.ndarray, rejected: Sequence[np.ndarray]) -> np.ndarray | None:
        """Return the design that keeps the limits in its cheap runs and has the least objective, if its
        objective is less than those of the designs (m, 3) that were kept; None if there is none."""
        # Accurate runs have decided about their designs already.
        cheap = [i for i in range(len(self.designs)) if i not in self.accurate]
        designs = np.array([self.designs[i] for i in cheap])
        pairs = [(limit, self.designs[i], self.runs[i]) for i in cheap for limit in self.limits]
        # Without a limit of runs every trial keeps all of them.
        sizes = np.reshape([self._size(*pair, _CHEAP) for pair in pairs], (len(cheap), -1))
        value = self.orbits.value(self.orbits.evaluate(designs))
        keeps = self.problem.possible(designs) & np.all(sizes <= 0.0, axis=1)
        keeps &= [not any(np.array_equal(design, x) for x in rejected) for design in designs]
        value = np.where(keeps & np.isfinite(value), value, np.inf)
        best = self.orbits.value(self.orbits.evaluate(kept)) if len(kept) else np.empty(0)
        return designs[np.argmin(value)] if value.min() < np.min(best, initial=np.inf) else None

    def _continue(self, orbits: Orbits, x: np.ndarray) -> Ends:
        """Continue descents from designs in shares of the bounds, (m, d), under corrected limits.

        Corrected limits may favour another valley. The best screened designs under them are starts as well.
        """
        screened, risk = self._search.screened, orbits.risk
        at = orbits.linearised(orbits.evaluate(screened))
        units = orbits.space.scaled(screened)
        x = np.concatenate([x, units[best_apart(units, merit_of(at, risk.of), _CONTINUED)]])
        e = orbits.evaluate(orbits.space.unscaled(x))
        at, evaluate = orbits.linearised(e), orbits.at
        # Corrected descents have the gradients of the first ones, by default those of the smoothed model.
        if isinstance(self.method.model, Smoothed):
            evaluate = SmoothedOrbits(orbits, self.method.model, e).at
        cap, risk = orbits.risk.cap(len(orbits.conditions)), orbits.risk.of
        ends = descend(self.method.optimiser, evaluate, x, at, cap, risk, steps=_STEPS)
        return polish(orbits, ends.x, orbits.at(ends.x), self.method.polish)

    def _run(self, design: np.ndarray) -> float:
        """Simulate accurate runs of a design, correct the laws of its limits, and return its excess."""
        runs = self.problem.trial_runs(design, self.problem.run_seed(3, 0), Terms.nonlinear.value)
        # The same runs for all designs: their difference is then more accurate than each of them.
        self.accurate.append(len(self.designs))
        self.designs.append(design)
        self.runs.append(runs)
        for limit in self.limits:
            self._correct(limit, design, runs)
        if self._rests_less(runs):
            # Each time the pendulum has to leave half of what is missing of the margin without it.
            self.kept_margin = 0.5 * (1.0 + self.kept_margin)
        return self._excess(self.accurate[-1])

    def _correct(self, limit: Limit, design: np.ndarray, runs: Runs) -> None:
        """Correct the law of a limit by accurate runs of a design."""
        share = self.problem.safe_level
        x = self._logarithm(limit, design, runs, share)
        # Near the design the law then gives exactly what the runs have shown.
        if np.isfinite(x):
            self.laws[limit.name] = self.laws[limit.name].corrected(design, x)
            return
        # No factor on the angles gives the quantity of the runs, for example if it is the length of the rod.
        sizes = evaluate_sizes([limit], self.orbits.evaluate(design[None]), self.problem.geometry)
        of_orbit = np.max([size.value for size in sizes if size.name not in STILL])
        size = self._size(limit, design, runs, share)
        if np.isfinite(size) and 0.0 < of_orbit < np.inf:
            self.more[limit.name] = float(np.exp(max(size - np.log(of_orbit), 0.0)))

    def learn(self, design: np.ndarray, runs: Runs) -> None:
        """Learn from the validation runs of a rejected design by how much accurate runs underestimate the
        limited quantities."""
        share = self.problem.safe_level
        # The best of several designs need not be the last one.
        i = max(i for i in self.accurate if np.array_equal(self.designs[i], design))
        for limit in self.limits:
            before = self.margin.get(limit.name, 0.0)
            x = self._size(limit, design, runs, share) - before
            # The whole excess counts: another rejection would cost more than a design further inside.
            if x > 0.0:
                self.margin[limit.name] = before + x
                self._correct(limit, design, self.runs[i])

    def equivalent(self, design: np.ndarray) -> np.ndarray | None:
        """Return the smallest and the largest designs, (2, 3), that are expected to perform as well as one
        design, within half a point of the measure.

        The objective orders designs. How much of the measure a difference of the objective means follows from
        a line through the trials.
        """
        problem, orbits = self.problem, self._corrected(self.orbits)
        e = orbits.evaluate(np.array(self.designs))
        values = orbits.value(e)
        falls = problem.reduces(self.without) != "tilt"
        measured = [x.share_overturned.value if falls else problem.value_of(x) for x in self.runs]
        # Values of rest, and of designs without an attracting motion, are none of the objective.
        rows = np.isfinite(measured) & e.attracts.all(axis=1) & (values > 0.0)
        if rows.sum() < _FEWEST:
            return None
        steepness = np.polyfit(values[rows], np.array(measured)[rows], 1)[0]
        # Where the objective explains less than that among all trials, the line has no meaning.
        if steepness * np.ptp(values[rows]) <= _HALF_A_POINT:
            return None
        # Neighbours within a factor of about 1.3 cover the flat top of the optimum.
        low, high = problem.space.logarithms(problem.space.ends)
        rng, at = np.random.default_rng([problem.seed, 14]), problem.space.logarithms(design[None])
        near = np.clip(at + 0.25 * rng.normal(size=(_NEIGHBOURS, len(low))), low, high)
        x = np.concatenate([design[None], problem.space.unscaled((near - low) / (high - low))])
        e = orbits.evaluate(x)
        keeps = np.all(orbits.constraints(e)[0] <= _CLOSE, axis=1)
        good = keeps & (orbits.value(e) <= orbits.value(e)[0] + _HALF_A_POINT / steepness)
        good[0] = True
        return np.stack([x[good].min(axis=0), x[good].max(axis=0)])

    def wider_bounds(self, design: np.ndarray) -> tuple[()]:
        """Return nothing: the gradient at a bound shows its effect."""
        return ()

    def promises(self, share: float) -> bool:
        """Return whether another design can be expected to have enough benefit: yes if there is one."""
        return True

    def trials(self) -> Trials:
        """Return all designs with runs as a table, the last corrected design first."""
        problem = self.problem
        designs = np.array(self.designs)
        fixed = problem.fixed_sizes(designs)
        columns = dict(fixed)
        for limit in self.limits:
            share = [problem.safe_level if i in self.accurate else _CHEAP for i in range(len(designs))]
            by_runs = [self._size(limit, *each) for each in zip(designs, self.runs, share, strict=True)]
            # Without surviving runs the quantity is unknown, and the design does not keep the limit.
            columns[limit.name] = np.maximum(columns[limit.name], np.exp(by_runs))
        sizes = np.column_stack([np.empty((len(designs), 0)), *columns.values()])
        value = np.array([problem.value_of(runs) for runs in self.runs])
        counts = [(r.is_overturned.sum(), r.is_unanswered.sum(), len(r.outcome)) for r in self.runs]
        overturned, unanswered, runs = np.array(counts, dtype=float).T
        feasible = np.all(sizes <= 1.0 + _KEPT, axis=1)
        # The last correction is the best estimate, so it comes first among those that keep the limits.
        order = np.lexsort((np.arange(len(designs))[::-1], ~feasible))
        return Trials(
            designs=designs[order],
            value=value[order],
            trend=value[order],
            names=tuple(columns),
            sizes=sizes[order],
            overturned=(overturned / np.maximum(runs - unanswered, 1.0))[order],
            undecided=unanswered.astype(int)[order],
            feasible=feasible[order],
            without_pendulum=problem.value_of(self.without),
            risk=None,
        )
