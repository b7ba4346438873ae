"""Paired runs: each run with and without the pendulum, and the benefit and the harm that the pairs show.

Both cases have the same initial states, phases and scatter (common random numbers), so that common effects
cancel in the difference. A difference is therefore significant with far fewer runs than two independent
shares would need.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.ensemble import Ensemble, outcomes
from tpd.answers.run_table import UNANSWERED_ROW, Runs
from tpd.answers.statistics import (
    SIGNIFICANT,
    Interval,
    chance_of,
    chance_of_either,
    change,
    fall,
    is_positive,
)
from tpd.core import checks
from tpd.core.formatting import Printed, aligned
from tpd.scene.conditions import Conditions
from tpd.scene.parameters import Parameters
from tpd.scene.quantities import parameters_without_pendulum
from tpd.scene.scene import Pendulum, Scene
from tpd.theory.equations import Terms

LEAST = 0.02
"""Smallest mean severity to which changes are related. A smaller mean counts as this value, so that a small
tilt is not a large relative increase where the block is otherwise at rest."""
REST_LOSS = 0.1
"""Share of the runs at rest without the pendulum that may rock with it. With many runs any difference is
significant, so that a tolerance is necessary."""
OVERTURNS = 0.01
"""Share of overturned runs without a pendulum from which the first purpose of a pendulum is to reduce
overturning. Below this share it is to reduce the mean tilt."""
TILT_TOLERANCE = 0.05
"""Relative increase of the mean tilt that is allowed in one group of runs."""


class Change(NamedTuple):
    """Quantity with and without the pendulum. A mean has the 95 % interval of the difference."""

    name: str
    """Name of the quantity."""
    with_pendulum: float
    """Value with the pendulum."""
    without_pendulum: float
    """Value without the pendulum."""
    low: float
    """Lower end of the interval of the difference, with minus without; NaN for a quantity that is not a
    mean."""
    high: float
    """Upper end of this interval."""

    @property
    def difference(self) -> float:
        """Value with the pendulum minus value without it."""
        return self.with_pendulum - self.without_pendulum


class Overturned(NamedTuple):
    """Group of runs of which significantly more overturn with the pendulum."""

    label: str
    """Name of the group; empty for all runs."""
    only_with: int
    """Number of runs that overturn only with the pendulum."""
    only_without: int
    """Number of runs that overturn only without the pendulum."""
    total: int
    """Number of runs of the group."""


class Part(NamedTuple):
    """Runs of one condition, of one group of ground motions, or of one kind of start."""

    label: str
    """Name of the part."""
    rows: np.ndarray
    """Whether each run belongs to the part and has an answer in both cases."""
    with_pendulum: float
    """Mean severity with the pendulum; NaN if the part has no run."""
    without_pendulum: float
    """Mean severity without the pendulum; NaN if the part has no run."""
    is_worse: bool
    """Whether the mean severity with the pendulum is significantly higher, by more than the allowed share."""
    is_start: bool
    """Whether the part is a kind of start. A pendulum must help after every kind of start."""


@dataclass(frozen=True, kw_only=True, repr=False)
class PairedRuns(Printed):
    """Runs with a pendulum, and the same runs without it. Arrays have the shape (runs,).

    Benefit and changes are those of the counted runs with an answer in both cases. The severity of a run is
    its settled tilt divided by the slenderness, at most 1, and 1 if the block overturns.

    Attributes:
        with_pendulum: runs with the pendulum.
        without_pendulum: runs without the pendulum, which are otherwise the same.
        group: index of the group of each run.
        labels: names of the groups.
        cluster: number of the earthquake of each run; None if all runs are independent.
        counted: whether the benefit counts each run; None for all runs.
        worse: relative increase of the mean severity that is allowed in a part.
    """

    with_pendulum: Runs
    """Runs with the pendulum."""
    without_pendulum: Runs
    """Runs without the pendulum, which are otherwise the same."""
    group: np.ndarray
    """Index of the condition, or of the group of ground motions, of each run."""
    labels: tuple[str, ...]
    """Names of the groups."""
    cluster: np.ndarray | None = None
    """Number of the earthquake of each run; None if all runs are independent."""
    counted: np.ndarray | None = None
    """Whether the benefit counts each run; by default it counts all runs. The harm always counts all runs."""
    worse: float = TILT_TOLERANCE
    """Relative increase of the mean severity that is allowed in a part."""
    annual: Callable[[PairedRuns], Any] | None = None
    """Function that returns `annual_rates`."""

    @property
    def _cases(self) -> tuple[Runs, Runs]:
        return self.with_pendulum, self.without_pendulum

    @cached_property
    def description(self) -> str:
        """Text with the number and the kind of the counted runs."""
        runs = self.with_pendulum
        kind = f"{self.pairs} paired runs of the {runs.equations.value} model, seed {runs.seed}"
        if self.cluster is None:
            return kind
        events = len(np.unique(self.cluster[self.rows]))
        return f"{kind}, {events} earthquake{'s' if events != 1 else ''}"

    @cached_property
    def severity(self) -> np.ndarray:
        """Severity with and without the pendulum, shape (2, runs); NaN without a result."""
        return np.stack([runs.severity for runs in self._cases])

    @cached_property
    def is_answered(self) -> np.ndarray:
        """Whether each run has an answer in both cases."""
        return ~np.any([runs.is_unanswered for runs in self._cases], axis=0)

    # The harm counts all answered runs, but the benefit may be restricted to some of them.
    @cached_property
    def rows(self) -> np.ndarray:
        """Whether each run is counted and has an answer in both cases."""
        return self.is_answered if self.counted is None else self.is_answered & self.counted

    @property
    def pairs(self) -> int:
        """Number of counted pairs of runs with an answer in both cases."""
        return int(self.rows.sum())

    @property
    def undecided(self) -> int:
        """Number of pairs of runs without a result in at least one case."""
        return int(np.sum(~self.is_answered))

    def _clusters(self, rows: np.ndarray) -> np.ndarray | None:
        return None if self.cluster is None else self.cluster[rows]

    @cached_property
    def benefit(self) -> Interval:
        """Relative reduction of the mean severity, with its 95 % interval; NaN without any pair."""
        return self._reduction("tilt")

    @cached_property
    def overturning_reduction(self) -> Interval:
        """Relative reduction of the share of overturned runs, with its 95 % interval.

        NaN if no run overturns without the pendulum.
        """
        return self._reduction("overturning")

    @cached_property
    def annual_rates(self) -> Any:
        """Annual rates of overturning in the counted runs, `AnnualRates`; None without a hazard."""
        return self.annual and self.annual(self)

    def _reduction(self, measure: str) -> Interval:
        with_pendulum, without_pendulum = self._pair(measure)
        # A relative reduction of zero overturned runs has no meaning.
        if measure == "overturning" and not without_pendulum.any():
            return Interval(np.nan, np.nan, np.nan)
        clusters = self._clusters(self.rows)
        # The severity is at most 1, so that the mean is finite although overturned runs have infinite tilts.
        return fall(with_pendulum, without_pendulum, clusters, least=LEAST if measure == "tilt" else 0.0)

    def reduction_minus(self, other: PairedRuns, measure: str) -> Interval:
        """Return the reduction of "overturning" or "tilt" in these runs minus the reduction in other runs of
        the same initial states, and the 95 % interval of the paired difference."""
        rows, influences = self.rows & other.rows, []
        for runs in (self, other):
            with_pendulum, without = replace(runs, counted=rows)._pair(measure)
            mean = float(np.mean(without)) if rows.any() else np.nan
            size = max(mean, LEAST if measure == "tilt" else 0.0) or 1.0
            falls = (without - with_pendulum) / size
            # The mean of these numbers is the reduction, and their scatter is that of the ratio.
            influences.append(falls - falls.mean() * (without - mean) / size if rows.any() else falls)
        these, others = influences
        return change(these, others, self._clusters(rows))

    def _pair(self, measure: str) -> np.ndarray:
        """Return the measure of each counted run with and without the pendulum, shape (2, counted runs)."""
        is_tilt = measure == "tilt"
        values = self.severity if is_tilt else np.array([runs.is_overturned for runs in self._cases], float)
        return values[:, self.rows]

    @property
    def first_measure(self) -> str:
        """Name of the quantity to reduce first.

        It is "overturning" if at least 1 % of the runs without the pendulum overturn, otherwise "tilt".
        """
        return "overturning" if self.change("overturned").without_pendulum >= OVERTURNS else "tilt"

    def reduction(self, measure: str) -> tuple[Interval, bool]:
        """Return the relative reduction of "overturning", "tilt" or "rate", and whether it is significant.

        The reduction is significant if the interval of the difference is below zero. With few runs the
        interval of the ratio may be above zero although the difference is not significant.
        """
        if measure == "overturning":
            return self.overturning_reduction, self.change("overturned").high < 0.0
        if measure == "rate":
            # The reduction is significant if the whole interval of the ratio of the rates is below 1. An
            # unknown ratio is NaN, and has not fallen.
            ratio = self.annual_rates.ratio
            of = Interval(1.0 - ratio.mean, 1.0 - ratio.high, 1.0 - ratio.low)
            return of, of.low > 0.0
        return self.benefit, self.change("mean tilt").high < 0.0

    def excess_reduction(self, measure: str, least: float, low: float) -> float:
        """Return how much smaller the reduction of a measure could be in these runs and still be sufficient.

        It is negative or NaN if the reduction is not sufficient.

        Args:
            measure: "overturning", "tilt" or "rate".
            least: smallest reduction.
            low: smallest lower end of its interval. The reduction must also be significant.
        """
        gain, significant = self.reduction(measure)
        # NumPy's minimum is NaN if one of the numbers is NaN.
        return float(np.minimum(gain.mean - least, gain.low - low)) if significant else -np.inf

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """Changes of mean, median and worst severity, and of the shares of two outcomes."""
        rows, pair, overturned = self.rows, self._pair("tilt"), self._pair("overturning")
        rests = np.array([runs.is_at_rest[rows] for runs in self._cases], dtype=float)

        def mean(name: str, values: np.ndarray) -> Change:
            # With a single earthquake the interval is infinite. JSON and tables show it as unknown.
            by = change(values[0], values[1], self._clusters(rows))
            low, high = (x if np.isfinite(x) else np.nan for x in (by.low, by.high))
            return Change(name, _size_of(np.mean, values[0]), _size_of(np.mean, values[1]), low, high)

        def single(name: str, size: Callable[[np.ndarray], Any]) -> Change:
            # Median and worst severity have no simple interval of their difference.
            return Change(name, _size_of(size, pair[0]), _size_of(size, pair[1]), np.nan, np.nan)

        return (
            mean("mean tilt", pair),
            single("median tilt", np.median),
            # The mean of the 10 % of the runs with the largest tilt, because a single run is chance.
            single("worst tilt", lambda x: np.sort(x)[-max(1, len(x) // 10) :].mean()),
            mean("overturned", overturned),
            mean("at rest", rests),
        )

    def change(self, name: str) -> Change:
        """Return the change of the quantity with this name, see `changes`."""
        return next(c for c in self.changes if c.name == name)

    @cached_property
    def only(self) -> tuple[int, int]:
        """Numbers of runs that overturn only with, and only without the pendulum."""
        return self._only(self.is_answered)

    def _only(self, rows: np.ndarray) -> tuple[int, int]:
        """Return these numbers for some of the runs."""
        with_pendulum, without = (runs.is_overturned[rows] for runs in self._cases)
        return int(np.sum(with_pendulum & ~without)), int(np.sum(without & ~with_pendulum))

    @cached_property
    def overturns_more(self) -> Overturned | None:
        """Group of runs of which significantly more overturn with the pendulum, or None.

        The comparison uses McNemar's test if the runs are independent, and compares each kind of start as
        well. Under earthquakes it uses the interval between them, and compares each part as well.
        """
        if self.cluster is None:
            # Independent runs: only those with different outcomes count, see `chance_of`.
            starts = ((part.label, part.rows) for part in self.parts if part.is_start)
            for label, rows in (("", self.is_answered), *starts):
                worse, better = self._only(rows)
                if worse > better and chance_of(worse, better) < SIGNIFICANT:
                    return Overturned(label, worse, better, int(rows.sum()))
            return None
        # Under earthquakes the interval of the difference accounts for runs of the same earthquake. An
        # increase in one part may be hidden in the sum, so that each part is tested as well.
        overturned = [runs.is_overturned.astype(float) for runs in self._cases]
        for label, rows in (("", self.is_answered), *((part.label, part.rows) for part in self.parts)):
            if change(overturned[0][rows], overturned[1][rows], self._clusters(rows)).low > 0.0:
                return Overturned(label, *self._only(rows), int(rows.sum()))
        return None

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Runs of each group and, if the runs have several kinds of start, of each kind.

        The benefit is a mean over all runs. This mean could hide a pendulum that helps if the excitation
        grows slowly and harms if it begins suddenly.
        """
        selections = [(label, self.group == i, False) for i, label in enumerate(self.labels)]
        if len(starts := self.with_pendulum.starts) > 1:
            selections += [(label, rows, True) for label, rows in starts.items()]
        # A part is worse if its pairs show at 5 % that the mean increases by more than the allowed share. One
        # chaotic run alone cannot show this.
        # The term with `LEAST` is the allowance where the block is nearly at rest without the pendulum.
        # `least` is the smallest possible value of the excess: severity 0 with the pendulum and 1 without it.
        excess = self.severity[0] - (1.0 + self.worse) * self.severity[1] - LEAST * self.worse
        least = -1.0 - self.worse * (1.0 + LEAST)
        parts = list[Part]()
        for label, of_part, is_start in selections:
            rows = self.is_answered & of_part
            is_worse = is_positive(excess[rows], least, self._clusters(rows))
            with_pendulum, without = (_size_of(np.mean, x[rows]) for x in self.severity)
            parts.append(Part(label, rows, with_pendulum, without, is_worse, is_start))
        return tuple(parts)

    @cached_property
    def worse_parts(self) -> tuple[Part, ...]:
        """Parts that are worse with the pendulum, the one with the largest increase first."""
        worse = (part for part in self.parts if part.is_worse)
        return tuple(sorted(worse, key=lambda part: part.without_pendulum - part.with_pendulum))

    @property
    def starts_without_benefit(self) -> tuple[Part, ...]:
        """Kinds of start after which the block rocks without the pendulum, and the mean severity with it is
        not lower."""
        # A part has few runs, so that only the benefit over all runs must be significant.
        # A mean severity below `LEAST` leaves nothing to reduce.
        starts = (part for part in self.parts if part.is_start and part.without_pendulum >= LEAST)
        return tuple(part for part in starts if part.with_pendulum >= part.without_pendulum)

    @property
    def rests_less(self) -> bool:
        """Whether significantly fewer runs come to rest with the pendulum, by more than 10 % of them.

        It is false if the pendulum prevents more runs from overturning than from coming to rest.
        """
        with_pendulum, without = (runs.is_at_rest[self.is_answered].astype(float) for runs in self._cases)
        fewer, more = int(np.sum(without > with_pendulum)), int(np.sum(with_pendulum > without))
        with_it, without_it = self.only
        if without_it - with_it > fewer - more:
            return False
        # Two tests: the reduction exceeds the tolerance, and McNemar's test is significant.
        is_above_tolerance = is_positive((1.0 - REST_LOSS) * without - with_pendulum)
        return is_above_tolerance and chance_of(fewer, more) < SIGNIFICANT

    @property
    def ends(self) -> tuple[PairedRuns, ...]:
        """The two extreme outcomes of the runs without a result: all against the pendulum, and all for it.

        The tuple is empty if all runs have an answer.
        """
        # The true outcome lies between these two extremes. A verdict is certain if it holds for both.
        if self.is_answered.all():
            return ()
        ends = ((self.with_pendulum.ended(x), self.without_pendulum.ended(not x)) for x in (True, False))
        return tuple(replace(self, with_pendulum=one, without_pendulum=other) for one, other in ends)

    @property
    def benefit_in_words(self) -> str:
        """Text with the benefit and its interval, such as "33 % less tilt (95 % interval 29 to 37 %)"."""
        if np.isnan(self.benefit.mean):
            return "benefit unknown"
        # A negative benefit is an increase, which the text calls "more tilt".
        less, size, around = self.benefit.fall_in_words()
        return f"{size} {'less' if less else 'more'} tilt{around}"

    @property
    def overturning_in_words(self) -> str:
        """Text with the numbers of runs that overturn in one case only, and whether they are significant."""
        only_with, only_without = self.only
        counts = f"{only_with} runs overturn only with the pendulum and {only_without} only without it"
        # McNemar's probability does not apply to runs of the same earthquake, because they are dependent.
        if only_with == only_without or self.cluster is not None:
            return f"{counts}."
        chance = chance_of_either(only_with, only_without)
        size = "p < 1e-6" if chance < 1e-6 else f"p = {chance:.2g}"
        return f"{counts}: {'' if chance < SIGNIFICANT else 'not '}statistically significant ({size})."

    def summary(self) -> dict[str, Any]:
        """Return both cases, the benefit and the runs that differ, for JSON."""
        with_only, without_only = self.only
        cases = ("with", "without")
        mean = {case: [getattr(part, f"{case}_pendulum") for part in self.parts] for case in cases}
        return {
            "runs": self.description,
            "pairs": self.pairs,
            "undecided": self.undecided,
            "benefit": self.benefit,
            "overturning_reduction": self.overturning_reduction,
            "annual_rates": self.annual_rates,
            "changes": self.changes,
            "overturned_only_with": with_only,
            "overturned_only_without": without_only,
            "groups": [part.label for part in self.parts],
            "mean_tilt": mean,
            "worse_groups": [part.label for part in self.worse_parts],
            "with": self.with_pendulum.summary(),
            "without": self.without_pendulum.summary(),
        }

    def table(self) -> str:
        """Return shares and quantiles of both cases as a table."""
        cases = self._cases
        rows = [[f"{cases[0].equations.value} model", "with pendulum", "without"]]
        pairs = zip(cases[0].rows(), cases[1].rows(has_bob=False), strict=True)
        rows += [[name, first, second] for (name, first), (_, second) in pairs]
        if self.undecided:
            rows.append([UNANSWERED_ROW, *(str(int(o.is_unanswered.sum())) for o in cases)])
        return "\n".join(aligned(rows))

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
    progress: Callable[[int, int], None] | bool | None = None,
) -> PairedRuns:
    """Follow the runs of an ensemble with a pendulum, and the same runs without it.

    Args:
        subject: a scene, or dimensionless parameters (plain numbers).
        pendulum: pendulum of the scene.
        ensemble: number, seed and spreads of the runs; `Ensemble()` by default.
        conditions: conditions that are distributed evenly over the runs, in addition to the scatter; by
            default the condition of the scene.
        equations: linear or nonlinear, see `outcomes`.
        rtol: relative tolerance of a step of the nonlinear model.
        workers: number of threads; all cores by default.
        progress: True for a progress bar on stderr, or a function that is called with (number of finished
            runs, number of all runs), for one case after the other.

    Raises:
        ValueError: bad input, or a pendulum together with dimensionless parameters.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> scene = tpd.paper_scene()
        >>> pendulum = scene.pendulum(mass_ratio=0.4, length_ratio=0.8, damping_ratio=0.3)
        >>> pairs = tpd.paired_runs(scene, pendulum, ensemble=tpd.Ensemble(size=32))
        >>> pairs.pairs, pairs.with_pendulum.share_overturned.value, pairs.benefit.mean > 0.5
        (32, 0.0, True)
    """
    if isinstance(subject, Scene):
        # A scene needs a pendulum. Dimensionless parameters contain one, which must have a mass.
        checks.instance("pendulum", pendulum, Pendulum)
    elif isinstance(subject, Parameters):
        checks.positive("mu", subject.mu)
    ensemble = (Ensemble() if ensemble is None else ensemble).seeded(0)
    conditions = Conditions() if conditions is None else conditions
    # Both cases have the ensemble with the same seed, hence the same initial states, phases and scatter.
    options: dict[str, Any] = {"ensemble": ensemble, "conditions": conditions, "equations": equations}
    options |= {"rtol": rtol, "workers": workers, "progress": progress}
    alone = subject if isinstance(subject, Scene) else parameters_without_pendulum(subject)
    with_pendulum = outcomes(subject, pendulum, **options)
    return PairedRuns(
        with_pendulum=with_pendulum,
        without_pendulum=outcomes(alone, **options),
        group=with_pendulum.condition,
        labels=tuple(map(conditions.label, range(len(conditions)))),
    )


def _size_of(size: Callable[[np.ndarray], Any], values: np.ndarray) -> float:
    """Return the size of values; NaN if there are none."""
    return float(size(values)) if len(values) else np.nan
