"""Verification: the steps that a design goes through, and which designs do, in which order, until one passes.

The exact solution by events from rest under every condition; the nonlinear equations from rest; and paired
runs of these, which choose by the benefit. Each step gives typed reasons of refusal, and the first that
refuses a design ends its verification. The design that is chosen is judged by fresh paired runs: the best of
several by the same runs owes a part of its benefit to luck in them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from tpd.answers.ensemble import Outcomes, outcomes
from tpd.answers.paired import FEWER, SIGNIFICANT, chance_of, severity
from tpd.answers.steady_state import steady_state
from tpd.core.progress import Progress, unreported
from tpd.design.by_runs import (
    JUDGES,
    TRIALS,
    PairedRuns,
    reach_of,
    reasons_by_runs,
    strikes_of,
    turned_in,
)
from tpd.design.criteria import Mass, Room, beyond_as_built, limit_of
from tpd.design.descend import active_constraints
from tpd.design.orbits import REST, Evaluation, margins
from tpd.design.problem import Problem
from tpd.design.refine import RUNS, Refinement, Tried, refine
from tpd.design.result import DesignStatus, Nearest
from tpd.design.survey import ON_THE_WAY, Survey, excess, followed
from tpd.design.verified import Bare, Motions, Reason, ReasonKind, Step, Verified
from tpd.models.piecewise import Piecewise
from tpd.models.rows import settle_all
from tpd.scene.conditions import Conditions, under, under_all
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import names_of, status_name
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
SURVEYED = 24
"""Most conditions under which designs are followed from rest by the nonlinear equations."""
_LONG, _FINE = 400, 1e-8
"""Most forcing periods of a motion from rest that verifies, and relative tolerance of its steps."""
_ROUNDING = 1e-9
"""Share by which a limit may be passed by rounding."""
_POLISHED = 32
"""Conditions up to which exact amplitudes are polished by Newton's method, to round-off."""
HEIGHT = "rod and bob within the height"
"""Name of the limit that the height of the block sets, beside those of its cavity."""


def nearest_of(found: Survey) -> Nearest:
    """Design of least excess in a survey; its best one comes first."""
    excess = sorted(((float(x[0]), name) for name, x in found.excess.items() if x[0] > 0.0), reverse=True)
    step = Step.exact if found.equations == "linear" else Step.nonlinear
    broken = tuple(
        Reason(step=step, kind=ReasonKind.breaks_limit, limit=name, value=1.0 + x) for x, name in excess
    )
    return Nearest(design=found.designs[0], broken=broken)


class Verification:
    """The bare block under all conditions, and designs compared with it, the most promising first."""

    refinement: Refinement | None = None
    """Surfaces through the trial runs, which order what is verified."""

    def __init__(self, problem: Problem, progress: Progress | None) -> None:
        self.scene, self.objective = problem.scene, problem.objective
        self.ensemble, self.worth = problem.ensemble, problem.worth
        self.seed, self.progress = problem.seed, progress or unreported
        objective = problem.objective
        self.few = objective.over(objective.conditions.subset(SURVEYED, problem.seed))
        self.first = problem.ensemble.seed or 0
        judges = replace(problem.ensemble, seed=self.first + JUDGES)
        self.runs, self.fresh = (
            PairedRuns(problem.scene, problem.conditions, e, problem.worth, progress)
            for e in (problem.ensemble, judges)
        )
        p = objective.p
        self.none = np.array([0.0, float(p.lam), float(p.zeta)])
        # A bob without mass: the same program answers for the bare block, and nothing else is compiled.
        evaluation = objective.evaluate(self.none[None])
        self.bare = Bare(
            value=float(objective.value(evaluation)[0]), evaluation=evaluation, exact=self.motions(self.none)
        )
        self.verified: list[Verified] = []

    @property
    def bare_rests(self) -> bool:
        """Whether the bare block settles at rest, by the exact orbits under all conditions and by the
        nonlinear equations from rest under these, or a choice of many."""
        orbits = bool(np.all(self.bare.evaluation.kind == REST))
        return orbits and not self._from_rest(self.none[None]).bare.any()

    def at_once(self, design: np.ndarray) -> Verified:
        """All steps for one design (mu, lam, zeta), up to the first that refuses it."""
        v = self.begun(design)
        for step in (self.by_events, self.by_rest, self.by_runs):
            v = step(v)
            if v.reasons:
                break
        return v

    def begun(self, design: np.ndarray) -> Verified:
        """A design before the first step."""
        o = self.objective
        e = o.evaluate(design[None])
        return Verified(
            mass_ratio=float(design[0]),
            length_ratio=float(design[1]),
            damping_ratio=float(design[2]),
            value=float(o.value(e)[0]),
            evaluation=e,
            exact=self.motions(design),
            margin=margins(o, design[None])[0],
            rest=None,
            paired=None,
            benefit=None,
            strikes=math.nan,
            stationarity=math.nan,
            active=active_constraints(o, design),
            source="survey",
            reasons=(),
        )

    def by_events(self, v: Verified) -> Verified:
        """Exact solution under every condition, and limits that a motion from rest says nothing about."""
        reasons = self._broken_in_closed_form(v.evaluation)
        room, g = limit_of(self.objective.limits, Room), self.objective.geometry
        if isinstance(room, Room):
            # The rod and half of the bob must not be longer than the block is high.
            radius = np.asarray(room.bob.radius(g.mass(v.design[None])))
            high = float(np.max(g.rod(v.design[None]) + room.bob.slimness * radius)) / (2.0 * g.half_height)
            if high > 1.0 + _ROUNDING:
                kind = ReasonKind.breaks_limit
                reasons.append(Reason(step=Step.exact, kind=kind, limit=HEIGHT, value=high))
        harms, worse, better = self.harm(v.exact)
        if harms:
            kind, value, other = ReasonKind.overturns_more, float(worse), float(better)
            total = len(v.exact.status)
            reasons.insert(0, Reason(step=Step.exact, kind=kind, value=value, reference=other, total=total))
        return replace(v, reasons=(*reasons, *self._as_built(v, Step.exact, np.zeros(0))))

    def _as_built(self, v: Verified, step: Step, turned: np.ndarray) -> list[Reason]:
        """Further limits that the body exceeds, for runs in which the rod turns so far against the block."""
        hung, known = pendulum_of(self.scene, v), {reason.limit for reason in v.reasons}
        sizes = beyond_as_built(self.objective.limits, self.scene, hung, turned, self.worth.allowed)
        return [
            Reason(step=step, kind=ReasonKind.as_built, limit=name, value=x, reference=most)
            for name, x, most in sizes
            if name not in known
        ]

    def by_rest(self, v: Verified) -> Verified:
        """Nonlinear equations from rest: limits on the motion and, under one condition, whether the block
        moves less. Under several the paired runs say that."""
        # Longer and more exactly than a survey, which only chooses.
        found = followed(self.few, v.design[None], _LONG, "nonlinear", rtol=_FINE)
        hung, bare = found.severity[0], found.bare
        # The first step has asked for the limits that a motion from rest says nothing about.
        other = [Mass.name, *(limit.name for limit in self.objective.limits if not limit.of_motion)]
        broken = [r for r in nearest_of(found).broken if r.value > 1.0 + _ROUNDING]
        reasons = [r for r in broken if r.limit not in other]
        if len(bare) == 1 and hung[0] > 0.0 and hung[0] >= bare[0]:
            kind = ReasonKind.overturns if hung[0] >= 1.0 > bare[0] else ReasonKind.rocks_more
            value, reference = float(hung[0]), float(bare[0])
            reasons.append(Reason(step=Step.nonlinear, kind=kind, value=value, reference=reference))
        return replace(v, rest=found, reasons=tuple(reasons))

    def _from_rest(self, designs: np.ndarray) -> Survey:
        return followed(self.few, designs, self.ensemble.periods, "nonlinear")

    def by_runs(self, v: Verified) -> Verified:
        """Paired runs of the nonlinear equations: benefit, harm and room."""
        return self._by(self.runs, v, Step.benefit)

    def by_fresh_runs(self, v: Verified) -> Verified:
        """Paired runs that no choice has seen, in place of those that chose the design."""
        return replace(self._by(self.fresh, v, Step.judgement), chosen_by=v.benefit)

    def _by(self, runs: PairedRuns, v: Verified, step: Step) -> Verified:
        pendulum, room = pendulum_of(self.scene, v), limit_of(self.objective.limits, Room)
        found, benefit = runs.of(pendulum)
        struck = math.nan
        if isinstance(room, Room):
            struck = strikes_of(found, pendulum, self.scene.block, room.bob)
        v = replace(v, paired=found, benefit=benefit, strikes=struck)
        self.bare = replace(self.bare, paired=found.bare)
        # If the bob touches a wall in too many runs, that reason is enough.
        turned = turned_in(found.hung) if not struck > self.worth.allowed else np.zeros(0)
        built = self._as_built(v, step, turned)
        return replace(v, reasons=(*built, *reasons_by_runs(v, self.worth, self.objective.conditions, step)))

    def _broken_in_closed_form(self, e: Evaluation) -> list[Reason]:
        """Limits that a motion from rest says nothing about, such as a reserve, that one design breaks, each
        under its worst condition. Ends of searches keep to them; other designs of a survey need not."""
        sizes = [
            (size.name, size.value[0])
            for limit in self.objective.limits
            if not limit.of_motion
            for size in limit.sizes(e, self.objective.geometry)
        ]
        label = self.objective.conditions.label
        return [
            Reason(
                step=Step.exact,
                kind=ReasonKind.breaks_limit,
                condition=label(int(np.argmax(value))),
                limit=name,
                value=float(value.max()),
            )
            for name, value in sizes
            if value.max() > 1.0 + _ROUNDING
        ]

    def harm(self, exact: Motions) -> tuple[bool, int, int]:
        """Whether significantly more conditions overturn the block from rest with a design than without
        (McNemar's test), and under how many it does so with the one only and with the other only."""
        lost, bare = exact.status == "overturned", self.bare.exact.status == "overturned"
        worse, better = int(np.sum(lost & ~bare)), int(np.sum(bare & ~lost))
        sure = len(lost) == 1 or chance_of(worse, better) < SIGNIFICANT
        return worse > better and sure, worse, better

    def motions(self, design: np.ndarray) -> Motions:
        """Exact motions from rest under all conditions."""
        given = self.objective.p, design, self.objective.conditions
        return polished(*given, motions_from_rest(*given, self.ensemble.periods))

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
            self.progress("verifying", done + 1, VERIFIED)
            v = self.at_once(found.designs[left[0]])
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
        after = partial(self.progress, "trial runs")

        def run(design: np.ndarray, i: int) -> Tried:
            mu, lam, zeta = design
            hung = self.scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta)
            seed = self.first + TRIALS + _APART_SEEDS * (i + 1)
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
            more = replace(self.ensemble, size=_MORE * size, seed=self.first + TRIALS)
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


def pendulum_of(scene: Scene, v: Verified) -> Pendulum:
    """A verified design in SI."""
    return scene.pendulum(mass_ratio=v.mass_ratio, length_ratio=v.length_ratio, damping_ratio=v.damping_ratio)


def motions_from_rest(p: Parameters, design: np.ndarray, conditions: Conditions, periods: int) -> Motions:
    """Motions as followed for at most `periods` forcing periods; without multipliers."""
    q = under_all(p, design[None], conditions)
    settled = settle_all(q, np.zeros((len(conditions), 4)), model=Piecewise(max_periods=periods))
    names = names_of(settled.status)
    sizes = {
        name: np.where(names == "overturned", np.inf, np.asarray(getattr(settled, name)))
        for name in ("amplitude", "stroke", "peak", "peak_stroke")
    }
    unknown = np.full(len(names), np.nan)
    return Motions(status=names, multiplier=unknown, periods=np.asarray(settled.periods), **sizes)


def polished(p: Parameters, design: np.ndarray, conditions: Conditions, motions: Motions) -> Motions:
    """The motions with amplitudes to round-off and multipliers; as they are under many conditions."""
    if len(conditions) > _POLISHED:
        return motions

    # One after the other: the program for a single motion is compiled for many other uses.
    def one(row: np.ndarray) -> tuple:
        s = steady_state(as_arrays(under(p, design, row)), model=Piecewise())
        return status_name(s.status), float(s.amplitude), float(s.stroke), float(s.multiplier), int(s.periods)

    columns = zip(*(one(row) for row in conditions.factor_rows()), strict=True)
    status, amplitude, stroke, multiplier, periods = (np.array(x) for x in columns)
    # Newton's method has no orbit to polish where the block overturns.
    lost = status == "overturned"
    amplitude, stroke = (np.where(lost, np.inf, x) for x in (amplitude, stroke))
    sizes = {"amplitude": amplitude, "stroke": stroke, "multiplier": multiplier, "periods": periods}
    return replace(motions, status=status, **sizes)
