"""The answer of `optimise`: what was found, how it was validated, and why a pendulum is not recommended."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.paired import PairedRuns
from tpd.answers.statistics import Interval
from tpd.core.formatting import Printed
from tpd.design.criteria import STILL, DesignSpace, stroke_limit
from tpd.design.problem import Problem
from tpd.design.reasons import OFFERED, DesignStatus, Reason, ReasonKind
from tpd.design.refine import Trials
from tpd.design.search import Search
from tpd.design.validate import Validated
from tpd.scene.conditions import Conditions
from tpd.scene.scene import Pendulum, Scene

_MOST_REASONS = 6
"""Most reasons that `print` shows."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Design(Printed):
    """The answer of `optimise`, with its problem: lengths in m, masses in kg, angles in rad."""

    problem: Problem
    status: DesignStatus
    validated: tuple[Validated, ...] = ()
    """Designs that were validated, in order; the last one is recommended if no reason is against it."""
    trials: Trials | None = None
    """Designs that were evaluated by trial runs; None where no pendulum is needed."""
    search: Search | None = None
    """History of the descents; None under ground motions."""
    equivalent: np.ndarray | None = None
    """Least and largest (mu, lam, zeta), shape (2, 3), of designs that perform equally well, as far as the
    trial runs can tell; None where that is not known."""

    @property
    def scene(self) -> Scene:
        """Block and motion; under ground motions the first of them."""
        return self.problem.scene

    @property
    def space(self) -> DesignSpace:
        """Bounds of the search."""
        return self.problem.space

    @property
    def conditions(self) -> Conditions:
        """Excitations for which the design must work."""
        return self.problem.conditions

    @property
    def seed(self) -> int:
        """Seed of every random choice."""
        return self.problem.seed

    @property
    def pendulum(self) -> Pendulum | None:
        """The pendulum that is offered; None where none is."""
        return self.validated[-1].pendulum if self.status in OFFERED else None

    @cached_property
    def best(self) -> Validated | None:
        """The design that is offered or, where none is, the validated one that misses its requirements by
        the least sum; None without any."""

        # The largest benefit alone is often that of a bob which touches the walls in every run.
        def rank(v: Validated) -> tuple[bool, float]:
            return v.runs is None, sum((reason.shortfall for reason in v.reasons), 0.0)

        offered = self.validated[-1:] if self.status in OFFERED else ()
        return min(offered or self.validated, key=rank, default=None)

    @property
    def runs(self) -> PairedRuns | None:
        """Validation runs of the best design that the report quotes; None without any."""
        return None if self.best is None else self.best.runs

    @property
    def benefit(self) -> Interval | None:
        """Share by which the mean tilt falls with the pendulum that is offered, in validation runs; None
        where none is offered, or no motion was held out."""
        if self.runs is None or self.status is not DesignStatus.recommended:
            return None
        return self.runs.benefit

    @property
    def overturning_reduction(self) -> Interval | None:
        """Share by which the share of runs that overturn falls; as `benefit`, which is that of the mean
        tilt."""
        return None if self.runs is None or self.benefit is None else self.runs.overturning_reduction

    @property
    def nearest(self) -> np.ndarray | None:
        """(mu, lam, zeta) of the design that is offered or came nearest; None without any."""
        if self.best is not None:
            return self.best.design
        return None if self.trials is None else self.trials.designs[self._least_excess]

    @property
    def _least_excess(self) -> int:
        assert self.trials is not None
        return int(np.argmin(np.max(self.trials.sizes, axis=1, initial=0.0)))

    @property
    def refusals(self) -> tuple[str, ...]:
        """Sentences against the design that came nearest, the dangers first; empty where one is offered."""
        if self.best is not None:
            return self.best.refusals
        if self.status is not DesignStatus.none_feasible or self.trials is None:
            return ()
        sizes = self.trials.sizes[self._least_excess]
        return tuple(
            str(Reason(kind=ReasonKind.breaks_limit, limit=name, value=float(size)))
            for name, size in zip(self.trials.names, sizes, strict=True)
            if size > 1.0
        )

    @property
    def is_harmful(self) -> bool:
        """Whether the block overturns more often, or the bob touches a wall, with the design that came
        nearest."""
        return self.best is not None and self.best.is_harmful

    @property
    def turned(self) -> np.ndarray:
        """Largest angles between rod and block, rad, of the best design in the validation runs in which the
        block stands; empty without any."""
        if self.runs is None:
            return np.zeros(0)
        return self.runs.with_pendulum.rod_angle[self.runs.with_pendulum.stands]

    @property
    def swing(self) -> float:
        """Angle of the bob that its drawing shows, rad: the settled one from rest under harmonic excitation,
        else that which the allowed share of the runs exceeds; 0 without a pendulum."""
        if self.pendulum is None or self.best is None:
            return 0.0
        if self.best.exact is not None:
            swings = np.concatenate([self.best.exact.swing, self.best.exact.orbits.swing[0]])
            return float(np.max(swings, where=np.isfinite(swings), initial=0.0))
        return float(np.quantile(self.turned, 1.0 - self.problem.allowed)) if self.turned.size else 0.0

    @cached_property
    def usage(self) -> dict[str, float]:
        """Limited quantities of the best design over their limits, by name: those that need no run, and the
        quantile of the validation runs that the allowed share exceeds."""
        if self.best is None:
            return {}
        problem, design = self.problem, self.best.design
        found = {name: float(x[0]) for name, x in problem.fixed_sizes(design[None]).items()}
        if self.runs is not None:
            for name, x in problem.sizes_in_runs(design, self.runs.with_pendulum).items():
                if name in STILL:
                    # The scatter of the body as it was made is no use of the limit by the motion.
                    continue
                level = float(np.quantile(x, 1.0 - problem.allowed, method="higher")) if x.size else 0.0
                found[name] = max(found.get(name, 0.0), level)
        return found

    @property
    def risks(self) -> tuple[float, float]:
        """Mean severity with the pendulum that is offered, NaN where none is, and without a pendulum."""
        if self.runs is None:
            return math.nan, math.nan if self.trials is None else self.trials.without_pendulum
        mean = self.runs.change("mean severity")
        return math.nan if self.pendulum is None else mean.with_pendulum, mean.without_pendulum

    @property
    def stroke_limit(self) -> float:
        """Largest settled |psi| allowed, rad."""
        return stroke_limit(self.problem.limits)

    def again(self, **changed: Any) -> dict[str, Any]:
        """Return the arguments of `tpd.optimise` that pose the problem again, with some of them changed."""
        return self.problem.inputs | changed

    def __str__(self) -> str:
        lines, with_it, runs = [self.status.value], self.pendulum, self.runs
        if with_it is not None:
            size = f"{with_it.mass:.4g} kg on a rod of {with_it.length:.4g} m"
            lines.append(
                f"  pendulum    equivalent point mass {size}, damping ratio {with_it.damping_ratio:.3g}"
            )
        if runs is not None:
            fell = runs.change("overturned")
            shares = f"{fell.with_pendulum:.1%} with the pendulum, {fell.without_pendulum:.1%} without it"
            lines.append(f"  benefit     {runs.benefit_in_words}; {runs.description}")
            lines.append(f"  overturned  {shares}")
        lines += [f"  reason      {said}" for said in self.refusals[:_MOST_REASONS]]
        return "\n".join(lines)


class FrontPoint(NamedTuple):
    """Answer with a bob of at most a certain mass."""

    most: float
    """kg"""
    status: str
    """Name of the status."""
    pendulum: Pendulum | None
    """None where none is offered."""
    saved: tuple[float, float, float]
    """Share by which the mean tilt falls, and its interval of 95 %, in validation runs; NaN
    without a pendulum."""
