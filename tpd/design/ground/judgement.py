"""Judgement of a design on groups of ground motions: paired with the bare block, run by run.

Runs of one earthquake are no independent observations: the clusters of `tpd.answers.statistics`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tpd.answers.ensemble import Ensemble
from tpd.answers.statistics import Interval, Lognormal, change, fall, fit_lognormal
from tpd.design.ground.groups import Group, Role
from tpd.design.ground.objective import GroundObjective, Runs
from tpd.scene.conditions import Conditions
from tpd.scene.scene import Block

SCATTERED = "slenderness", "friction", "mass", "length", "damping", "restitution"
"""Names of what is uncertain in a judgement: block and installation, as in the runs of an `Ensemble`."""


class Pairs(NamedTuple):
    """Runs of the nonlinear equations without the pendulum and with it, shape (2, runs)."""

    overturned: np.ndarray
    tilt: np.ndarray
    """Tilt over the slenderness, an overturning as 1."""
    clusters: np.ndarray
    """Number of the earthquake of every run, the same in all groups of a design, shape (runs,)."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A group of ground motions with and without the pendulum; shares are of the runs."""

    name: str
    role: Role
    motions: int
    events: int
    stripes: np.ndarray
    counts: tuple[np.ndarray, np.ndarray]
    """Motions that overturn the block at each stripe by the nonlinear equations, bare and hung."""
    unknown: tuple[np.ndarray, np.ndarray]
    """Motions without an answer at each stripe by these equations, bare and hung: they are in no count."""
    overturned: tuple[float, float]
    """Shares of the pairs with an answer that overturn, over all stripes, bare and hung."""
    difference: Interval
    """Share overturned with the pendulum minus that without, nonlinear equations."""
    linear: Interval
    """Difference by the linear equations, with which the search worked."""
    tilt: Interval
    """Difference of the mean tilt over the slenderness, an overturning as 1; nonlinear equations."""
    strikes: float
    """Share of the standing runs in which a limit is broken; nonlinear equations."""
    linear_strikes: float
    """This share by the linear equations."""
    changed: float
    """Share of the runs whose verdict the nonlinear equations change."""
    undecided: int
    """Runs without an answer, bare and hung, by both sets of equations: shares and means leave them out."""
    fits: tuple[Lognormal, Lognormal]
    """Curves of overturning, bare and hung."""
    runs: Pairs
    """The single runs."""
    ends: tuple[Judged, ...] = ()
    """The group with each run without an answer ended against the pendulum, and with each ended for it; empty
    where all runs have an answer."""

    @property
    def overturns_more(self) -> bool:
        """Whether the pendulum makes the block overturn more often, significantly."""
        return self.difference.is_above or self.linear.is_above

    @property
    def harms(self) -> bool:
        """Whether the pendulum makes the block overturn or tilt more, significantly."""
        return self.overturns_more or self.tilt.is_above


def scatter_of(block: Block, ensemble: Ensemble | None = None) -> dict[str, float]:
    """Relative half widths of what is uncertain in a block and its pendulum."""
    widths = (Ensemble() if ensemble is None else ensemble).widths(block.restitution)
    absent = () if block.friction else ("friction",)
    return {name: widths[name] for name in SCATTERED if widths[name] > 0.0 and name not in absent}


def judge(
    objective: GroundObjective,
    design: np.ndarray,
    group: Group,
    scales: Sequence[float],
    *,
    scatter: Mapping[str, float],
    seed: int,
    progress: Callable[[int, int], None] | None = None,
) -> Judged:
    """Follow the block without and with one design (mu, lam, zeta) through a group of motions at every scale,
    by the linear and the nonlinear equations, on the same scattered blocks."""
    intensity = objective.conditions.intensity
    conditions = Conditions.records(group.motions, scales, intensity=intensity, scatter=scatter, seed=seed)
    there = objective.over(conditions)
    # A bob without mass does not act on the block: both designs meet the same scattered blocks.
    both = np.stack([[0.0, *design[1:]], design])
    linear = there.evaluate(both, progress=progress)
    nonlinear = there.check(both, progress=progress)
    found = _judged(there, both, group, scales, linear, nonlinear)
    if not found.undecided:
        return found
    # Whatever the runs without an answer would have ended in lies between these two.
    ends = []
    for against in (True, False):
        ended = (x.ended(bare=not against, hung=against) for x in (linear, nonlinear))
        one = _judged(there, both, group, scales, *ended)
        # A run that stands may break a limit, which would be against the pendulum as well.
        stands, unknown = (
            float(np.sum(~(nonlinear.overturned | nonlinear.undecided)[1])),
            found.unknown[1].sum(),
        )
        broken = found.strikes * stands + (unknown if against else 0.0)
        ends.append(replace(one, strikes=float(broken / max(stands + unknown, 1.0))))
    return replace(found, ends=tuple(ends))


def _judged(
    objective: GroundObjective,
    both: np.ndarray,
    group: Group,
    scales: Sequence[float],
    linear: Runs,
    nonlinear: Runs,
) -> Judged:
    """A group by its runs of the bare block and the hung one; pairs without an answer are left out."""
    every = np.repeat(group.events, len(scales))
    known, known_linear = (~x.undecided.any(axis=0) for x in (nonlinear, linear))
    clusters = every[known]
    fell, tilts = nonlinear.overturned[:, known], nonlinear.severity[:, known]
    fell_linear = linear.overturned[:, known_linear]
    both_known = known & known_linear
    differs = (linear.overturned != nonlinear.overturned)[:, both_known]
    per_stripe = [
        x.reshape(-1, len(scales)).sum(axis=0) for x in (*nonlinear.overturned, *nonlinear.undecided)
    ]
    return Judged(
        name=group.name,
        role=group.role,
        motions=len(group.motions),
        events=len(np.unique(clusters)),
        stripes=np.asarray(scales, dtype=float),
        counts=(per_stripe[0], per_stripe[1]),
        unknown=(per_stripe[2], per_stripe[3]),
        overturned=(_mean(fell[0]), _mean(fell[1])),
        difference=change(fell[1], fell[0], clusters),
        linear=change(fell_linear[1], fell_linear[0], every[known_linear]),
        tilt=change(tilts[1], tilts[0], clusters),
        strikes=objective.broken(nonlinear.at(slice(1, 2)), both[1:]),
        linear_strikes=objective.broken(linear.at(slice(1, 2)), both[1:]),
        changed=_mean(differs),
        undecided=int(linear.undecided.sum() + nonlinear.undecided.sum()),
        fits=(_fit(nonlinear, 0, scales, group.events), _fit(nonlinear, 1, scales, group.events)),
        runs=Pairs(fell, tilts, clusters),
    )


def _mean(values: np.ndarray) -> float:
    """Mean of all values; NaN of none."""
    return float(np.mean(values)) if values.size else math.nan


class Benefit(NamedTuple):
    """Changes by the pendulum over all held-out motions together."""

    overturned: Interval
    """Share of the runs that overturn."""
    tilt: Interval
    """Mean tilt over the slenderness, an overturning as 1."""
    saved: Interval
    """Share by which that mean falls."""


def benefit_of(judged: Sequence[Judged]) -> Benefit | None:
    """Benefit over all groups that were held out; None without any pair of runs that has an answer."""
    held = [g.runs for g in judged if g.role is Role.held_out and g.runs.clusters.size]
    if not held:
        return None
    fell, tilt, clusters = (np.concatenate(x, axis=-1) for x in zip(*held, strict=True))
    both = change(fell[1], fell[0], clusters), change(tilt[1], tilt[0], clusters)
    return Benefit(*both, fall(tilt[1], tilt[0], clusters))


def _fit(runs: Runs, row: int, scales: Sequence[float], events: np.ndarray) -> Lognormal:
    hits = np.where(runs.undecided[row], np.nan, runs.overturned[row])
    return fit_lognormal(np.asarray(scales, dtype=float), hits.reshape(-1, len(scales)), events)
