"""Pendulum for a block under ground motions: the answer of the search and of its judgement."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.paired import LEAST, Change
from tpd.answers.statistics import Interval, fall
from tpd.answers.statistics import change as difference_of
from tpd.design.criteria import Worth
from tpd.design.ground.judgement import Benefit, Group, Judged, Role, benefit_of, pairs_of, scatter_of
from tpd.design.ground.objective import GroundObjective
from tpd.design.ground.search import Evaluated
from tpd.design.problem import Question
from tpd.design.result import Comparison, Design, DesignStatus
from tpd.design.surface import Surface
from tpd.scene.conditions import Conditions
from tpd.scene.scene import Scene

LEAST_EARTHQUAKES = 5
"""Earthquakes that a design must be tuned to, and as many that it must be judged on, for a verdict: of fewer
the spread between earthquakes is hardly known."""


def objective_of(asked: Question) -> GroundObjective:
    """Objective of a question about ground motions."""
    scene, worth = asked.scene, asked.worth
    return GroundObjective(scene.block, asked.conditions, asked.limits, worth.broken, float(scene.gravity))


class GroundVerdict(NamedTuple):
    """Status of a design, and the reasons against it, the weightiest first."""

    status: DesignStatus
    reasons: tuple[str, ...]


def verdict_of(judged: tuple[Judged, ...], worth: Worth) -> GroundVerdict:
    """Verdict on a design that was judged on the group it is tuned to, and on others.

    Args:
        judged: the groups.
        worth: least share by which the mean tilt must fall on motions held out, and share of the standing
            runs that may break a limit.

    Returns:
        A status that holds whichever way the runs without an answer would have ended, or `undecided`.
    """
    found, unknown = _known_verdict(judged, worth), sum(g.undecided for g in judged)
    if not unknown:
        return found
    ends = [_known_verdict(tuple(g.ends[i] if g.ends else g for g in judged), worth).status for i in (0, 1)]
    if ends == [found.status] * 2:
        return found
    total = sum(4 * g.motions * len(g.stripes) for g in judged)
    hangs = (
        f"{unknown} of the {total} runs of the judgement have no answer, and the verdict hangs on them: "
        f"`{ends[0].name}` if they end against the pendulum, and `{ends[1].name}` if they end for it"
    )
    return GroundVerdict(DesignStatus.undecided, (hangs,))


def _known_verdict(judged: tuple[Judged, ...], worth: Worth) -> GroundVerdict:
    """Verdict by the runs that have an answer."""
    harms, strikes, others, benefit = [], [], [], benefit_of(judged)
    # Harm on any group counts, also on motions that the design is tuned to.
    for g in judged:
        on = "on motions held out" if g.name == g.role.value else f"on {g.name} (held out)"
        on = "on the motions that it is tuned to" if g.role is Role.tuned else on
        for change, by in ((g.difference, ""), (g.linear, " by the linear equations")):
            if change.is_above:
                harms.append(
                    f"{on} the block overturns more often with the best design{by}, {change.words()}"
                )
        if g.tilt.is_above:
            rise = g.tilt.words(share=False)
            harms.append(f"{on} the mean tilt over the slenderness rises with the best design, {rise}")
        if g.strikes > worth.broken:
            strikes.append(
                f"{on} a limit is broken in {g.strikes:.1%} of the runs in which the block stands, and "
                f"{worth.broken:.1%} are allowed"
            )
    if benefit is not None and not harms:
        if benefit.overturned.is_above:
            harms.append(
                f"over all motions held out the block overturns more often, {benefit.overturned.words()}"
            )
        if benefit.tilt.is_above:
            harms.append(
                f"over all motions held out the mean tilt rises by {benefit.tilt.words(share=False)}"
            )
    # Earthquakes that the design is tuned to, and those that it is judged on.
    events = ([g.runs.clusters for g in judged if g.role is role] for role in (Role.tuned, Role.held_out))
    tuned, held = (len(np.unique(np.concatenate([*found, []]))) for found in events)
    status = DesignStatus.found
    if benefit is None:
        status = DesignStatus.tuned_only
    elif min(tuned, held) < LEAST_EARTHQUAKES:
        status = DesignStatus.too_few
        others.append(
            f"the best design is tuned to {tuned} and judged on {held}, and {LEAST_EARTHQUAKES} earthquakes "
            "on either side are the least for a judgement"
        )
    elif not (benefit.tilt.is_below or benefit.overturned.is_below):
        status = DesignStatus.refused
        others.append(
            "on ground motions that the best design was not tuned to no benefit is significant, neither in "
            f"the mean tilt over the slenderness, {benefit.tilt.words(share=False)}, nor in the share that "
            f"overturns, {benefit.overturned.words()}"
        )
    elif benefit.saved.mean < worth.at_least:
        # A benefit that is sure may still be too small for the work of hanging it.
        status = DesignStatus.refused
        others.append(
            "on ground motions that the best design was not tuned to the mean tilt falls by "
            f"{benefit.saved.mean:.1%}, and {worth.at_least:.1%} were asked for"
        )
    if harms or strikes:
        status = DesignStatus.refused
    return GroundVerdict(status, (*harms, *strikes, *others))


@dataclass(frozen=True, kw_only=True, repr=False)
class GroundDesign(Design):
    """Answer of a search on ground motions, with its question."""

    groups: tuple[Group, ...]
    """Motions that the design is tuned to, and those that are held out."""
    reasons: tuple[str, ...]
    """Reasons against the best design, or for want of one; empty where it is offered."""
    best: np.ndarray | None
    """(mu, lam, zeta) of the best design that was followed, offered or not."""
    value: float
    """Risk of the severities of the runs with the best design, see `Runs`."""
    trend: tuple[float, float]
    """Risk of the best design as the response surface sees it, and its standard deviation."""
    bare: float
    """Risk of the bare block."""
    searched: Evaluated | None
    surface: Surface | None
    names: tuple[str, ...]
    """Limited quantities, the columns of `searched.sizes`."""
    usage: np.ndarray | None
    """These of the best design by the nonlinear equations, as `searched.sizes` has them by the linear ones;
    None where nothing was judged."""
    judged: tuple[Judged, ...]
    swing_met: float
    """Largest angle between rod and block (rad) of the best design on the motions that it is tuned to, by the
    nonlinear equations, where the block stands; NaN where nothing was judged."""

    @property
    def swing(self) -> float:
        """See `Design.swing`."""
        return self.swing_met if math.isfinite(self.swing_met) else 0.0

    @property
    def objective(self) -> GroundObjective:
        """Designs under the motions of the group that they are tuned to."""
        return objective_of(self)

    @property
    def refusals(self) -> tuple[str, ...]:
        """See `Design.refusals`."""
        return self.reasons

    @property
    def comparison(self) -> Comparison | None:
        """See `Design.comparison`: on all motions that were held out, or on all if none were."""
        held = [g for g in self.judged if g.role is Role.held_out] or list(self.judged)
        runs = pairs_of(held)
        if runs is None:
            return None
        fell, tilt, clusters = runs
        where = "held out" if held[0].role is Role.held_out else "that it is tuned to"
        changes = []
        for name, x in (("mean severity", tilt), ("overturned", fell.astype(float))):
            d = difference_of(x[1], x[0], clusters)
            changes.append(Change(name, float(x[1].mean()), float(x[0].mean()), d.low, d.high))
        hung, bare = (float(np.median(x)) for x in (tilt[1], tilt[0]))
        changes.insert(1, Change("median severity", hung, bare, math.nan, math.nan))
        stands = [float(np.sum(~g.runs.overturned[1])) for g in held]
        broken = sum(n * g.strikes for n, g in zip(stands, held, strict=True)) / max(sum(stands), 1.0)
        return Comparison(
            runs=f"{len(clusters)} paired runs of the nonlinear equations on {sum(g.motions for g in held)} "
            f"ground motions {where}, of earthquakes {len(np.unique(clusters))}, seed {self.seed}",
            saved=fall(tilt[1], tilt[0], clusters, least=LEAST),
            changes=tuple(changes),
            strikes=broken,
            undecided=sum(int(g.unknown[0].sum() + g.unknown[1].sum()) for g in held),
        )

    @property
    def turned(self) -> np.ndarray:
        """See `Design.turned`."""
        if self.best is None or not self.judged:
            return np.zeros(0)
        relative = self.objective.check(self.best[None]).relative[0]
        return relative[np.isfinite(relative)]

    @property
    def harmful(self) -> bool:
        """See `Design.harmful`."""
        more = self.benefit is not None and self.benefit.overturned.is_above
        return more or any(g.overturns_more or g.strikes > self.worth.broken for g in self.judged)

    def saved_under(self, scene: Scene, more: Conditions, runs: int) -> Interval:
        """See `Design.saved_under`: over all motions that were held out, or all if none were."""
        groups = [g for g in self.groups if g.role is Role.held_out] or list(self.groups)
        scales = sorted(set(self.conditions.scales))
        hung, bare, clusters = [], [], []
        assert self.best is not None
        both = np.stack([[0.0, *self.best[1:]], self.best])
        for g in groups:
            scatter = scatter_of(scene.block, self.ensemble)
            if scene is not self.scene:
                scatter.pop("restitution", None)
            conditions = Conditions.records(
                g.motions, scales, intensity=self.conditions.intensity, scatter=scatter, seed=self.seed
            )
            there = replace(self.objective, block=scene.block, conditions=conditions * more)
            tilt = there.check(both).severity
            known = np.isfinite(tilt).all(axis=0)
            bare.append(tilt[0, known])
            hung.append(tilt[1, known])
            clusters.append(np.repeat(g.events, len(scales))[known])
        return fall(*map(np.concatenate, (hung, bare, clusters)), least=LEAST)

    @property
    def benefit(self) -> Benefit | None:
        """Benefit over all motions that were held out; None where nothing was judged on others."""
        return benefit_of(self.judged)

    @property
    def saved(self) -> Interval | None:
        """See `Design.saved`."""
        return None if self.pendulum is None or self.benefit is None else self.benefit.saved

    @property
    def risks(self) -> tuple[float, float]:
        """See `Design.risks`."""
        return math.nan if self.pendulum is None else self.value, self.bare

    def again(self, **changed: Any) -> dict[str, Any]:
        """See `Design.again`."""
        held = {g.name: g.motions for g in self.groups if g.role is Role.held_out}
        return super().again(**{"held_out": held} | changed)
