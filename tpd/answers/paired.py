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

from tpd.answers.ensemble import UNDECIDED_ROW, Ensemble, Outcomes, outcomes
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
from tpd.scene.quantities import bare_parameters_of
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import Outcome
from tpd.theory.equations import Terms

LEAST = 0.02
"""Severity that counts as none, so that next to a block at rest not every tilt is a worse one."""
FEWER = 0.1
"""Share of the runs that end at rest without the pendulum which may rock with it: with enough runs any
difference is significant."""
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


@dataclass(frozen=True, kw_only=True, repr=False)
class PairedRuns(Printed):
    """Runs with a pendulum, and the same runs without it; arrays of shape (runs,).

    Benefit and changes are those of the counted runs that have an answer in both cases. The severity of a
    run is its settled tilt over the slenderness, at most 1, and 1 where the block overturns.
    """

    with_pendulum: Outcomes
    without_pendulum: Outcomes
    group: np.ndarray
    """Index of the condition, or of the group of ground motions, of every run."""
    labels: tuple[str, ...]
    """Names of the groups."""
    cluster: np.ndarray | None = None
    """Number of the earthquake of every run; None where all runs are independent."""
    counted: np.ndarray | None = None
    """Whether the benefit counts a run; by default it counts all of them. The harm is that of all runs."""
    worse: float = WORSE
    """Share by which the mean severity of a group may be higher with the pendulum."""

    @cached_property
    def description(self) -> str:
        """Number and kind of the counted runs."""
        n, e = self.pairs, self.with_pendulum.ensemble
        kind = f"{n} paired runs of the {self.with_pendulum.equations} equations, seed {e.seed or 0}"
        if self.cluster is None:
            return kind
        events = len(np.unique(self.cluster[self._rows]))
        return f"{kind}, {events} earthquake{'s' if events != 1 else ''}"

    @cached_property
    def severity(self) -> np.ndarray:
        """Severity with and without the pendulum, (2, runs); NaN where a run has no answer."""
        return np.stack([self.with_pendulum.severity, self.without_pendulum.severity])

    @cached_property
    def known(self) -> np.ndarray:
        """Whether a run has an answer in both cases."""
        return ~(self.with_pendulum.undecided | self.without_pendulum.undecided)

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
    def changes(self) -> tuple[Change, ...]:
        """Mean, median and worst severity, and the shares that overturn and that end at rest."""
        rows = self._rows
        pair = self.severity[:, rows]
        cases = self.with_pendulum, self.without_pendulum
        fell = np.array([o.lost[rows] for o in cases], dtype=float)
        rests = np.array([o.status[rows] == Outcome.rest for o in cases], dtype=float)

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
        with_it, without = self.with_pendulum.lost[self.known], self.without_pendulum.lost[self.known]
        return int(np.sum(with_it & ~without)), int(np.sum(without & ~with_it))

    @property
    def overturns_more(self) -> bool:
        """Whether significantly more runs overturn with the pendulum: McNemar's test of independent runs,
        else the interval between earthquakes, of all runs or of one group."""
        if self.cluster is None:
            worse, better = self.only
            return worse > better and chance_of(worse, better) < SIGNIFICANT
        groups = [self.known, *(self.known & (self.group == i) for i in range(len(self.labels)))]
        fell = [o.lost.astype(float) for o in (self.with_pendulum, self.without_pendulum)]
        return any(change(fell[0][rows], fell[1][rows], self._clusters(rows)).is_above for rows in groups)

    @cached_property
    def by_group(self) -> np.ndarray:
        """Mean severity of every group with and without the pendulum, (2, groups); NaN where no run has
        it."""
        n, group = len(self.labels), self.group[self.known]
        count = np.bincount(group, minlength=n)
        sums = np.stack([np.bincount(group, weights=x[self.known], minlength=n) for x in self.severity])
        return np.divide(sums, count, out=np.full_like(sums, np.nan), where=count > 0)

    @cached_property
    def worse_groups(self) -> tuple[int, ...]:
        """Groups whose mean severity is significantly higher with the pendulum by more than `worse`, the one
        with the largest increase first."""
        # One chaotic run decides nothing: pairs must show at 5 % that the mean is higher by more.
        excess = self.severity[0] - (1.0 + self.worse) * self.severity[1] - LEAST * self.worse
        least = -1.0 - self.worse * (1.0 + LEAST)
        found = []
        for i in range(len(self.labels)):
            rows = self.known & (self.group == i)
            if is_positive(excess[rows], least, self._clusters(rows)):
                found.append(i)
        with_it, without = self.by_group
        return tuple(sorted(found, key=lambda i: without[i] - with_it[i]))

    @property
    def rests_less(self) -> bool:
        """Whether significantly fewer runs end at rest with the pendulum, by more than the share `FEWER`."""
        cases = self.with_pendulum, self.without_pendulum
        with_it, without = ((o.status[self.known] == Outcome.rest).astype(float) for o in cases)
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
        mean, low, high = (100.0 * x for x in (self.benefit.mean, self.benefit.low, self.benefit.high))
        if np.isnan(mean):
            return "benefit unknown"
        # A value that rounds to zero must not read "-0".
        less = mean > -0.5
        mean, low, high = (mean, low, high) if less else (-mean, -high, -low)
        around = f" (95 % interval {low:.0f} to {high:.0f} %)" if np.isfinite(low) else ""
        return f"{abs(mean):.0f} % {'less' if less else 'more'} tilt{around}"

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
        mean = dict(zip(("with", "without"), self.by_group.tolist(), strict=True))
        return {
            "runs": self.description,
            "pairs": self.pairs,
            "undecided": self.undecided,
            "benefit": self.benefit,
            "changes": self.changes,
            "overturned_only_with": with_only,
            "overturned_only_without": without_only,
            "groups": list(self.labels),
            "mean_severity": mean,
            "worse_groups": [self.labels[i] for i in self.worse_groups],
            "with": self.with_pendulum.summary(),
            "without": self.without_pendulum.summary(),
        }

    def table(self) -> str:
        """Shares and quantiles of both cases as text."""
        cases = self.with_pendulum, self.without_pendulum
        lines = [f"{cases[0].equations + ' equations':36}{'with pendulum':>26}{'without':>26}"]
        for (name, first), (_, second) in zip(*(o.rows() for o in cases), strict=True):
            lines.append(f"{name:36}{first:>26}{'' if name.startswith('bob') else second:>26}".rstrip())
        if self.undecided:
            counts = (f"{int(o.undecided.sum()):>26}" for o in cases)
            lines.append(f"{UNDECIDED_ROW:36}{''.join(counts)}")
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
    def follow(subject: Parameters | Scene, pendulum: Pendulum | None) -> Outcomes:
        runs: dict[str, Any] = {"ensemble": ensemble, "conditions": conditions, "equations": equations}
        where: dict[str, Any] = {"workers": workers, "cluster": cluster, "progress": progress}
        return outcomes(subject, pendulum, rtol=rtol, **where, **runs)

    return PairedRuns(
        with_pendulum=follow(subject, pendulum),
        without_pendulum=follow(subject if isinstance(subject, Scene) else bare_parameters_of(subject), None),
        group=ensemble.dealt(len(conditions)),
        labels=tuple(map(conditions.label, range(len(conditions)))),
    )


def _of(size: Callable[[np.ndarray], Any], values: np.ndarray) -> float:
    """A size of values, NaN where there are none."""
    return float(size(values)) if len(values) else np.nan
