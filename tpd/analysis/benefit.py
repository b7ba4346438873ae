"""Benefit of a pendulum over paired runs: how much less the block tilts, with an interval of confidence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from tpd.analysis.outcomes import Outcomes
from tpd.analysis.paired import SIGNIFICANT, Verdict, chance_of

_RESAMPLES, _LEVEL = 2000, 0.95
"""Resamples of the pairs, and the level of the interval that they give."""
_ONE_SIDED = 1.645
"""Quantile of the normal distribution that a one-sided test at 5 % takes."""
_LEAST = 0.02
"""Severity that counts as none, so that next to a bare block at rest not every tilt is a worse one."""


_CHANGES = "mean severity", "median severity", "worst severity", "overturned", "at rest"
"""Names of the changes of a benefit."""


class Change(NamedTuple):
    """One size with the pendulum and without, and their difference with its 95 % interval."""

    name: str
    with_it: float
    without: float
    low: float
    high: float
    """Interval of the difference, with less without."""

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
    """95 % interval, from resampled pairs."""
    changes: tuple[Change, ...]
    """Mean, median and worst severity, and the shares overturned and at rest."""
    worse_conditions: tuple[int, ...]
    """Conditions whose mean severity is significantly higher than the bare block's by more than `share`."""
    by_condition: tuple[np.ndarray, np.ndarray]
    """Mean severity under every condition with the pendulum and without, NaN where no run has it."""
    share: float
    rests_less: bool
    """Whether significantly fewer runs end at rest with the pendulum."""
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
        value = round(self.value, 2) + 0.0
        if value < 0.0:
            return f"{-value:.0%} more tilt (95 % interval {0.0 - self.high:.0%} to {0.0 - self.low:.0%})"
        return f"{value:.0%} less tilt (95 % interval {self.low:.0%} to {self.high:.0%})"


def severity(outcomes: Outcomes, slenderness: float) -> np.ndarray:
    """Settled tilt of every run over the nu that it has (`slenderness` where the runs do not tell), between 0
    and 1; 1 where the block overturns, NaN where a run has no answer."""
    nu = slenderness if outcomes.nu is None else outcomes.nu
    # A bound at 1 keeps means finite: an overturned block is as bad as one on its corner, and no worse.
    tilt = np.where(outcomes.lost, np.inf, outcomes.amplitude) / nu
    return np.where(outcomes.undecided, np.nan, np.minimum(np.where(np.isnan(tilt), np.inf, tilt), 1.0))


def benefit_of(
    verdict: Verdict, slenderness: float, condition: np.ndarray, share: float = 0.05, seed: int = 0
) -> Benefit:
    """Benefit of paired runs; NaN where none of them has an answer.

    Args:
        verdict: the runs with the pendulum and without.
        slenderness: nu of the block.
        condition: index of the condition of every run, shape (runs,).
        share: by which a condition may be worse than without the pendulum.
        seed: of the resampling.
    """
    known = verdict.known
    if not known.all():
        ends = (benefit_of(x, slenderness, condition, share, seed) for x in verdict.ends)
        answered = Verdict(hung=verdict.hung.at(known), bare=verdict.bare.at(known))
        if not known.any():
            return _unknown(condition, share, len(known), tuple(ends))
        found = benefit_of(answered, slenderness, condition[known], share, seed)
        return replace(found, undecided=int(np.sum(~known)), ends=tuple(ends))
    hung, bare = severity(verdict.hung, slenderness), severity(verdict.bare, slenderness)
    n = len(hung)
    # Pairs are drawn together, so that what both share cancels in the differences.
    rows = np.random.default_rng([seed, 7]).integers(0, n, (_RESAMPLES, n))
    tilts, lost = _Pairs(hung, bare, rows), _Pairs(1.0 * verdict.hung.lost, 1.0 * verdict.bare.lost, rows)
    low, high = _interval(_fall(_mean(tilts.hung_again), _mean(tilts.bare_again)))
    rest_with, rest_without = (o.status == "rest" for o in (verdict.hung, verdict.bare))
    fewer, more = int(np.sum(rest_without & ~rest_with)), int(np.sum(rest_with & ~rest_without))
    return Benefit(
        value=float(_fall(hung.mean(), bare.mean())),
        low=low,
        high=high,
        changes=(
            tilts.change(_CHANGES[0], _mean),
            tilts.change(_CHANGES[1], _median),
            tilts.change(_CHANGES[2], _worst),
            lost.change(_CHANGES[3], _mean),
            _Pairs(1.0 * rest_with, 1.0 * rest_without, rows).change(_CHANGES[4], _mean),
        ),
        worse_conditions=_worse(hung, bare, condition, share),
        by_condition=(_by_condition(hung, condition), _by_condition(bare, condition)),
        share=share,
        rests_less=fewer > more and chance_of(fewer, more) < SIGNIFICANT,
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


def _mean(x: np.ndarray) -> Any:
    return x.mean(axis=-1)


def _median(x: np.ndarray) -> Any:
    return np.median(x, axis=-1)


def _worst(x: np.ndarray) -> Any:
    """Mean of the worst tenth: the largest of all runs alone would say little."""
    # Of few runs at least one.
    k = max(1, x.shape[-1] // 10)
    return np.sort(x, axis=-1)[..., -k:].mean(axis=-1)


def _fall(hung: Any, bare: Any) -> Any:
    """Share by which severities fall, numbers or arrays; 0 where both are zero."""
    # Relative to a bare block that hardly moves every tilt would be an endless harm.
    return (np.asarray(bare) - hung) / np.maximum(bare, _LEAST)


def _interval(values: np.ndarray) -> tuple[float, float]:
    tail = 0.5 * (1.0 - _LEVEL)
    low, high = np.quantile(values, [tail, 1.0 - tail], method="inverted_cdf")
    return float(low), float(high)


class _Pairs:
    """A number of every run, with the pendulum and without, and as resampled: rows of pairs."""

    def __init__(self, hung: np.ndarray, bare: np.ndarray, rows: np.ndarray) -> None:
        self.hung, self.bare, self.hung_again, self.bare_again = hung, bare, hung[rows], bare[rows]

    def change(self, name: str, of: Callable[[np.ndarray], Any]) -> Change:
        """Change of a size of all runs."""
        low, high = _interval(of(self.hung_again) - of(self.bare_again))
        return Change(name, float(of(self.hung)), float(of(self.bare)), low, high)


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
        excess = hung[of] - (1.0 + share) * bare[of] - _LEAST * share
        error = excess.std(ddof=1) / np.sqrt(of.sum()) if of.sum() > 1 else np.inf
        if excess.mean() > _ONE_SIDED * error:
            out.append(int(i))
    return tuple(out)
