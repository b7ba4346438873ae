"""Verification by paired runs of the nonlinear equations: the benefit of a design, its room on the way, and
both under other models of the block's losses."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.ensemble import Ensemble, Outcomes, outcomes
from tpd.answers.paired import Benefit, Verdict, benefit_of, verdict
from tpd.core.progress import Progress, unreported
from tpd.design.criteria import Worth
from tpd.design.verified import LossCase, Reason, ReasonKind, Step, Verified
from tpd.scene.bob import Bob
from tpd.scene.conditions import Conditions
from tpd.scene.scene import HOUSNER, Block, Pendulum, Scene
from tpd.theory import equivalent_friction

TRIALS, JUDGES = 1, 2
"""Seeds of the runs that order designs, and of those that judge the chosen one, less that of the ensemble."""
_LOSS_RUNS = 128
"""Most paired runs under another model of the losses."""
_USUAL = 1.0 / 3.0
"""Tilt over nu at which friction and impacts are made to lose the same energy."""


class PairedRuns:
    """Runs of the nonlinear equations, the same ones with every design and without a pendulum."""

    def __init__(
        self,
        scene: Scene,
        conditions: Conditions,
        ensemble: Ensemble,
        worth: Worth,
        progress: Progress | None,
    ) -> None:
        self.scene, self.conditions, self.worth = scene, conditions, worth
        self.progress = progress or unreported
        most = ensemble.size if worth.runs is None else worth.runs
        self.ensemble = replace(ensemble, size=min(ensemble.size, most))
        self._bare: Outcomes | None = None

    @property
    def bare(self) -> Outcomes:
        """Runs of the bare block, followed once."""
        if self._bare is None:
            self._bare = outcomes(self.scene, **self._runs)
        return self._bare

    def of(self, pendulum: Pendulum) -> tuple[Verdict, Benefit]:
        """Paired runs with a pendulum, and its benefit."""
        found = verdict(self.scene, pendulum, bare=self.bare, **self._runs)
        condition = self.ensemble.dealt(len(self.conditions))
        return found, benefit_of(found, float(self.scene.block.slenderness), condition, self.worth.worse)

    def under_other_losses(self, pendulum: Pendulum) -> tuple[LossCase, ...]:
        """The pendulum where the block loses energy by friction alone, by impacts alone, and by both."""
        fewer, out = replace(self.ensemble, size=min(self.ensemble.size, _LOSS_RUNS)), []
        for name, block in loss_models(self.scene).items():
            scene = Scene(block, self.scene.motion, self.scene.gravity)
            runs = PairedRuns(scene, self.conditions, fewer, self.worth, self.progress)
            found, benefit = runs.of(pendulum)
            case = LossCase(
                name=name,
                friction=float(block.friction or 0.0),
                velocity_ratio=float(block.velocity_ratio),
                benefit=benefit,
                overturned=found.hung.overturned,
                overturned_bare=found.bare.overturned,
                at_rest=found.hung.at_rest,
                at_rest_bare=found.bare.at_rest,
            )
            out.append(case)
        return tuple(out)

    @property
    def _runs(self) -> dict[str, Any]:
        common = {"ensemble": self.ensemble, "conditions": self.conditions, "equations": "nonlinear"}
        return {**common, "progress": partial(self.progress, "paired runs")}


def loss_models(scene: Scene) -> dict[str, Block]:
    """The block with the losses of friction, of impacts and of both: its own where it has them, else a
    friction that loses as much as the impacts, or Housner's impacts."""
    block, p = scene.block, scene.parameters()
    e = float(block.velocity_ratio)
    k = float(block.friction or 0.0)
    impacts = HOUSNER if block.restitution is None else block.restitution
    friction = k or float(equivalent_friction(p, _USUAL * float(p.nu))) if e < 1.0 else k
    return {
        "friction": replace(block, friction=friction, restitution=None),
        "impacts": replace(block, friction=0.0, restitution=impacts),
        "friction and impacts": replace(block, friction=friction, restitution=impacts),
    }


def reach_of(found: Outcomes, pendulum: Pendulum, block: Block, bob: Bob) -> np.ndarray:
    """How far the bob comes, on the way or settled, over the distance of the wall, in each run that is known
    to stand; the largest bob angle and the largest tilt are added, which is never too little."""
    stands = ~(found.lost | found.undecided)
    angle = turned_in(found)
    # Block and pendulum of every run, as they are; the walls come nearer with the block's width.
    mass = pendulum.mass if found.mu is None else block.mass * found.mu[stands]
    rod = pendulum.length if found.lam is None else block.half_height * found.lam[stands]
    wall = 0.5 * float(block.room)
    if found.nu is not None:
        wall = wall * found.nu[stands] / float(block.slenderness)
    return np.asarray(bob.reach(mass, rod, angle)) / wall


def turned_in(found: Outcomes) -> np.ndarray:
    """Sum of the largest bob angle and the largest tilt (rad) in each run that is known to stand: never less
    than the angle between rod and block."""
    return (found.peak_stroke + found.peak)[~(found.lost | found.undecided)]


def strikes_of(found: Verdict, pendulum: Pendulum, block: Block, bob: Bob) -> float:
    """Share of the runs with the pendulum that are known to stand in which the bob reaches a wall."""
    reach = reach_of(found.hung, pendulum, block, bob)
    return float(np.mean(reach > 1.0)) if len(reach) else 0.0


def reasons_by_runs(
    v: Verified, worth: Worth, conditions: Conditions, step: Step = Step.benefit
) -> tuple[Reason, ...]:
    """Reasons against a design by its paired runs; `step` says which runs they are."""
    assert v.paired is not None
    assert v.benefit is not None
    found, gain, out = v.paired, v.benefit, []

    def refuse(kind: ReasonKind, value: float, reference: float = math.nan, **more: Any) -> None:
        out.append(Reason(step=step, kind=kind, value=value, reference=reference, **more))

    if found.harms:
        refuse(ReasonKind.overturns_more, float(found.worse), float(found.better), total=gain.runs)
    if v.strikes > worth.allowed:
        refuse(ReasonKind.strikes, v.strikes, worth.allowed)
    if gain.rests_less:
        rest, bare = (float(np.sum(o.status == "rest")) for o in (found.hung, found.bare))
        refuse(ReasonKind.rests_less, rest, bare, total=gain.runs)
    if gain.worse_conditions:
        # Of the conditions that the design makes worse the one that it makes worse by most.
        with_it, without = gain.by_condition
        worst = max(gain.worse_conditions, key=lambda i: with_it[i] - without[i])
        where = {"condition": conditions.label(worst), "total": len(gain.worse_conditions)}
        refuse(ReasonKind.worse_condition, float(with_it[worst]), float(without[worst]), **where)
    # Where no run has an answer there is no benefit either. In few runs the interval of a ratio of means may
    # lie above zero where that of their difference does not.
    if not (gain.value >= worth.at_least and gain.low > 0.0 and gain.changes[0].high < 0.0):
        refuse(ReasonKind.too_little_benefit, gain.value, worth.at_least, low=gain.low)
    if gain.ends:
        # The verdict hangs on runs without an answer where it is another one if they end otherwise.
        hung, verdicts = found.hung, {bool(out)}
        stands, unknown = np.sum(~(hung.lost | hung.undecided)), np.sum(hung.undecided)
        # A run that stands may strike, which is against the pendulum as well.
        strikes = (v.strikes * stands + np.array([unknown, 0])) / max(stands + unknown, 1)
        for paired, benefit, struck in zip(found.ends, gain.ends, strikes, strict=True):
            end = replace(v, paired=paired, benefit=benefit, strikes=float(struck))
            verdicts.add(bool(reasons_by_runs(end, worth, conditions)))
        if len(verdicts) > 1:
            refuse(ReasonKind.undecided, float(gain.undecided), total=gain.undecided + gain.runs)
    return tuple(out)
