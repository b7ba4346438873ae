"""Verification: which of the designs that a search found are verified, in which order, until one passes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tpd.answers.ensemble import Outcomes, outcomes
from tpd.answers.paired import FEWER, severity
from tpd.design.by_runs import TRIALS, reach_of
from tpd.design.criteria import Room, limit_of
from tpd.design.refine import RUNS, Refinement, Tried, refine
from tpd.design.result import DesignStatus
from tpd.design.search import Multistart, stage
from tpd.design.steps import Steps, pendulum_of
from tpd.design.survey import ON_THE_WAY, Survey, excess
from tpd.scene.conditions import Conditions
from tpd.scene.scene import Pendulum
from tpd.theory.equations import Terms

VERIFIED, JUDGED = 10, 3
"""Most designs of a survey that are verified, and most of them that are judged."""
_APART = 0.02
"""Least distance of designs that are verified one after the other, in shares of the bounds."""
_FURTHER, _SURER = 0.02, 0.6
"""Share of the way to the walls by which the next design keeps further off, and factor on what is unsure."""
_APART_SEEDS = 7919
"""Between the seeds of trial runs, which are those of no other step."""
_FEW, _MORE = 3, 8
"""Runs of a trial that are few, and how many times as many of the bare block tell its share at rest."""


class Verification(Steps):
    """The bare block under all conditions, and designs compared with it, the most promising first."""

    refinement: Refinement | None = None
    """Surfaces through the trial runs, which order what is verified."""

    def best_of(self, search: Multistart) -> DesignStatus:
        """Verify the best end of a search that was interrupted, and judge it if it passes."""
        order = search.order()
        if not len(order):
            return DesignStatus.none_feasible
        self.verified.append(self.at_once(search.designs[order[0]]))
        return self.judge() if not self.verified[-1].reasons else DesignStatus.refused

    def best_of_survey(self, found: Survey) -> DesignStatus:
        """Verify the designs of a survey that keep to the limits and are no neighbours of those verified, in
        their order, until one passes."""
        order = np.arange(len(found.designs)) if self.refinement is None else self.refinement.order(found)
        fits = order[found.keeps[order]]
        if not len(fits):
            return DesignStatus.none_feasible
        helps = order[found.helps[order]]
        units = self.objective.space.scaled(found.designs)
        # Without any that helps the best one is verified all the same: its reasons are the answer.
        left, way = list(helps if len(helps) else fits[:1]), found.excess.get(ON_THE_WAY)
        for done in range(len(self.verified), VERIFIED):
            near = self.objective.space.scaled(np.array([v.design for v in self.verified]).reshape(-1, 3))
            left = [j for j in left if np.all(np.linalg.norm(units[j] - near, axis=1) > _APART)]
            struck = [v.design for v in self.verified if v.chosen_by and v.strikes > self.worth.allowed]
            if struck and way is not None:
                # No surface has the runs that judge: after strikes in these the next keeps further away.
                reach = min(way[np.all(found.designs == x, axis=1)].min(initial=np.inf) for x in struck)
                left = [j for j in left if way[j] <= reach - _FURTHER] or left
            if not left:
                break
            if self.progress is not None:
                self.progress("verifying", done + 1, VERIFIED)
            v = replace(self.at_once(found.designs[left[0]]), source="survey")
            self.verified.append(v)
            if not v.reasons:
                return DesignStatus.found
            if v.paired is not None and self.refinement is not None:
                # These runs say more of the design than its trials, and something of its neighbours.
                ran = self._tried(v.paired.hung, pendulum_of(self.scene, v))
                self.refinement.add(found.at(np.array(left[:1])), [ran])
                self.refinement.sure = 1.0 - _SURER * (1.0 - self.refinement.sure)
                left = [int(j) for j in self.refinement.order(found) if j in left]
        # What was verified has reasons of its own, also where single motions from rest show no improvement.
        return DesignStatus.refused

    def judge(self) -> DesignStatus:
        """Judge the design that passed last by fresh runs, which no choice has seen."""
        self.verified[-1] = judged = self.by_fresh_runs(self.verified[-1])
        return DesignStatus.refused if judged.reasons else DesignStatus.found

    def refined(self, found: Survey) -> Survey:
        """A survey by runs of the nonlinear equations from many starts, see `refine`. Luck in these runs is
        of no help where others verify."""
        if not found.helps.any():
            return found
        conditions, n, size = self.objective.conditions, len(self.few.conditions), self.runs.ensemble.size
        after = None if self.progress is None else stage(self.progress, "trial runs")

        def run(design: np.ndarray, i: int) -> Tried:
            mu, lam, zeta = design
            hung = self.scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta)
            seed = self.ensemble.seed + TRIALS + _APART_SEEDS * (i + 1)
            few = replace(self.ensemble, size=min(RUNS, size), seed=seed)
            # Of more conditions than runs every design has others.
            order = np.random.default_rng([seed, 13]).permutation(len(conditions))
            some = Conditions({name: x[order] for name, x in conditions.factors.items()})
            o = outcomes(self.scene, hung, ensemble=few, conditions=some, equations=Terms.nonlinear)
            return self._tried(o, hung)

        def still(designs: np.ndarray) -> np.ndarray:
            sizes = excess(self.few, designs, *np.zeros((4, len(designs), n)))
            return np.max([np.zeros(len(designs)), *sizes.values()], axis=0) <= 0.0

        rests = 0.0
        # Of a few runs that rest no trial has any.
        if self.runs.bare.at_rest.value > _FEW / RUNS:
            # A share that luck has raised would speak against every design.
            more = replace(self.ensemble, size=_MORE * size, seed=self.ensemble.seed + TRIALS)
            bare = outcomes(self.scene, ensemble=more, conditions=conditions, equations=Terms.nonlinear)
            rests = (1.0 - FEWER) * float(bare.at_rest.value)
        strikes = self.worth.allowed
        found, self.refinement = refine(
            found, self.objective.space, run, still, self._from_rest, strikes, rests, self.seed, after
        )
        return found

    def _tried(self, o: Outcomes, hung: Pendulum) -> Tried:
        """Runs of one design."""
        room, nu = limit_of(self.objective.limits, Room), float(self.scene.block.slenderness)
        reach = reach_of(o, hung, self.scene.block, room.bob) if isinstance(room, Room) else np.zeros(0)
        known = severity(o, nu)[~o.undecided]
        return Tried(float(known.mean()) if len(known) else np.nan, float(o.at_rest.value), reach)
