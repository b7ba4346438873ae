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
from tpd.design.objective import AbstractObjective
from tpd.design.refine import RUNS, Tried, refine
from tpd.design.result import DesignStatus
from tpd.design.screening import first_apart
from tpd.design.search import Multistart, stage
from tpd.design.steps import Steps
from tpd.design.survey import Survey, excess, followed
from tpd.design.verified import Motions, Verified

VERIFIED = 6
"""Most designs that are verified, the best first."""
SURVEYED, JUDGED = 10, 3
"""Most designs of a survey that are verified, and most of them that are judged."""
_APART = 0.02
"""Least distance of designs that are verified one after the other, in shares of the bounds."""
_APART_SEEDS = 7919
"""Between the seeds of trial runs, which are those of no other step."""
_LUCK, _FEW = 1.645, 3
"""Standard errors within which a share is put down to luck, and runs of a trial that are few."""
_RUNS = 4096
"""Runs from rest spent on choosing the designs to verify."""


class Verification(Steps):
    """The bare block under all conditions, and designs compared with it, the most promising first."""

    def best_of(self, search: Multistart) -> DesignStatus:
        """Verify the best end of a search. Its entry is added to `verified`."""
        order = search.order()
        if not len(order):
            return DesignStatus.none_feasible
        # A design that does not help is not worth the cost of verification.
        helps = order[search.values[order] < self.needed]
        if not len(helps):
            return DesignStatus.no_improvement
        passed = self._first_to_pass(search, helps, len(self.verified) + 1)
        return DesignStatus.found if passed else DesignStatus.refused

    def best_of_paths(self, search: Multistart) -> DesignStatus:
        """After a refusal: verify the other ends and designs on the paths until one passes. A design that
        passes need not be where a search ended: a neighbour of the best end on its path is better than the
        end of another search."""
        wider = search.with_paths(self.needed)
        order = wider.order()
        helps = order[wider.values[order] < self.needed]
        passed = self._first_to_pass(wider, helps, len(self.verified) + VERIFIED - 1)
        return DesignStatus.found if passed else DesignStatus.refused

    def best_of_survey(self, search: Multistart, found: Survey) -> DesignStatus:
        """Verify the designs of a survey that keep to the limits and are no neighbours of those verified, in
        their order, until one passes."""
        fits = np.flatnonzero(found.keeps)
        if not len(fits):
            return DesignStatus.none_feasible
        helps = np.flatnonzero(found.helps)
        if self.by_overturning:
            helps = helps[np.argsort(np.sum(found.severity[helps] >= 1.0, axis=1), kind="stable")]
        units = self.objective.space.scaled(found.designs)
        # Without any that helps the best one is verified all the same: its reasons are the answer.
        left = list(helps if len(helps) else fits[:1])
        for done in range(len(self.verified), SURVEYED):
            near = self.objective.space.scaled(np.array([v.design for v in self.verified]).reshape(-1, 3))
            left = [j for j in left if np.all(np.linalg.norm(units[j] - near, axis=1) > _APART)]
            if not left:
                break
            i = left[0]
            if self.progress is not None:
                self.progress("verifying", done + 1, SURVEYED)
            v = replace(self.at_once(search, found.designs[i]), source="survey")
            self.verified.append(v)
            if not v.reasons:
                return DesignStatus.found
        # What was verified has reasons of its own, also where single motions from rest show no improvement.
        return DesignStatus.refused

    def judge(self) -> DesignStatus:
        """Judge the design that passed last by fresh runs, which no choice has seen."""
        self.verified[-1] = judged = self.by_fresh_runs(self.verified[-1])
        return DesignStatus.refused if judged.reasons else DesignStatus.found

    def refined(self, found: Survey, objective: AbstractObjective, seed: int) -> Survey:
        """A survey by runs of the nonlinear equations from many starts, see `refine`; `objective` has the
        conditions of the survey. Luck in these runs is of no help where others verify."""
        if not found.helps.any():
            return found
        room, nu = limit_of(self.objective.limits, Room), float(self.scene.block.slenderness)
        conditions, n, size = self.objective.conditions, len(objective.conditions), self.runs.ensemble.size
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
            sizes = excess(objective, designs, *np.zeros((4, len(designs), n)))
            return np.max([np.zeros(len(designs)), *sizes.values()], axis=0) <= 0.0

        def follow(designs: np.ndarray) -> Survey:
            return followed(objective, designs, self.ensemble.periods, "nonlinear", None)

        share = float(self.runs.bare.at_rest.value)
        # Less by luck in these runs is no harm yet, and of a few runs that rest no trial has any.
        rests = share - _LUCK * np.sqrt(share * (1.0 - share) / size)
        rests = rests if rests > _FEW / RUNS else 0.0
        strikes = self.worth.strikes
        return refine(found, self.objective.space, run, still, follow, strikes, rests, seed, after)

    def at_once(self, search: Multistart, design: np.ndarray) -> Verified:
        """A design (3,) of another search, verified under the conditions of this one."""
        wider = search.with_designs(self.objective.space.scaled(design[None]))
        return self.judged(wider, len(wider.units) - 1, self.from_rest(design))

    @property
    def needed(self) -> float:
        """Risk below which a design counts as an improvement on the bare block."""
        return self.bare.value * (1.0 - self.tolerance) if self.bare.value > 0.0 else self.bare.value

    def _first_to_pass(self, search: Multistart, order: np.ndarray, most: int) -> bool:
        """Verify designs until one passes or `most` entries stand in `verified`."""
        known = {tuple(v.design.tolist()) for v in self.verified}
        begun = len(self.verified)
        for i, motions in self._ranked(search, order):
            if len(self.verified) == most:
                break
            if tuple(search.designs[i].tolist()) in known:
                continue
            if self.progress is not None:
                self.progress("verifying", len(self.verified) + 1 - begun, most - begun)
            self.verified.append(self.judged(search, i, motions))
            if not self.verified[-1].reasons:
                return True
        return False

    def _ranked(self, search: Multistart, order: np.ndarray) -> list[tuple[int, Motions]]:
        """Designs that lie apart with their exact motions: those against which events from rest speak come
        last, so that they are reported if all are refused."""
        n = len(self.objective.conditions)
        apart = first_apart(search.units, order, max(VERIFIED, _RUNS // n))
        exact = [self.from_rest(search.designs[i]) for i in apart]
        worse = np.array([self.harm(e)[0] for e in exact])
        lost = np.array([np.sum(e.status == "overturned") for e in exact])
        ranks = np.lexsort((lost if self.by_overturning else np.zeros_like(lost), worse))
        return [(apart[i], exact[i]) for i in ranks]
