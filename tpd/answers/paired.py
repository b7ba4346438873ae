"""Paired runs: the same runs with a pendulum and without it, and the benefit and the harm that they show.

Both cases have the same initial states, phases and scatter (common random numbers), so that what they share
cancels: a difference shows with far fewer runs than two independent shares would need.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.ensemble import Ensemble, outcomes
from tpd.answers.runs import UNANSWERED_ROW, Runs, label_of_ramp
from tpd.answers.statistics import (
    SIGNIFICANT,
    Interval,
    chance_of,
    chance_of_either,
    change,
    fall,
    is_positive,
)
from tpd.cluster.cluster import Cluster
from tpd.core import checks
from tpd.core.formatting import Printed
from tpd.scene.conditions import Conditions
from tpd.scene.parameters import Parameters
from tpd.scene.quantities import parameters_without_pendulum
from tpd.scene.scene import Pendulum, Scene
from tpd.theory.equations import Terms

LEAST = 0.02
"""Severity that counts as none, so that next to a block at rest not every tilt is a worse one."""
FEWER = 0.1
"""Share of the runs that end at rest without the pendulum which may rock with it: with enough runs any
difference is significant."""
OVERTURNS = 0.01
"""Share of the runs without a pendulum in which the block overturns, from which on fewer overturnings are the
first purpose of a pendulum, and a smaller mean tilt below it."""
WORSE = 0.05
"""Share by which the mean tilt of one group of runs may be higher with the pendulum."""


class Change(NamedTuple):
    """One quantity with and without the pendulum and, for a mean, the 95 % interval of their difference."""

    name: str
    with_pendulum: float
    without_pendulum: float
    low: float
    high: float
    """Interval of the difference, with less without; NaN for what is no mean."""

    @property
    def difference(self) -> float:
        """Value with the pendulum less that without it."""
        return self.with_pendulum - self.without_pendulum


class Overturned(NamedTuple):
    """Runs of which significantly more overturn with the pendulum."""

    label: str
    """Name of the part; empty for all runs."""
    only_with: int
    """Number of runs that overturn only with the pendulum."""
    only_without: int
    total: int


class Part(NamedTuple):
    """The runs of one condition, of one group of ground motions, or of one kind of start."""

    label: str
    rows: np.ndarray
    """Whether a run belongs to the part and has both answers."""
    with_pendulum: float
    """Mean severity with the pendulum; NaN where no run has it."""
    without_pendulum: float
    is_worse: bool
    """Whether the mean severity is significantly higher with the pendulum, by more than the allowed share."""


@dataclass(frozen=True, kw_only=True, repr=False)
class PairedRuns(Printed):
    """Runs with a pendulum, and the same runs without it; arrays of shape (runs,).

    Benefit and changes are those of the counted runs that have an answer in both cases. The severity of a
    run is its settled tilt over the slenderness, at most 1, and 1 where the block overturns.
    """

    with_pendulum: Runs
    without_pendulum: Runs
    group: np.ndarray
    """Index of the condition, or of the group of ground motions, of every run."""
    labels: tuple[str, ...]
    """Names of the groups."""
    cluster: np.ndarray | None = None
    """Number of the earthquake of every run; None where all runs are independent."""
    counted: np.ndarray | None = None
    """Whether the benefit counts a run; by default it counts all of them. The harm is that of all runs."""
    worse: float = WORSE
    """Share by which the mean severity of a part may be higher with the pendulum."""

    @property
    def _cases(self) -> tuple[Runs, Runs]:
        return self.with_pendulum, self.without_pendulum

    @cached_property
    def description(self) -> str:
        """Number and kind of the counted runs."""
        runs = self.with_pendulum
        kind = f"{self.pairs} paired runs of the {runs.equations.value} equations, seed {runs.seed}"
        if self.cluster is None:
            return kind
        events = len(np.unique(self.cluster[self._rows]))
        return f"{kind}, {events} earthquake{'s' if events != 1 else ''}"

    @cached_property
    def severity(self) -> np.ndarray:
        """Severity with and without the pendulum, (2, runs); NaN where a run has no answer."""
        return np.stack([o.severity for o in self._cases])

    @cached_property
    def known(self) -> np.ndarray:
        """Whether a run has an answer in both cases."""
        return ~np.any([o.is_unanswered for o in self._cases], axis=0)

    @cached_property
    def _rows(self) -> np.ndarray:
        """Counted runs with both answers."""
        return self.known if self.counted is None else self.known & self.counted

    @property
    def pairs(self) -> int:
        """Number of counted pairs with both answers."""
        return int(self._rows.sum())

    @property
    def undecided(self) -> int:
        """Number of pairs without an answer in one of the two cases."""
        return int(np.sum(~self.known))

    def _clusters(self, rows: np.ndarray) -> np.ndarray | None:
        return None if self.cluster is None else self.cluster[rows]

    @cached_property
    def benefit(self) -> Interval:
        """Share by which the mean severity falls, with its 95 % interval; NaN without any pair."""
        rows = self._rows
        with_it, without = self.severity[:, rows]
        return fall(with_it, without, self._clusters(rows), least=LEAST)

    @cached_property
    def overturning_reduction(self) -> Interval:
        """Share by which the share of runs that overturn falls, with its 95 % interval; NaN where no run
        overturns without the pendulum."""
        with_it, without = (o.is_overturned[self._rows] for o in self._cases)
        if not without.any():
            return Interval(np.nan, np.nan, np.nan)
        return fall(with_it, without, self._clusters(self._rows))

    @property
    def first_measure(self) -> str:
        """Name of the first thing to reduce: "overturning" if the block overturns in 1 % or more of the
        runs without the pendulum, else "tilt"."""
        return "overturning" if self.change("overturned").without_pendulum >= OVERTURNS else "tilt"

    def reduction(self, measure: str) -> tuple[Interval, bool]:
        """Return the relative reduction of a measure, "overturning" or "tilt", and whether the mean falls
        significantly.

        In few runs the interval of a ratio of means may lie above zero where that of the difference does not.
        """
        if measure == "overturning":
            return self.overturning_reduction, self.change("overturned").high < 0.0
        return self.benefit, self.change("mean severity").high < 0.0

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """Mean, median and worst severity, and the shares that overturn and that end at rest."""
        rows = self._rows
        pair = self.severity[:, rows]
        fell = np.array([o.is_overturned[rows] for o in self._cases], dtype=float)
        rests = np.array([o.is_at_rest[rows] for o in self._cases], dtype=float)

        def mean(name: str, values: np.ndarray) -> Change:
            by = change(values[0], values[1], self._clusters(rows))
            low, high = (x if np.isfinite(x) else np.nan for x in (by.low, by.high))
            return Change(name, _of(np.mean, values[0]), _of(np.mean, values[1]), low, high)

        def single(name: str, size: Callable[[np.ndarray], Any]) -> Change:
            return Change(name, _of(size, pair[0]), _of(size, pair[1]), np.nan, np.nan)

        return (
            mean("mean severity", pair),
            single("median severity", np.median),
            # The mean of the worst tenth: the largest of all runs alone would say little.
            single("worst severity", lambda x: np.sort(x)[-max(1, len(x) // 10) :].mean()),
            mean("overturned", fell),
            mean("at rest", rests),
        )

    def change(self, name: str) -> Change:
        """Return the change of one quantity by its name in `changes`."""
        return next(c for c in self.changes if c.name == name)

    @cached_property
    def only(self) -> tuple[int, int]:
        """Numbers of runs that overturn only with the pendulum, and only without it."""
        return self._only(self.known)

    def _only(self, rows: np.ndarray) -> tuple[int, int]:
        """Numbers of some runs that overturn only with the pendulum, and only without it."""
        with_it, without = (o.is_overturned[rows] for o in self._cases)
        return int(np.sum(with_it & ~without)), int(np.sum(without & ~with_it))

    @cached_property
    def overturns_more(self) -> Overturned | None:
        """Runs of which significantly more overturn with the pendulum; None if there are none.

        All runs are compared, by McNemar's test if they are independent and otherwise by the interval between
        earthquakes. Under earthquakes each group is compared as well.
        """
        if self.cluster is None:
            worse, better = self.only
            is_harm = worse > better and chance_of(worse, better) < SIGNIFICANT
            return Overturned("", worse, better, int(self.known.sum())) if is_harm else None
        fell = [o.is_overturned.astype(float) for o in self._cases]
        for label, rows in (("", self.known), *((part.label, part.rows) for part in self.parts)):
            if change(fell[0][rows], fell[1][rows], self._clusters(rows)).is_above:
                return Overturned(label, *self._only(rows), int(rows.sum()))
        return None

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The runs of each group and, where the shaking grows over several durations, of each of these.

        The benefit is a mean over all runs. A pendulum that helps where the shaking grows slowly and harms
        where it begins suddenly must not be hidden by this mean.
        """
        ramps = np.unique(self.with_pendulum.ramp)
        chosen = [(label, self.group == i) for i, label in enumerate(self.labels)]
        if len(ramps) > 1:
            chosen += [(label_of_ramp(ramp), self.with_pendulum.ramp == ramp) for ramp in ramps]
        # One chaotic run decides nothing: pairs must show at 5 % that the mean is higher by more.
        excess = self.severity[0] - (1.0 + self.worse) * self.severity[1] - LEAST * self.worse
        least = -1.0 - self.worse * (1.0 + LEAST)
        found = list[Part]()
        for label, of in chosen:
            rows = self.known & of
            with_it, without = (_of(np.mean, x[rows]) for x in self.severity)
            is_worse = is_positive(excess[rows], least, self._clusters(rows))
            found.append(Part(label, rows, with_it, without, is_worse))
        return tuple(found)

    @cached_property
    def worse_parts(self) -> tuple[Part, ...]:
        """Parts that are worse with the pendulum, the one with the largest increase first."""
        worse = (part for part in self.parts if part.is_worse)
        return tuple(sorted(worse, key=lambda part: part.without_pendulum - part.with_pendulum))

    @property
    def rests_less(self) -> bool:
        """Whether significantly fewer runs end at rest with the pendulum, by more than the share `FEWER`."""
        with_it, without = (o.is_at_rest[self.known].astype(float) for o in self._cases)
        fewer, more = int(np.sum(without > with_it)), int(np.sum(with_it > without))
        return is_positive((1.0 - FEWER) * without - with_it) and chance_of(fewer, more) < SIGNIFICANT

    @property
    def ends(self) -> tuple[PairedRuns, ...]:
        """The runs with each that has no answer ended against the pendulum, and ended for it; empty where all
        runs have an answer."""
        if self.known.all():
            return ()
        return tuple(
            replace(
                self,
                with_pendulum=self.with_pendulum.ended(against),
                without_pendulum=self.without_pendulum.ended(not against),
            )
            for against in (True, False)
        )

    @property
    def benefit_in_words(self) -> str:
        """The benefit with its interval, such as "33 % less tilt (95 % interval 29 to 37 %)"."""
        if np.isnan(self.benefit.mean):
            return "benefit unknown"
        less, size, around = self.benefit.fall_in_words()
        return f"{size} {'less' if less else 'more'} tilt{around}"

    @property
    def overturning_in_words(self) -> str:
        """Runs that overturn in one of the two cases only, and whether that is significant."""
        with_it, without = self.only
        said = f"{with_it} runs overturn only with the pendulum and {without} only without it"
        # Runs of one earthquake are not independent, so that the counts have no such probability.
        if with_it == without or self.cluster is not None:
            return f"{said}."
        chance = chance_of_either(with_it, without)
        size = "p < 1e-6" if chance < 1e-6 else f"p = {chance:.2g}"
        return f"{said}: {'' if chance < SIGNIFICANT else 'not '}statistically significant ({size})."

    def summary(self) -> dict[str, Any]:
        """Both cases, the benefit and the runs that differ, for JSON."""
        with_only, without_only = self.only
        mean = {
            "with": [part.with_pendulum for part in self.parts],
            "without": [part.without_pendulum for part in self.parts],
        }
        return {
            "runs": self.description,
            "pairs": self.pairs,
            "undecided": self.undecided,
            "benefit": self.benefit,
            "overturning_reduction": self.overturning_reduction,
            "changes": self.changes,
            "overturned_only_with": with_only,
            "overturned_only_without": without_only,
            "groups": [part.label for part in self.parts],
            "mean_severity": mean,
            "worse_groups": [part.label for part in self.worse_parts],
            "with": self.with_pendulum.summary(),
            "without": self.without_pendulum.summary(),
        }

    def table(self) -> str:
        """Shares and quantiles of both cases as text."""
        cases = self._cases
        lines = [f"{cases[0].equations.value + ' equations':36}{'with pendulum':>26}{'without':>26}"]
        for (name, first), (_, second) in zip(*(o.rows() for o in cases), strict=True):
            lines.append(f"{name:36}{first:>26}{'' if name.startswith('bob') else second:>26}".rstrip())
        if self.undecided:
            counts = (f"{int(o.is_unanswered.sum()):>26}" for o in cases)
            lines.append(f"{UNANSWERED_ROW:36}{''.join(counts)}")
        return "\n".join(lines)

    def __str__(self) -> str:
        return "\n".join([self.table(), self.benefit_in_words, self.overturning_in_words])


def paired_runs(
    subject: Parameters | Scene,
    pendulum: Pendulum | None = None,
    *,
    ensemble: Ensemble | None = None,
    conditions: Conditions | None = None,
    equations: Terms | str = Terms.linear,
    rtol: checks.Real = 1e-8,
    workers: checks.Whole | None = None,
    cluster: Cluster | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
) -> PairedRuns:
    """Follow the runs of an ensemble with a pendulum and without it.

    Args:
        subject: a scene, or dimensionless parameters (plain numbers).
        pendulum: in the scene.
        ensemble: default `Ensemble()`.
        conditions: dealt out evenly among the runs, on top of their scatter; default the scene's own.
        equations: linear or nonlinear, see `outcomes`.
        rtol: relative tolerance of a step of the nonlinear equations.
        workers: threads; default the number of cores.
        cluster: processes or machines in place of threads.
        progress: True for a bar on stderr, or called with (runs done, of how many), for one case after the
            other.

    Raises:
        ValueError: bad input, or a pendulum beside parameters.
        RuntimeError: JAX is in 32-bit mode.
    """
    if isinstance(subject, Scene):
        checks.instance("pendulum", pendulum, Pendulum)
    elif isinstance(subject, Parameters):
        checks.positive("mu", subject.mu)
    ensemble = (Ensemble() if ensemble is None else ensemble).seeded(0)
    conditions = Conditions() if conditions is None else conditions

    # Both cases use the seed of one ensemble, hence the same initial states, phases and scatter.
    def follow(subject: Parameters | Scene, pendulum: Pendulum | None) -> Runs:
        runs: dict[str, Any] = {"ensemble": ensemble, "conditions": conditions, "equations": equations}
        where: dict[str, Any] = {"workers": workers, "cluster": cluster, "progress": progress}
        return outcomes(subject, pendulum, rtol=rtol, **where, **runs)

    with_pendulum = follow(subject, pendulum)
    return PairedRuns(
        with_pendulum=with_pendulum,
        without_pendulum=follow(
            subject if isinstance(subject, Scene) else parameters_without_pendulum(subject), None
        ),
        group=with_pendulum.condition,
        labels=tuple(map(conditions.label, range(len(conditions)))),
    )


def _of(size: Callable[[np.ndarray], Any], values: np.ndarray) -> float:
    """A size of values, NaN where there are none."""
    return float(size(values)) if len(values) else np.nan
