"""Verification: which of the designs that a search found are verified, in which order, until one passes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tpd.analysis.benefit import severity
from tpd.analysis.ensemble import outcomes
from tpd.core.conditions import Conditions
from tpd.core.equations import Terms
from tpd.design.by_runs import TRIALS, reach_of
from tpd.design.criteria import Room, limit_of
from tpd.design.reasons import ReasonKind
from tpd.design.refine import RUNS, Tried, refine
from tpd.design.result import DesignStatus
from tpd.design.search import Multistart, stage
from tpd.design.steps import Steps
from tpd.design.survey import ON_THE_WAY, Survey, excess, followed

VERIFIED, JUDGED = 10, 3
"""Most designs of a survey that are verified, and most of them that are judged."""
_APART = 0.02
"""Least distance of designs that are verified one after the other, in shares of the bounds."""
_FURTHER = 0.02
"""Share of the way to the walls that a design keeps further off than one whose bob struck them too often."""
_APART_SEEDS = 7919
"""Between the seeds of trial runs, which are those of no other step."""
_LUCK, _FEW = 1.645, 3
"""Standard errors within which a share is put down to luck, and runs of a trial that are few."""


class Verification(Steps):
    """The bare block under all conditions, and designs compared with it, the most promising first."""

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
        fits = np.flatnonzero(found.keeps)
        if not len(fits):
            return DesignStatus.none_feasible
        helps = np.flatnonzero(found.helps)
        units = self.objective.space.scaled(found.designs)
        # Without any that helps the best one is verified all the same: its reasons are the answer.
        left, way = list(helps if len(helps) else fits[:1]), found.excess.get(ON_THE_WAY)
        for done in range(len(self.verified), VERIFIED):
            near = self.objective.space.scaled(np.array([v.design for v in self.verified]).reshape(-1, 3))
            left = [j for j in left if np.all(np.linalg.norm(units[j] - near, axis=1) > _APART)]
            struck = [v.design for v in self.verified if any(r.kind is ReasonKind.strikes for r in v.reasons)]
            if way is not None and struck:
                # Where the bob struck too often the next design keeps further from the walls, if one does.
                reach = min(way[np.all(found.designs == x, axis=1)].min(initial=np.inf) for x in struck)
                left = [j for j in left if way[j] <= reach - _FURTHER] or left
            if not left:
                break
            i = left[0]
            if self.progress is not None:
                self.progress("verifying", done + 1, VERIFIED)
            self.verified.append(replace(self.at_once(found.designs[i]), source="survey"))
            if not self.verified[-1].reasons:
                return DesignStatus.found
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
        room, nu = limit_of(self.objective.limits, Room), float(self.scene.block.slenderness)
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
            reach = np.zeros(0)
            if isinstance(room, Room):
                reach = reach_of(o, hung, self.scene.block, room.bob)
            known = severity(o, nu)[~o.undecided]
            return Tried(float(known.mean()) if len(known) else np.nan, float(o.at_rest.value), reach)

        def still(designs: np.ndarray) -> np.ndarray:
            sizes = excess(self.few, designs, *np.zeros((4, len(designs), n)))
            return np.max([np.zeros(len(designs)), *sizes.values()], axis=0) <= 0.0

        def follow(designs: np.ndarray) -> Survey:
            return followed(self.few, designs, self.ensemble.periods, "nonlinear", None)

        share = float(self.runs.bare.at_rest.value)
        # Less by luck in these runs is no harm yet, and of a few runs that rest no trial has any.
        rests = share - _LUCK * np.sqrt(share * (1.0 - share) / size)
        rests = rests if rests > _FEW / RUNS else 0.0
        strikes = self.worth.allowed
        return refine(found, self.objective.space, run, still, follow, strikes, rests, self.seed, after)
