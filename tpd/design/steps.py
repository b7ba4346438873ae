"""Steps of the verification of one design.

The exact solution by events from rest under every condition; the nonlinear equations from rest; and paired
runs of these, which choose by the benefit. Each step gives typed reasons of refusal, and the first that
refuses a design ends its verification. The design that is chosen is judged by fresh paired runs: the best of
several by the same runs owes a part of its benefit to luck in them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tpd.answers.paired import SIGNIFICANT, chance_of
from tpd.answers.steady_state import steady_state
from tpd.core.progress import Progress
from tpd.design.active import active, nearest_of
from tpd.design.by_runs import JUDGES, PairedRuns, reasons_by_runs, strikes_of
from tpd.design.criteria import Room, limit_of
from tpd.design.ends import Book
from tpd.design.objective import REST, Evaluation, margins
from tpd.design.problem import Problem
from tpd.design.survey import Survey, followed
from tpd.design.verified import Bare, Motions, Reason, ReasonKind, Step, Verified
from tpd.models.piecewise import Piecewise
from tpd.models.rows import settle_all
from tpd.scene.conditions import Conditions, under, under_all
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import names_of, status_name

SURVEYED = 24
"""Most conditions under which designs are followed from rest by the nonlinear equations."""
_LONG, _FINE = 400, 1e-8
"""Most forcing periods of a motion from rest that verifies, and relative tolerance of its steps."""
_AT_LIMIT = 1e-3
"""Share of a limit that is left where the limit counts as met."""
_ROUNDING = 1e-9
"""Share by which a limit may be passed by rounding."""
_POLISHED = 32
"""Conditions up to which exact amplitudes are polished by Newton's method, to round-off."""
HEIGHT = "rod and bob within the height"
"""Name of the limit that the height of the block sets, beside those of its cavity."""


class Steps:
    """The bare block under all conditions, and designs compared with it."""

    def __init__(self, problem: Problem, progress: Progress | None) -> None:
        self.scene, self.objective = problem.scene, problem.objective
        self.ensemble, self.worth = problem.ensemble, problem.worth
        self.seed, self.progress = problem.seed, progress
        objective = problem.objective
        self.few = objective.over(objective.conditions.subset(SURVEYED, problem.seed))
        judges = replace(problem.ensemble, seed=problem.ensemble.seed + JUDGES)
        self.runs, self.fresh = (
            PairedRuns(problem.scene, problem.conditions, e, problem.worth, progress)
            for e in (problem.ensemble, judges)
        )
        p = objective.p
        self.none = np.array([0.0, float(p.lam), float(p.zeta)])
        # A bob without mass: the same program answers for the bare block, and nothing else is compiled.
        evaluation = objective.evaluate(self.none[None])
        self.bare = Bare(
            value=float(objective.value(evaluation)[0]),
            evaluation=evaluation,
            exact=self._polished(self.none, self.from_rest(self.none)),
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
        end = Book(o.at, o.risk.of, o.space.scaled(design[None]), o.linearised(e)).ends(
            o.risk.cap(len(o.conditions))
        )
        return Verified(
            mass_ratio=float(design[0]),
            length_ratio=float(design[1]),
            damping_ratio=float(design[2]),
            value=float(o.value(e)[0]),
            evaluation=e,
            exact=self._polished(design, self.from_rest(design)),
            margin=margins(o, design[None])[0],
            rest=None,
            paired=None,
            benefit=None,
            strikes=math.nan,
            stationarity=float(end.stationarity[0]),
            active=active(o, end, _AT_LIMIT),
            source="search",
            reasons=(),
        )

    def by_events(self, v: Verified) -> Verified:
        """Exact solution under every condition, and limits that a motion from rest says nothing about."""
        reasons = []
        harms, worse, better = self.harm(v.exact)
        n = len(v.exact.status)
        if harms:
            reasons.append(
                Reason(
                    step=Step.exact,
                    kind=ReasonKind.overturns_more,
                    value=float(worse),
                    reference=float(better),
                    total=n,
                )
            )
        reasons += self._broken_in_closed_form(v.evaluation) + self._too_long(v.design)
        return replace(v, reasons=tuple(reasons))

    def by_rest(self, v: Verified) -> Verified:
        """Nonlinear equations from rest: limits on the motion and, under one condition, whether the block
        moves less. Under several the paired runs say that."""
        # Longer and more exactly than a survey, which only chooses.
        found = followed(self.few, v.design[None], _LONG, "nonlinear", rtol=_FINE)
        hung, bare = found.severity[0], found.bare
        # The first step has asked for the limits that a motion from rest says nothing about.
        other = [limit.name for limit in self.objective.limits if not limit.of_motion]
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
        return replace(v, reasons=reasons_by_runs(v, self.worth, self.objective.conditions, step))

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

    def _too_long(self, design: np.ndarray) -> list[Reason]:
        """The rod and half of the bob must not be longer than the block is high, where room is asked for."""
        room, g = limit_of(self.objective.limits, Room), self.objective.geometry
        if not isinstance(room, Room):
            return []
        radius = np.asarray(room.bob.radius(g.mass(design[None])))
        value = float(np.max(g.rod(design[None]) + room.bob.slimness * radius)) / (2.0 * g.half_height)
        broken = Reason(step=Step.exact, kind=ReasonKind.breaks_limit, limit=HEIGHT, value=value)
        return [broken] if value > 1.0 + _ROUNDING else []

    def harm(self, exact: Motions) -> tuple[bool, int, int]:
        """Whether significantly more conditions overturn the block from rest with a design than without, and
        under how many it does so with the one only and with the other only."""
        lost, bare = exact.status == "overturned", self.bare.exact.status == "overturned"
        significant, worse, better = _significant(lost, bare)
        alone = len(lost) == 1 and worse > better
        return significant or alone, worse, better

    def from_rest(self, design: np.ndarray) -> Motions:
        """Exact motions from rest under all conditions, as followed."""
        periods = self.ensemble.periods
        return motions_from_rest(self.objective.p, design, self.objective.conditions, periods)

    def _polished(self, design: np.ndarray, motions: Motions) -> Motions:
        return polished(self.objective.p, design, self.objective.conditions, motions)


def pendulum_of(scene: Scene, v: Verified) -> Pendulum:
    """A verified design in SI."""
    return scene.pendulum(mass_ratio=v.mass_ratio, length_ratio=v.length_ratio, damping_ratio=v.damping_ratio)


def _significant(lost: np.ndarray, bare: np.ndarray) -> tuple[bool, int, int]:
    """Whether significantly more paired runs overturn with a design than without (McNemar's test), and how
    many do so with the one only and with the other only."""
    worse, better = int(np.sum(lost & ~bare)), int(np.sum(bare & ~lost))
    return worse > better and chance_of(worse, better) < SIGNIFICANT, worse, better


def motions_from_rest(p: Parameters, design: np.ndarray, conditions: Conditions, periods: int) -> Motions:
    """Motions as followed for at most `periods` forcing periods; without multipliers."""
    q = under_all(p, design[None], conditions)
    settled = settle_all(q, np.zeros((len(conditions), 4)), model=Piecewise(max_periods=periods))
    names = names_of(settled.status)
    sizes = settled.amplitude, settled.stroke, settled.peak, settled.peak_stroke
    amplitude, stroke, peak, peak_stroke = (
        np.where(names == "overturned", np.inf, np.asarray(x)) for x in sizes
    )
    return Motions(
        status=names,
        amplitude=amplitude,
        stroke=stroke,
        peak=peak,
        peak_stroke=peak_stroke,
        multiplier=np.full(len(names), np.nan),
        periods=np.asarray(settled.periods),
    )


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
    return Motions(
        status=status,
        amplitude=np.where(lost, np.inf, amplitude),
        stroke=np.where(lost, np.inf, stroke),
        peak=motions.peak,
        peak_stroke=motions.peak_stroke,
        multiplier=multiplier,
        periods=periods,
    )
