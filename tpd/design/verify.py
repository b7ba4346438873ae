"""Verification: which of the designs that a search found are verified, in which order, until one passes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tpd.analysis.benefit import severity
from tpd.analysis.paired import SIGNIFICANT, chance_of
from tpd.design.by_runs import TRIALS, PairedRuns, strikes_of
from tpd.design.criteria import Room, limit_of
from tpd.design.result import DesignStatus
from tpd.design.screening import first_apart
from tpd.design.search import Multistart
from tpd.design.steps import Steps
from tpd.design.survey import ON_THE_WAY, Survey
from tpd.design.verified import Motions, Verified

VERIFIED = 6
"""Most designs that are verified, the best first."""
SURVEYED = 10
"""Most designs of a survey that are verified."""
_APART = 0.02
"""Least distance of designs that are verified one after the other, in shares of the bounds."""
_TRIED, _SPARE = 16, (0.04, 0.08)
"""Designs of a survey that are tried by paired runs before the verification, and shares of the room to spare
for which there are as many designs again."""
_ROUNDS: tuple[tuple[int, int | None], ...] = ((64, None), (192, 12))
"""Rounds of trials: runs of each design, and of how many of the best of the round before; None is all."""
_APART_SEEDS = 7919
"""Between the seeds of the rounds, so that none has the runs that verify or judge."""
_LAST, _MANY, _SAFE = 8, 512, 0.5
"""Designs that go through the last trials together, until one passes; their runs; and the share of the
allowed strikes that they may have: it leaves room for luck in the runs that judge."""
_RUNS = 4096
"""Runs from rest spent on choosing the designs to verify."""


class Trial(NamedTuple):
    """Paired runs that a design has had in trials, added up."""

    runs: float = 0.0
    strikes: float = 0.0
    """Runs in which the bob strikes, if those that fall strike as often as those that stand."""
    with_it: float = 0.0
    """Sum of the severities with the pendulum."""
    without: float = 0.0
    worse: float = 0.0
    """Runs that overturn with the pendulum only."""
    better: float = 0.0

    def and_(self, more: Trial) -> Trial:
        """With more runs."""
        return Trial(*(a + b for a, b in zip(self, more, strict=True)))

    @property
    def fall(self) -> float:
        """Share by which the mean severity falls."""
        return 1.0 - self.with_it / self.without if self.without else 0.0

    @property
    def harms(self) -> bool:
        """Whether significantly more runs overturn with the pendulum than without."""
        return self.worse > self.better and chance_of(int(self.worse), int(self.better)) < SIGNIFICANT

    def rank(self, allowed: float) -> tuple[bool, float]:
        """Order after a few runs: last what harms, and what strikes more than luck can explain."""
        most = allowed * self.runs
        return bool(self.harms or self.strikes > most + math.sqrt(most)), -self.fall

    def passes(self, allowed: float) -> bool:
        """Whether a design does no harm, and strikes so little that it will where other runs judge."""
        return bool(self.runs > 0 and not self.harms and self.strikes <= _SAFE * allowed * self.runs)


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
        """Verify the designs of a survey that keep to the limits, the best first, until one passes."""
        fits = np.flatnonzero(found.keeps)
        if not len(fits):
            return DesignStatus.none_feasible
        helps = np.flatnonzero(found.helps)
        if self.by_overturning:
            helps = helps[np.argsort(np.sum(found.severity[helps] >= 1.0, axis=1), kind="stable")]
        else:
            helps = self.by_trials(found, helps)
        units = self.objective.space.scaled(found.designs)
        # Without any that helps the best one is verified all the same: its reasons are the answer.
        left = list(helps if len(helps) else fits[:1])
        for done in range(SURVEYED):
            if not left:
                break
            i = left[0]
            if self.progress is not None:
                self.progress("verifying", done + 1, SURVEYED)
            v = replace(self.at_once(search, found.designs[i]), source="survey")
            self.verified.append(v)
            if not v.reasons:
                return DesignStatus.found
            left = [j for j in left[1:] if np.linalg.norm(units[j] - units[i]) > _APART]
        # What was verified has reasons of its own, also where single motions from rest show no improvement.
        return DesignStatus.refused

    def judge(self) -> DesignStatus:
        """Judge the design that passed last, which is the chosen one, once by fresh runs."""
        self.verified[-1] = judged = self.by_fresh_runs(self.verified[-1])
        return DesignStatus.refused if judged.reasons else DesignStatus.found

    def by_trials(self, found: Survey, helps: np.ndarray) -> np.ndarray:
        """The most promising designs of a survey in the order of trials by paired runs, then the others.

        From rest many designs are alike; what tells them apart is how they serve from other starts. The runs
        are others than those that verify, so that luck in them does not help a design there."""
        units, way = self.objective.space.scaled(found.designs), found.excess.get(ON_THE_WAY)
        tried = first_apart(units, helps, _TRIED)
        if way is not None:
            # Runs that begin elsewhere swing further than those from rest: some designs need room to spare.
            for spare in _SPARE:
                tried += first_apart(units, helps[way[helps] < -spare], _TRIED)
        tried = list(dict.fromkeys(tried))
        trials = {i: Trial() for i in tried}

        def ranked(rows: list[int]) -> list[int]:
            return sorted(rows, key=lambda i: trials[i].rank(self.worth.strikes))

        # Few runs tell the bad designs; more of them are for the rest.
        for turn, (runs, most) in enumerate(_ROUNDS):
            self._try(found, trials, tried[:most], runs, turn)
            tried = [*ranked(tried[:most]), *tried[most or len(tried) :]]
        passed: list[int] = []
        for begin in range(0, min(len(tried), _ROUNDS[-1][1] or len(tried)), _LAST):
            # Those that come near to the allowed strikes would not pass where other runs judge.
            last = tried[begin : begin + _LAST]
            self._try(found, trials, last, _MANY, len(_ROUNDS))
            passed += [i for i in last if trials[i].passes(self.worth.strikes)]
            if passed:
                break
        others = ranked([i for i in tried if i not in passed])
        passed.sort(key=lambda i: -trials[i].fall)
        return np.array([*passed, *others, *(i for i in helps if i not in trials)], dtype=int)

    def _try(self, found: Survey, trials: dict[int, Trial], tried: list[int], runs: int, turn: int) -> None:
        """Put some designs to so many more paired runs, others in every turn."""
        seed = self.ensemble.seed + TRIALS + _APART_SEEDS * turn
        ensemble = replace(self.ensemble, size=min(runs, self.ensemble.size), seed=seed)
        paired = PairedRuns(self.scene, self.objective.conditions, ensemble, self.worth, None)
        room, slenderness = limit_of(self.objective.limits, Room), float(self.scene.block.slenderness)
        for done, i in enumerate(tried):
            if self.progress is not None:
                self.progress("trial runs", done + 1, len(tried))
            mu, lam, zeta = found.designs[i]
            hung = self.scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta)
            pair = paired.with_it(hung)
            known, strikes = pair.known, 0.0
            if isinstance(room, Room):
                strikes = strikes_of(pair, hung, self.scene.block, room.bob)
            with_it, without = (float(severity(x, slenderness)[known].sum()) for x in (pair.hung, pair.bare))
            count = float(known.sum())
            more = Trial(count, strikes * count, with_it, without, pair.worse, pair.better)
            trials[i] = trials[i].and_(more)

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
