"""Correct the limits of the descents by runs, under harmonic excitation.

Descents know settled orbits. Runs begin at rest or after a disturbance, and their bob swings further. Before
the descents, cheap runs of designs all over the space show by which factor the limited quantities of runs
exceed those of orbits (`tpd.design.power_law`). After them, accurate runs of the best design correct these
factors, and the descents continue from there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tpd.answers.run_table import Runs
from tpd.core.progress import Progress
from tpd.design.orbits import Orbits
from tpd.design.power_law import PowerLaw
from tpd.design.problem import Problem
from tpd.design.search import Search, best_apart, merit_of, polish, search
from tpd.design.settings import Descent
from tpd.design.sizes import evaluate_sizes
from tpd.design.trials import Trials
from tpd.theory.equations import Terms

_SPREAD, _DRAWS = 24, 512
"""Number of designs all over the space with cheap runs, and number of drawn designs from which they come."""
_QUANTILE = 0.98
"""Share of the cheap runs whose quantities stay below the one that counts. A larger one would need more
runs."""
_PRIOR = PowerLaw(np.zeros(4), np.diag([1.0, 0.5, 0.5, 0.5]) ** 2)
"""Power law of a factor before any run: a factor of one is likely, and its exponents are moderate."""
_CHEAP_NOISE, _NOISE = 0.15, 0.01
"""Standard deviations of the logarithm of a factor in cheap and in accurate runs."""
_TOLERANCE = 0.001
"""Logarithm of a limited quantity over its limit in accurate runs that still keeps the limit."""
_MOST_EXCESS = 0.05
"""Largest logarithm of a limited quantity over its limit with which a design is still validated."""
_LEAST_DISTANCE = 0.02
"""Distance from the limits, in the logarithm, below which no further correction is worth its time."""
_RESOLUTION = 1e-3
"""Largest distance of equal designs, in shares of the bounds."""
_HALF_A_POINT = 0.005
"""Difference of the measure between designs that perform equally well."""
_CONTINUATIONS = 2
"""Number of descents that continue after a correction, and of screened designs that join them."""
_LEAST_COUNT = 4
"""Smallest number of surviving runs for a limited quantity, and of designs for a line through values."""
_LEAST_SIZE, _UNKNOWN_SIZE = 1e-12, 1e3
"""Smallest quantity over its limit that has a logarithm, and quantity of a run in which it is unknown."""
_NEIGHBOURS = 500
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
    """Designs (mu, lam, zeta) with runs, each (3,): first those with cheap runs, then the corrections."""
    runs: list[Runs] = field(default_factory=list)
    """Runs of each of these designs."""
    allowance: dict[str, float] = field(default_factory=dict)
    """Amounts by which logarithms of limited quantities must stay further below zero, by name, after a
    validation has shown that a design exceeds the limit."""

    def __post_init__(self) -> None:
        problem, seed = self.problem, self.problem.run_seed(1, 0)
        self.without = problem.trial_runs(None, seed)
        drawn = problem.space.sample(np.random.default_rng([problem.seed, 9]), _DRAWS)
        # Designs that exceed a limit even at rest or on their orbit come last.
        drawn = drawn[np.argsort(~problem.possible(drawn), kind="stable")[:_SPREAD]]
        # The first guess is often near the best design.
        self.designs = [*([] if self.guess is None else [self.guess]), *drawn]
        self.cheap = len(self.designs)
        for i, design in enumerate(self.designs):
            self.progress("trial runs", i + 1, self.cheap)
            self.runs.append(problem.trial_runs(design, seed))
        # The first descents already know from cheap runs how far the bob swings.
        corrected, every = replace(self.searched, factors=self.laws), len(self.orbits.conditions)
        self._search = search(corrected, self.method, problem.seed, self.progress, self.guess)
        if (count := len(self.searched.conditions)) < every:
            description = f"{self._search.description} under {count} of the {every} conditions"
            self._search = replace(self._search, description=description)

    @property
    def search(self) -> Search:
        """History of the descents and of the corrections."""
        # The factors after the last correction draw the limits in the picture of the search.
        corrected = np.array(self.designs[self.cheap :]).reshape(-1, 3)
        return replace(self._search, factors=self.laws, corrected=corrected)

    @property
    def laws(self) -> dict[str, PowerLaw]:
        """Power law of the factor of each limited quantity, by name, from all runs."""
        designs, of_runs = np.array(self.designs), list(map(self._sizes, range(len(self.designs))))
        e = self.orbits.evaluate(designs)
        sizes = evaluate_sizes(self.problem.run_limits, e, self.problem.geometry)
        noise = np.where(np.arange(len(designs)) < self.cheap, _CHEAP_NOISE, _NOISE)
        laws = {}
        for name, x in ((s.name, s.value.max(axis=1)) for s in sizes if s.name in of_runs[0]):
            # All designs count, also those that exceed a limit. The settled quantity may be none.
            value = np.array([s[name] for s in of_runs]) - np.log(np.maximum(x, _LEAST_SIZE))
            rows = np.isfinite(value) & e.attracts.all(axis=1) & (x > 0.0)
            laws[name] = _PRIOR.with_values(designs[rows], value[rows], noise[rows])
        return laws

    def _sizes(self, i: int, runs: Runs | None = None) -> dict[str, float]:
        """Return the logarithm of every limited quantity over its limit that enough of the runs of a design
        keep, plus the allowance of the limit, by name; NaN if the block survives in too few runs."""
        share, out = _QUANTILE if i < self.cheap else self.problem.safe_level, {}
        for name, x in self.problem.sizes_in_runs(self.designs[i], runs or self.runs[i]).items():
            # An unknown quantity counts as far beyond its limit.
            x = np.nan_to_num(x, nan=_UNKNOWN_SIZE, posinf=_UNKNOWN_SIZE)
            size = np.quantile(x, share) if len(x) >= _LEAST_COUNT else np.nan
            out[name] = float(np.log(np.maximum(size, _LEAST_SIZE))) + self.allowance.get(name, 0.0)
        return out

    def _excess(self, i: int) -> float:
        """Return the largest logarithm of a limited quantity over its limit in the runs of a design; infinite
        if the block survives in too few runs."""
        sizes = list(self._sizes(i).values())
        return np.inf if np.isnan(sizes).any() else max(sizes, default=-np.inf)

    def best(self, rejected: Sequence[np.ndarray]) -> np.ndarray | None:
        """Return the best design (3,) that keeps the limits in accurate runs, apart from designs that the
        validation rejected; None if there is none."""
        space = self.problem.space
        x = space.scaled(self._search.ends[self._search.order] if not rejected else rejected[-1][None])
        begun, before = len(self.designs), None
        for turn in range(self.method.corrections + 1):
            if turn or rejected:
                x = self._continue(x)
            # The same runs for all designs: their difference is then more accurate than each of them.
            self.designs.append(space.unscaled(x[0]))
            seed = self.problem.run_seed(3, 0)
            self.runs.append(self.problem.trial_runs(self.designs[-1], seed, Terms.nonlinear.value))
            self.progress("correcting", turn + 1, self.method.corrections + 1)
            excess = self._excess(len(self.runs) - 1)
            # Nothing can be learnt without a limit, from runs in which the block does not survive, or from
            # the same design again.
            is_stuck = before is not None and np.abs(x[0] - before).max() < _RESOLUTION
            if -_LEAST_DISTANCE <= excess <= _TOLERANCE or is_stuck or np.isinf(excess):
                break
            before = x[0]
        excess = {i: self._excess(i) for i in range(begun, len(self.designs))}
        kept = np.array([self.designs[i] for i, x in excess.items() if x <= _TOLERANCE])
        # Among designs that keep the limits the objective decides, and not the share of few runs.
        if len(kept):
            return kept[np.argmin(self.orbits.value(self.orbits.evaluate(kept)))]
        nearest = min(excess, key=lambda i: excess[i])
        # A design that exceeds a limit by more is no pendulum that the validation should call a danger.
        return self.designs[nearest] if excess[nearest] <= _MOST_EXCESS else None

    def _continue(self, x: np.ndarray) -> np.ndarray:
        """Return the ends of descents that continue from designs in shares of the bounds, (m, d), under
        corrected limits, best first.

        Corrected limits may favour another valley. The best screened designs under them are starts as well.
        """
        orbits = replace(self.searched, factors=self.laws)
        units = orbits.space.scaled(self._search.screened)
        others = best_apart(units, merit_of(orbits.at(units), orbits.risk.of), _CONTINUATIONS)
        x = np.concatenate([x[:_CONTINUATIONS], units[others]])
        # The limits have moved only a little, so the last steps on exact orbits suffice.
        ends = polish(orbits, x, orbits.at(x), self.method.steps + self.method.polish)
        return ends.x[np.argsort(ends.merit, kind="stable")]

    def learn(self, design: np.ndarray, runs: Runs) -> None:
        """Learn from the validation runs of a rejected design by how much accurate runs underestimate the
        limited quantities."""
        # The best of several designs need not be the last one.
        i = max(i for i, x in enumerate(self.designs) if np.array_equal(x, design))
        for name, size in self._sizes(i, runs).items():
            before = self.allowance.get(name, 0.0)
            # The whole excess counts: another rejection would cost more than a design further inside.
            if size > before:
                self.allowance[name] = size

    def equivalent(self, design: np.ndarray) -> np.ndarray | None:
        """Return the smallest and the largest designs, (2, 3), that are expected to perform as well as one
        design, within half a point of the measure.

        The objective orders designs. How much of the measure a difference of the objective means follows from
        a line through the trials.
        """
        problem, orbits = self.problem, replace(self.orbits, factors=self.laws)
        e = orbits.evaluate(np.array(self.designs))
        values = orbits.value(e)
        falls = problem.reduces(self.without) != "tilt"
        measured = [x.share_overturned.value if falls else problem.value_of(x) for x in self.runs]
        # Values of rest, and of designs without an attracting motion, are none of the objective.
        rows = np.isfinite(measured) & e.attracts.all(axis=1) & (values > 0.0)
        if rows.sum() < _LEAST_COUNT:
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
        keeps = np.all(orbits.constraints(e)[0] <= _LEAST_DISTANCE, axis=1)
        good = keeps & (orbits.value(e) <= orbits.value(e)[0] + _HALF_A_POINT / steepness)
        good[0] = True
        return np.stack([x[good].min(axis=0), x[good].max(axis=0)])

    def trials(self) -> Trials:
        """Return all designs with runs as a table: those that keep the limits first, the last one of them
        before the others."""
        problem, designs = self.problem, np.array(self.designs)
        limited, of_runs = dict(problem.fixed_sizes(designs)), list(map(self._sizes, range(len(designs))))
        for name in of_runs[0]:
            # Without surviving runs the quantity is unknown, and the design does not keep the limit.
            limited[name] = np.maximum(limited[name], np.exp([s[name] for s in of_runs]))
        value = np.array([problem.value_of(runs) for runs in self.runs])
        feasible = np.all([np.ones(len(designs)), *(x <= 1.0 + _TOLERANCE for x in limited.values())], axis=0)
        # The last correction is the best estimate, so it comes first among those that keep the limits.
        order = np.lexsort((np.arange(len(designs))[::-1], ~feasible))
        more = {"designs": designs, "value": value, "trend": value, "feasible": feasible, "risk": None}
        without = problem.value_of(self.without)
        return Trials.of(order, self.runs, limited, without_pendulum=without, **more)
