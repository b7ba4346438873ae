"""Comparison of an ensemble with a pendulum and without, run by run, and the benefit that it shows.

Both are put to the same runs (common random numbers), so that the scatter that they share cancels: a
difference shows with far fewer runs than two independent shares would need.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.ensemble import UNDECIDED_ROW, Ensemble, Outcomes, outcomes
from tpd.answers.statistics import SIGNIFICANT, chance_of, chance_of_either, change, fall, is_positive
from tpd.cluster.cluster import Cluster
from tpd.core import checks
from tpd.core.formatting import Printed
from tpd.scene.conditions import Conditions
from tpd.scene.parameters import Parameters
from tpd.scene.quantities import bare_parameters_of
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import Outcome
from tpd.theory.equations import Terms

LEAST = 0.02
"""Severity that counts as none, so that next to a bare block at rest not every tilt is a worse one."""
FEWER = 0.1
"""Share of the runs that end at rest without the pendulum which may rock with it: with runs enough any
difference is significant."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Verdict(Printed):
    """An ensemble with a pendulum and without, run by run."""

    hung: Outcomes
    bare: Outcomes

    @property
    def equations(self) -> str:
        """Equations by which the runs were followed, "linear" or "nonlinear"."""
        return self.hung.equations

    @property
    def worse(self) -> int:
        """Number of runs that overturn with the pendulum only, of those with both answers."""
        return int(np.sum((self.hung.lost & ~self.bare.lost)[self.known]))

    @property
    def better(self) -> int:
        """Number of runs that overturn without the pendulum only, of those with both answers."""
        return int(np.sum((self.bare.lost & ~self.hung.lost)[self.known]))

    @property
    def known(self) -> np.ndarray:
        """Whether a run has an answer with the pendulum and without, shape (runs,)."""
        return ~(self.hung.undecided | self.bare.undecided)

    @property
    def ends(self) -> tuple[Verdict, Verdict]:
        """The runs with each that has no answer ended against the pendulum, and with each ended for it."""
        against = Verdict(hung=self.hung.ended(True), bare=self.bare.ended(False))
        return against, Verdict(hung=self.hung.ended(False), bare=self.bare.ended(True))

    @property
    def chance(self) -> float:
        """Chance of `worse` or more by luck; see `tpd.answers.statistics.chance_of`."""
        return chance_of(self.worse, self.better)

    @property
    def harms(self) -> bool:
        """Whether significantly more runs overturn with the pendulum than without."""
        return self.worse > self.better and self.chance < SIGNIFICANT

    @property
    def undecided(self) -> tuple[int, int]:
        """Numbers of runs without an answer, with the pendulum and without."""
        return int(self.hung.undecided.sum()), int(self.bare.undecided.sum())

    @property
    def objection(self) -> str:
        """Sentence about the runs that overturn with one of the two only, and those without an answer."""
        hung, bare = self.undecided
        unknown = f"; {hung} with the pendulum and {bare} without it have no answer" if hung or bare else ""
        return (
            f"{self.worse} of {len(self.hung.status)} runs of the ensemble overturn with the pendulum only, "
            f"{self.better} without it only (chance of that by luck: {self.chance:.2g}){unknown}"
        )

    @property
    def chance_in_words(self) -> str:
        """Runs that overturn with one of the two only, and whether chance alone would do this."""
        worse, better = self.worse, self.better
        if worse == better:
            return f"As many runs overturn with the pendulum only as without it only ({worse})."
        chance = chance_of_either(worse, better)
        size = "p < 1e-6" if chance < 1e-6 else f"p = {chance:.2g}"
        said = "hardly" if chance < SIGNIFICANT else "it may"
        return (
            f"{worse} runs overturn with the pendulum only and {better} without it only. Would chance alone "
            f"do this? {said.capitalize()}: {size}."
        )

    def summary(self) -> dict[str, Any]:
        """Both ensembles, and the numbers of runs that differ, for JSON."""
        pairs = {"worse": self.worse, "better": self.better, "chance": self.chance}
        return {**pairs, "with": self.hung.summary(), "without": self.bare.summary()}

    def table(self) -> str:
        """Shares and quantiles of both ensembles as text."""
        lines = [f"{self.equations + ' equations':36}{'with pendulum':>26}{'without':>26}"]
        for (name, hung), (_, bare) in zip(self.hung.rows(), self.bare.rows(), strict=True):
            lines.append(f"{name:36}{hung:>26}{'' if name.startswith('bob') else bare:>26}".rstrip())
        if any(self.undecided):
            lines.append(f"{UNDECIDED_ROW:36}{self.undecided[0]:>26}{self.undecided[1]:>26}")
        return "\n".join(lines)

    def __str__(self) -> str:
        return f"{self.table()}\n{self.objection}"


def verdict(
    subject: Parameters | Scene,
    pendulum: Pendulum | None = None,
    *,
    ensemble: Ensemble | None = None,
    conditions: Conditions | None = None,
    bare: Outcomes | None = None,
    equations: Terms | str = Terms.linear,
    workers: checks.Whole | None = None,
    cluster: Cluster | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
) -> Verdict:
    """Follow an ensemble of runs with the pendulum and without.

    Args:
        subject: a scene, or dimensionless parameters (plain numbers).
        pendulum: in the scene.
        ensemble: default `Ensemble()`.
        conditions: dealt out evenly among the runs, on top of their scatter; default the scene's own.
        bare: outcomes without the pendulum, where they are known already, by the same equations.
        equations: linear or nonlinear, see `outcomes`.
        workers: threads; default the number of cores.
        cluster: processes or machines in place of threads.
        progress: True for a bar on stderr, or called with (runs done, of how many), for one ensemble after
            the other.

    Raises:
        ValueError: bad input, a pendulum beside parameters, or `bare` by other equations.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.optional("bare", bare, Outcomes)
    if isinstance(subject, Scene):
        checks.instance("pendulum", pendulum, Pendulum)
    elif isinstance(subject, Parameters):
        checks.positive("mu", subject.mu)
    if bare is not None and bare.equations != str(equations):
        raise ValueError(f"`bare` must be by the {equations} equations, but is by the {bare.equations} ones")

    # Both use the seed of one ensemble, hence the same starts, phases and scatter.
    def follow(subject: Parameters | Scene, pendulum: Pendulum | None) -> Outcomes:
        runs: dict[str, Any] = {"ensemble": ensemble, "conditions": conditions, "equations": equations}
        where: dict[str, Any] = {"workers": workers, "cluster": cluster, "progress": progress}
        return outcomes(subject, pendulum, **where, **runs)

    hung = follow(subject, pendulum)
    if bare is None:
        bare = follow(subject if isinstance(subject, Scene) else bare_parameters_of(subject), None)
    return Verdict(hung=hung, bare=bare)


class Change(NamedTuple):
    """One size with the pendulum and without, and of a mean their difference with its 95 % interval."""

    name: str
    with_it: float
    without: float
    low: float
    high: float
    """Interval of the difference, with less without; NaN of what is no mean."""

    @property
    def difference(self) -> float:
        """Size with the pendulum less that without."""
        return self.with_it - self.without


@dataclass(frozen=True, kw_only=True)
class Benefit:
    """Comparison of paired runs by their severity: the settled tilt over nu, 0 at rest and 1 where the block
    overturns or tilts further."""

    value: float
    """Share by which the mean severity falls; negative where the pendulum does harm, 0 where none moves."""
    low: float
    high: float
    """95 % interval, see `tpd.answers.statistics.fall`."""
    changes: tuple[Change, ...]
    """Mean, median and worst severity, and the shares overturned and at rest."""
    worse_conditions: tuple[int, ...]
    """Conditions whose mean severity is significantly higher than the bare block's by more than `share`."""
    by_condition: tuple[np.ndarray, np.ndarray]
    """Mean severity under every condition with the pendulum and without, NaN where no run has it."""
    share: float
    rests_less: bool
    """Whether significantly fewer runs end at rest with the pendulum, by more than the share `FEWER`."""
    runs: int
    """Paired runs with an answer, with the pendulum and without: all numbers are of these."""
    undecided: int = 0
    """Paired runs without one."""
    ends: tuple[Benefit, ...] = ()
    """Benefit with each run without an answer ended against the pendulum, and with each ended for it; empty
    where all runs have an answer."""

    def __str__(self) -> str:
        if np.isnan(self.value):
            return "unknown"
        # A value that rounds to zero must not read "-0%".
        value, low, high = (0.0 + x for x in (round(self.value, 2), self.low, self.high))
        if value < 0.0:
            value, low, high = -value, 0.0 - high, 0.0 - low
        # Of a single run nothing is known but the value.
        around = f" (95 % interval {low:.0%} to {high:.0%})" if np.isfinite(low) else ""
        return f"{value:.0%} {'more' if self.value < 0.0 and value else 'less'} tilt{around}"


def severity(outcomes: Outcomes, slenderness: float) -> np.ndarray:
    """Settled tilt of every run over the nu that it has (`slenderness` where the runs do not tell), between 0
    and 1; 1 where the block overturns, NaN where a run has no answer."""
    nu = slenderness if outcomes.nu is None else outcomes.nu
    # A bound at 1 keeps means finite: an overturned block is as bad as one on its corner, and no worse.
    tilt = np.where(outcomes.lost, np.inf, outcomes.amplitude) / nu
    return np.where(outcomes.undecided, np.nan, np.minimum(np.where(np.isnan(tilt), np.inf, tilt), 1.0))


def benefit_of(verdict: Verdict, slenderness: float, condition: np.ndarray, share: float = 0.05) -> Benefit:
    """Benefit of paired runs; NaN where none of them has an answer.

    Args:
        verdict: the runs with the pendulum and without.
        slenderness: nu of the block.
        condition: index of the condition of every run, shape (runs,).
        share: by which a condition may be worse than without the pendulum.
    """
    known, ends = verdict.known, ()
    conditions, pairs = int(condition.max()) + 1, verdict
    if not known.all():
        ends = tuple(benefit_of(x, slenderness, condition, share) for x in verdict.ends)
        pairs = Verdict(hung=verdict.hung.at(known), bare=verdict.bare.at(known))
        condition = condition[known]
    hung, bare = severity(pairs.hung, slenderness), severity(pairs.bare, slenderness)
    # Runs of one condition differ as those of different ones do: each is a cluster of its own.
    found = fall(hung, bare, least=LEAST)
    rest_with, rest_without = ((o.status == Outcome.rest).astype(float) for o in (pairs.hung, pairs.bare))
    fewer, more = (int(np.sum(x > 0.0)) for x in (rest_without - rest_with, rest_with - rest_without))
    # A condition is worse where its pairs show, at 5 %, that the mean severity is higher by more than the
    # share: one chaotic run decides nothing.
    excess = hung - (1.0 + share) * bare - LEAST * share
    rests_less = is_positive((1.0 - FEWER) * rest_without - rest_with)
    # Of a single run nothing is known but the value.
    low, high = (found.low, found.high) if np.isfinite(found.low) else (np.nan, np.nan)
    return Benefit(
        value=found.mean,
        low=low,
        high=high,
        changes=(
            _mean_change("mean severity", hung, bare),
            Change("median severity", _of(np.median, hung), _of(np.median, bare), np.nan, np.nan),
            Change("worst severity", _of(_worst, hung), _of(_worst, bare), np.nan, np.nan),
            _mean_change("overturned", pairs.hung.lost, pairs.bare.lost),
            _mean_change("at rest", rest_with, rest_without),
        ),
        worse_conditions=tuple(
            int(i)
            for i in np.unique(condition)
            if is_positive(excess[condition == i], -1.0 - share * (1.0 + LEAST))
        ),
        by_condition=(_by_condition(hung, condition, conditions), _by_condition(bare, condition, conditions)),
        share=share,
        rests_less=rests_less and chance_of(fewer, more) < SIGNIFICANT,
        runs=len(hung),
        undecided=int(np.sum(~known)),
        ends=ends,
    )


def _of(size: Callable[[np.ndarray], Any], values: np.ndarray) -> float:
    """A size of values, NaN where there are none."""
    return float(size(values)) if len(values) else np.nan


def _mean_change(name: str, hung: np.ndarray, bare: np.ndarray) -> Change:
    by = change(hung, bare)
    low, high = (x if np.isfinite(x) else np.nan for x in (by.low, by.high))
    return Change(name, _of(np.mean, hung), _of(np.mean, bare), low, high)


def _worst(x: np.ndarray) -> float:
    """Mean of the worst tenth: the largest of all runs alone would say little."""
    # Of few runs at least one.
    return float(np.sort(x)[-max(1, len(x) // 10) :].mean())


def _by_condition(values: np.ndarray, condition: np.ndarray, n: int) -> np.ndarray:
    count = np.bincount(condition, minlength=n)
    with np.errstate(invalid="ignore"):
        return np.bincount(condition, weights=values, minlength=n) / np.where(count > 0, count, np.nan)
