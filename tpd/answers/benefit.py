"""Benefit of a pendulum over paired runs: how much less the block tilts, with an interval of confidence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from tpd.answers.intervals import change, fall
from tpd.answers.outcomes import Outcomes
from tpd.answers.paired import SIGNIFICANT, Verdict, chance_of

LEAST = 0.02
"""Severity that counts as none, so that next to a bare block at rest not every tilt is a worse one."""


FEWER = 0.1
"""Share of the runs that end at rest without the pendulum which may rock with it: with runs enough any
difference is significant."""
_CHANGES = "mean severity", "median severity", "worst severity", "overturned", "at rest"
"""Names of the changes of a benefit."""


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
    """95 % interval, see `tpd.answers.intervals.fall`."""
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
    known = verdict.known
    if not known.all():
        ends = (benefit_of(x, slenderness, condition, share) for x in verdict.ends)
        answered = Verdict(hung=verdict.hung.at(known), bare=verdict.bare.at(known))
        if not known.any():
            return _unknown(condition, share, len(known), tuple(ends))
        found = benefit_of(answered, slenderness, condition[known], share)
        return replace(found, undecided=int(np.sum(~known)), ends=tuple(ends))
    hung, bare = severity(verdict.hung, slenderness), severity(verdict.bare, slenderness)
    n = len(hung)
    # Runs of one condition differ as those of different ones do: each is a cluster of its own.
    found = fall(hung, bare, least=LEAST)
    rest_with, rest_without = ((o.status == "rest").astype(float) for o in (verdict.hung, verdict.bare))
    fewer, more = (int(np.sum(x > 0.0)) for x in (rest_without - rest_with, rest_with - rest_without))
    return Benefit(
        value=found.mean,
        # Of a single run nothing is known but the value.
        low=found.low if np.isfinite(found.low) else np.nan,
        high=found.high if np.isfinite(found.low) else np.nan,
        changes=(
            _mean_change(_CHANGES[0], hung, bare),
            Change(_CHANGES[1], float(np.median(hung)), float(np.median(bare)), np.nan, np.nan),
            Change(_CHANGES[2], _worst(hung), _worst(bare), np.nan, np.nan),
            _mean_change(_CHANGES[3], verdict.hung.lost, verdict.bare.lost),
            _mean_change(_CHANGES[4], rest_with, rest_without),
        ),
        worse_conditions=_worse(hung, bare, condition, share),
        by_condition=(_by_condition(hung, condition), _by_condition(bare, condition)),
        share=share,
        rests_less=_above((1.0 - FEWER) * rest_without - rest_with) and chance_of(fewer, more) < SIGNIFICANT,
        runs=n,
    )


def _unknown(condition: np.ndarray, share: float, runs: int, ends: tuple[Benefit, ...]) -> Benefit:
    """Benefit of paired runs none of which has an answer."""
    none, conditions = np.nan, np.full(int(condition.max()) + 1, np.nan)
    return Benefit(
        value=none,
        low=none,
        high=none,
        changes=tuple(Change(name, none, none, none, none) for name in _CHANGES),
        worse_conditions=(),
        by_condition=(conditions, conditions),
        share=share,
        rests_less=False,
        runs=0,
        undecided=runs,
        ends=ends,
    )


def _mean_change(name: str, hung: np.ndarray, bare: np.ndarray) -> Change:
    by = change(hung, bare)
    low, high = (x if np.isfinite(x) else np.nan for x in (by.low, by.high))
    return Change(name, float(hung.mean()), float(bare.mean()), low, high)


def _worst(x: np.ndarray) -> float:
    """Mean of the worst tenth: the largest of all runs alone would say little."""
    # Of few runs at least one.
    return float(np.sort(x)[-max(1, len(x) // 10) :].mean())


def _by_condition(values: np.ndarray, condition: np.ndarray) -> np.ndarray:
    n = int(condition.max()) + 1
    count = np.bincount(condition, minlength=n)
    with np.errstate(invalid="ignore"):
        return np.bincount(condition, weights=values, minlength=n) / np.where(count > 0, count, np.nan)


def _worse(hung: np.ndarray, bare: np.ndarray, condition: np.ndarray, share: float) -> tuple[int, ...]:
    """Conditions in which the pairs show, at 5 %, that the mean severity is higher by more than `share`."""
    out = []
    for i in np.unique(condition):
        of = condition == i
        # One chaotic run decides nothing: the mean over the pairs of a condition must be clearly above.
        if _above(hung[of] - (1.0 + share) * bare[of] - LEAST * share):
            out.append(int(i))
    return tuple(out)


def _above(excess: np.ndarray) -> bool:
    """Whether the mean over pairs is above zero, at 5 %."""
    n = len(excess)
    return n > 1 and bool(excess.mean() > stdtrit(n - 1, 0.95) * excess.std(ddof=1) / np.sqrt(n))
