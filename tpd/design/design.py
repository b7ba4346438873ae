"""Result of `optimise`: the design, its validation, and the reasons why a pendulum is not recommended."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tpd.answers.motion_history import sliding
from tpd.answers.paired import PairedRuns
from tpd.answers.statistics import Interval
from tpd.core.formatting import Printed, number
from tpd.design.problem import Problem
from tpd.design.reasons import OFFERED, REJECTED, VALIDATED, DesignStatus, reduction
from tpd.design.search import Search
from tpd.design.space import DesignSpace
from tpd.design.trials import Trials
from tpd.design.validate import Validation
from tpd.limits import LABELS, stroke_limit
from tpd.scene.conditions import Conditions
from tpd.scene.scene import Pendulum, Scene
from tpd.theory.no_uplift import Sliding

_MOST_REASONS = 6
"""Largest number of reasons that `print` shows."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Design(Printed):
    """Result of `tpd.optimise`, with the problem that it answers. Lengths are in m, masses in kg, angles in
    rad.

    `status` is the verdict, and `pendulum` is the pendulum, or None if none is recommended. `benefit` is the
    share by which the mean tilt falls. `refusals` are sentences with the reasons against the best design that
    was validated. `print(design)` shows all of these.

    Example:
        >>> import tpd
        >>> block = tpd.Block(width=0.5, height=1.5, mass=900.0, cavity_width=0.4)
        >>> design = tpd.optimise(tpd.Scene(block, tpd.Harmonic(amplitude=0.003, frequency=2.0)))
        >>> design.status.name, design.pendulum
        ('no_uplift', None)
    """

    problem: Problem
    """Block, excitation, design space, limits and all other inputs."""
    status: DesignStatus
    """Verdict on the design."""
    validated: tuple[Validation, ...] = ()
    """Designs that were validated, in order. The last one is recommended if there is no reason against it.
    Under ground motions the pendulum of the rule of thumb is the first one, or the last one if it is
    recommended."""
    trials: Trials | None = None
    """Designs that were evaluated by trial runs; None if no pendulum is needed."""
    search: Search | None = None
    """History of the descents; None under ground motions."""
    equivalent: np.ndarray | None = None
    """Smallest and largest (mu, lam, zeta), shape (2, 3), of the designs that perform equally well within the
    accuracy of the trial runs; None if this is not known."""
    rule: Validation | None = None
    """Pendulum of the rule of thumb, which all earthquakes validate; None under harmonic excitation, and if
    no such pendulum fits."""

    @property
    def scene(self) -> Scene:
        """Block and excitation. Under several ground motions: the block with the first motion."""
        return self.problem.scene

    @property
    def space(self) -> DesignSpace:
        """Bounds of the design space."""
        return self.problem.space

    @property
    def conditions(self) -> Conditions:
        """Excitations for which the design must work."""
        return self.problem.conditions

    @property
    def seed(self) -> int:
        """Seed of all random choices."""
        return self.problem.seed

    @property
    def pendulum(self) -> Pendulum | None:
        """Recommended pendulum; None if none is recommended."""
        return self.validated[-1].pendulum if self.status in OFFERED else None

    @cached_property
    def best(self) -> Validation | None:
        """Best validated design, or None if no design was validated.

        This is the recommended design. If none is recommended, it is the design whose shortfalls have the
        smallest sum.
        """

        # The largest benefit alone would often select a bob that touches the walls in every run.
        def rank(v: Validation) -> tuple[bool, float]:
            return v.runs is None, sum((reason.shortfall for reason in v.reasons), 0.0)

        # Validation ends with the first design that passes, which is therefore the last one.
        offered = self.validated[-1:] if self.status in OFFERED else ()
        # Designs that were rejected without runs come last, because their shortfalls cover only some
        # requirements.
        return min(offered or self.validated, key=rank, default=None)

    @property
    def exact_motions(self) -> tuple[Any, ...]:
        """`ExactMotions` without a pendulum and, if one was validated, with the best design; empty if only
        runs can evaluate a design."""
        cases = self.problem.without_pendulum, self.best and self.best.exact
        return tuple(motions for motions in cases if motions is not None)

    @property
    def runs(self) -> PairedRuns | None:
        """Validation runs of the best design that the report quotes; None if there are none."""
        return None if self.best is None else self.best.runs

    @property
    def searched(self) -> Validation | None:
        """Last design of the search that was validated; None if there is none."""
        return next((v for v in reversed(self.validated) if v is not self.rule), None)

    @property
    def is_danger(self) -> bool:
        """Whether the verdict is a danger: none is offered, and with the best design the block overturns more
        often or the bob touches a wall."""
        return self.pendulum is None and self.best is not None and self.best.is_harmful

    @cached_property
    def verdict(self) -> str:
        """Sentences of the verdict, which print, terminal, report, page and design.json show. The exit status
        of the command follows from the same status."""
        # A block that does not rock needs its margin and not the number of rejected designs.
        if self.status in (DesignStatus.no_uplift, DesignStatus.slides):
            return self.problem.needless
        text = self.problem.headline(self.status, self.refusals)
        return text if self.status in (*REJECTED, *VALIDATED) else f"{text} {self.result}".rstrip()

    @property
    def result(self) -> str:
        """Sentences with the benefit in the validation runs; empty if there are none."""
        if self.runs is None or self.best is None:
            return ""
        of = " of these motions" * (self.status not in VALIDATED)
        return f"In {self.runs.pairs} paired runs{of}: {reduction(self.runs, self.best.measure)}."

    @property
    def benefit(self) -> Interval | None:
        """Share by which the mean tilt falls with the recommended pendulum in validation runs.

        None if no pendulum is recommended, or if no motion was kept for the validation.
        """
        if self.runs is None or self.status not in VALIDATED:
            return None
        return self.runs.benefit

    @property
    def overturning_reduction(self) -> Interval | None:
        """Share by which the number of runs that overturn falls; None in the same cases as `benefit`."""
        return None if self.runs is None or self.benefit is None else self.runs.overturning_reduction

    @property
    def nearest(self) -> np.ndarray | None:
        """(mu, lam, zeta) of the best validated design or, without one, of the trial that exceeds its limits
        least.

        None if no design was evaluated.
        """
        if self.best is not None:
            return self.best.design
        return None if self.trials is None else self.trials.designs[self._least_excess]

    @property
    def _least_excess(self) -> int:
        """Index of the trial whose largest limited quantity exceeds its limit least."""
        assert self.trials is not None
        sizes = np.nan_to_num(self.trials.sizes, nan=np.inf)
        return int(np.argmin(np.max(sizes, axis=1, initial=0.0)))

    @property
    def refusals(self) -> tuple[str, ...]:
        """Sentences against the best design, dangers first; empty if a pendulum is recommended."""
        if self.best is not None:
            return self.best.refusals
        if self.status is not DesignStatus.none_feasible or self.trials is None:
            return ()
        # No trial keeps the limits: the reasons are the limits that the nearest trial exceeds.
        sizes = self.trials.sizes[self._least_excess]
        if np.isnan(sizes).any():
            return ("the block overturns in so many trial runs that the limits cannot be compared with any",)
        return tuple(
            str(self.problem.excess(name, float(size)))
            for name, size in zip(self.trials.names, sizes, strict=True)
            if size > 1.0
        )

    @property
    def at_bounds(self) -> list[str]:
        """Words for the bounds of the design space that the best design lies on. A better design may exist
        beyond these bounds."""
        if self.nearest is None:
            return []
        return [
            f"{('lower', 'upper')[side]} search bound of the {self._word(i, side)}"
            for i, side in self.space.bounds_at(self.nearest).items()
        ]

    def _word(self, i: int, side: int = 0) -> str:
        """Return words for a bound of the i-th parameter, with its value."""
        return f"{('mass', 'length', 'damping')[i]} ratio, {number(self.space.ends[side, i], 3)}"

    @property
    def remedy(self) -> str:
        """Words for the inputs that can change the answer; empty if a pendulum is recommended or not needed.

        They are the limits without which a trial is better, and fixed values and bounds of the design space.
        """
        trials = self.trials
        if trials is None or self.pendulum is not None:
            return ""
        best = trials.best_without()
        limits = [f"limit on {LABELS.get(n, n)}" for n in trials.names if trials.best_without(n) != best]
        fixed = [f"fixed {self._word(i)}" for i in range(3) if i not in self.space.searched]
        listed = "; ".join([*limits, *fixed, *self.at_bounds])
        return listed and f"these could give another answer: {listed}"

    @cached_property
    def sliding(self) -> Sliding | None:
        """Friction that the base needs with the best design; None if no design was validated."""
        pendulum = None if self.best is None else self.best.pendulum
        return pendulum and sliding(self.scene, self.problem.stated_motions, pendulum)

    @property
    def rod_angle(self) -> np.ndarray:
        """Largest angle (rad) between rod and block in each validation run of the best design in which the
        block stands.

        Empty if there are no runs.
        """
        own = self.best and self.best.own_runs
        return np.zeros(0) if own is None else own.rod_angle[own.stands]

    @property
    def swing(self) -> float:
        """Bob angle (rad) that the drawing of the design shows; 0 without a pendulum.

        Under harmonic excitation this is the largest settled angle after a start from rest. Under ground
        motions, and if no settled angle is finite, this is the angle that is exceeded only in the allowed
        share of the validation runs.
        """
        if self.pendulum is None or self.best is None:
            return 0.0
        exact, in_runs = self.best.exact, self.problem.reached(self.rod_angle)
        # Without an attracting orbit the swing is not finite, and is left out.
        settled = [] if exact is None else [*exact.settled_swing, *exact.orbits.swing[0]]
        return float(max(filter(math.isfinite, settled), default=in_runs))

    @cached_property
    def usage(self) -> dict[str, float]:
        """Utilisation of each limit by the best design, by name: the limited quantity divided by its limit,
        or the limit divided by the quantity if it is a lower bound.

        For a quantity that depends on the motion, this is the quantile of the validation runs that only the
        allowed share exceeds; NaN if the block stands in no run.
        """
        if self.best is None:
            return {}
        problem, design = self.problem, self.best.design
        usage = {name: float(x[0]) for name, x in problem.fixed_sizes(design[None]).items()}
        if self.best.own_runs is not None:
            for name, x in problem.sizes_in_runs(design, self.best.own_runs).items():
                usage[name] = float(np.maximum(usage.get(name, 0.0), problem.reached(x)))
        limits = {limit.name: limit for limit in problem.limits}
        return {name: limits[name].utilisation(x) if name in limits else x for name, x in usage.items()}

    @property
    def risks(self) -> tuple[float, float]:
        """Mean tilt (share of the toppling angle) with the recommended pendulum, and without a pendulum.

        The first is NaN if no pendulum is recommended.
        """
        if self.runs is None:
            return math.nan, math.nan if self.trials is None else self.trials.without_pendulum
        # The severities are those of the validation runs, which are nonlinear.
        mean = self.runs.change("mean tilt")
        return math.nan if self.pendulum is None else mean.with_pendulum, mean.without_pendulum

    @property
    def stroke_limit(self) -> float:
        """Largest settled bob angle (rad) that the limits allow."""
        return stroke_limit(self.problem.limits)

    def __str__(self) -> str:
        lines, pendulum = [f"{'DANGER: ' * self.is_danger}{self.verdict}"], self.pendulum
        if pendulum is not None:
            size = f"{pendulum.mass:.4g} kg on a rod of {pendulum.length:.4g} m"
            lines.append(
                f"  pendulum    equivalent point mass {size}, damping ratio {pendulum.damping_ratio:.3g}"
            )
        if self.runs is not None:
            lines.append(f"  benefit     {self.result}")
        lines += [f"  reason      {text}" for text in self.status.other(self.refusals)[:_MOST_REASONS]]
        lines += [f"  inputs      {self.remedy}"] if self.remedy else []
        return "\n".join(lines)
