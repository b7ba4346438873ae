"""Steps of the verification of one design.

The exact solution by events from rest under every condition; paired runs of the nonlinear equations, which
choose by the benefit; and the nonlinear equations from rest under the worst conditions and at limits, under
one condition before the paired runs. Each step gives typed reasons of refusal. The first step that refuses a
design ends its verification. The design that is chosen is judged by fresh paired runs: the best of several by
the same runs owes a part of its benefit to luck in them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tpd.analysis.ensemble import Ensemble
from tpd.analysis.paired import SIGNIFICANT, chance_of
from tpd.core.conditions import Conditions, under_all
from tpd.core.progress import Progress
from tpd.core.scene import Pendulum, Scene
from tpd.core.status import SETTLED, names_of
from tpd.design.active import active
from tpd.design.by_runs import JUDGES, PairedRuns, reasons_by_runs, strikes_of
from tpd.design.criteria import Room, limit_of
from tpd.design.ends import Book
from tpd.design.motions import motions_from_rest, polished
from tpd.design.objective import REST, Evaluation, Orbits, margins
from tpd.design.reasons import Reason, ReasonKind, Step
from tpd.design.verified import Bare, Motions, Nonlinear, Verified
from tpd.design.worth import Worth
from tpd.models.compiled_nonlinear import settle_nonlinear

_ASKED, _NEAR = 4, 2
"""Conditions under which the nonlinear equations are asked: the worst, and those nearest to a limit."""
_AT_LIMIT = 1e-3
"""Share of a limit that is left where the limit counts as met."""
_ROUNDING = 1e-9
"""Share by which a limit may be passed by rounding."""
HEIGHT = "rod and bob within the height"
"""Name of the limit that the height of the block sets, beside those of its cavity."""


class Steps:
    """The bare block under all conditions, and designs compared with it."""

    def __init__(
        self,
        scene: Scene,
        objective: Orbits,
        ensemble: Ensemble,
        worth: Worth,
        progress: Progress | None,
    ) -> None:
        self.scene, self.objective, self.ensemble, self.progress = scene, objective, ensemble, progress
        self.worth = worth
        self.runs = PairedRuns(scene, objective.conditions, ensemble, worth, progress)
        judges = replace(ensemble, seed=ensemble.seed + JUDGES)
        self.fresh = PairedRuns(scene, objective.conditions, judges, worth, progress)
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
    def rests(self) -> bool:
        """Whether the bare block settles at rest under all conditions, by the linear equations."""
        e = self.bare.evaluation
        return bool(np.all(e.kind == REST))

    def at_once(self, design: np.ndarray) -> Verified:
        """All steps for one design (mu, lam, zeta), up to the first that refuses it."""
        v = self.begun(design)
        for step in self._steps:
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
            nonlinear=(),
            paired=None,
            benefit=None,
            strikes=math.nan,
            stationarity=float(end.stationarity[0]),
            active=active(o, end, _AT_LIMIT),
            source="search",
            reasons=(),
        )

    @property
    def _steps(self) -> tuple[Callable[[Verified], Verified], ...]:
        """Steps for one condition or for several, where paired runs stand for single ones."""
        if len(self.objective.conditions) > 1:
            return self.by_events, self.by_runs, self.by_nonlinear
        return self.by_events, self.by_nonlinear, self.by_runs

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

    def by_nonlinear(self, v: Verified) -> Verified:
        """Nonlinear equations under the worst conditions and under those nearest to a limit, from rest."""
        v = replace(v, nonlinear=self._nonlinear(v.design, self.conditions_asked(v.evaluation)))
        return replace(v, reasons=self.nonlinear_reasons(v))

    def nonlinear_reasons(self, v: Verified) -> tuple[Reason, ...]:
        """Reasons against a design by the nonlinear motions that were met."""
        alone, label = len(self.objective.conditions) == 1, self.objective.conditions.label
        reasons: list[Reason] = []
        for a in v.nonlinear:
            at = {"step": Step.nonlinear, "condition": label(a.condition)}
            bare = a.bare_status, self.bare.exact.status[a.condition]
            if alone and a.status == "overturned" and "overturned" not in bare:
                reasons.append(Reason(kind=ReasonKind.overturns, **at))
            elif alone and a.status not in SETTLED:
                reasons.append(Reason(kind=ReasonKind.does_not_settle, outcome=a.status, **at))
            elif alone and a.amplitude > 0.0 and a.amplitude >= a.bare_amplitude:
                sizes = {"value": a.amplitude, "reference": a.bare_amplitude}
                reasons.append(Reason(kind=ReasonKind.rocks_more, **sizes, **at))
        return (*reasons, *self._broken_nonlinearly(v))

    def _broken_nonlinearly(self, v: Verified) -> list[Reason]:
        """Limits that the nonlinear motions break."""
        n = len(self.objective.conditions)
        amplitude, stroke, known = np.zeros(n), np.zeros(n), np.zeros(n, bool)
        for a in v.nonlinear:
            if a.status in SETTLED:
                amplitude[a.condition], stroke[a.condition], known[a.condition] = a.amplitude, a.stroke, True
        e = _with_sizes(v.evaluation, amplitude, stroke, self.objective)
        return self._broken(e, Step.nonlinear, known)

    def conditions_asked(self, e: Evaluation) -> list[int]:
        """Conditions under which the nonlinear equations are asked: the worst, and those at a limit."""
        n = len(self.objective.conditions)
        worst = [int(i) for i in np.argsort(-e.merit[0], kind="stable")[:_ASKED]]
        # How near an orbit is to where it stops attracting is no size that the nonlinear equations give.
        limits = [x for x in self.objective.limits if x.of_motion]
        rows = [s.value[0] - 1.0 for x in limits for s in x.sizes(e, self.objective.geometry)]
        held = np.max([np.full(n, -np.inf), *rows], axis=0)
        near = [int(i) for i in np.argsort(-held, kind="stable") if i not in worst and held[i] > -_AT_LIMIT]
        return worst + near[:_NEAR]

    def _nonlinear(self, design: np.ndarray, asked: list[int]) -> tuple[Nonlinear, ...]:
        """Nonlinear motions from rest under some conditions, with the design and without."""
        hung, bare = (self._nonlinear_motions(x, asked) for x in (design, self.none))
        return tuple(
            Nonlinear(
                condition=i,
                amplitude=with_it[0],
                stroke=with_it[1],
                status=with_it[2],
                bare_amplitude=without[0],
                bare_status=without[2],
            )
            for i, with_it, without in zip(asked, hung, bare, strict=True)
        )

    def _nonlinear_motions(self, design: np.ndarray, asked: list[int]) -> list[tuple[float, float, str]]:
        """Amplitude and stroke (rad), and status, of a design (3,) under some conditions."""
        factors = {name: x[asked] for name, x in self.objective.conditions.factors.items()}
        q = under_all(self.objective.p, design[None], Conditions(factors))
        n = int(np.size(q.nu))
        settled = settle_nonlinear(q, np.zeros((n, 4)))
        names = names_of(settled.status)
        sizes = (np.where(names == "overturned", np.inf, x) for x in (settled.amplitude, settled.stroke))
        amplitude, stroke = sizes
        # Without factors there is one condition, the scene's own.
        return [(float(a), float(s), str(name)) for a, s, name in zip(amplitude, stroke, names, strict=True)]

    def bare_rests_nonlinearly(self) -> bool:
        """Whether the bare block settles at rest by the nonlinear equations under the worst conditions."""
        asked = self.conditions_asked(self.bare.evaluation)[:_ASKED]
        return all(status == "rest" for _, _, status in self._nonlinear_motions(self.none, asked))

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

    def _broken(self, e: Evaluation, step: Step, known: np.ndarray) -> list[Reason]:
        """Limits on the motion that an evaluation of one design breaks under known conditions."""
        label = self.objective.conditions.label
        return [
            Reason(
                step=step,
                kind=ReasonKind.breaks_limit,
                condition=label(int(i)),
                limit=size.name,
                value=float(size.value[0, i]),
            )
            for limit in self.objective.limits
            if limit.of_motion
            for size in limit.sizes(e, self.objective.geometry)
            for i in np.flatnonzero(known & (size.value[0] > 1.0))
        ]

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


def _with_sizes(e: Evaluation, amplitude: np.ndarray, stroke: np.ndarray, objective: Orbits) -> Evaluation:
    """An evaluation of one design with other settled angles (rad), shapes (n,)."""
    return e._replace(tilt=(amplitude / objective.geometry.slenderness)[None], stroke=stroke[None])


def _significant(lost: np.ndarray, bare: np.ndarray) -> tuple[bool, int, int]:
    """Whether significantly more paired runs overturn with a design than without (McNemar's test), and how
    many do so with the one only and with the other only."""
    worse, better = int(np.sum(lost & ~bare)), int(np.sum(bare & ~lost))
    return worse > better and chance_of(worse, better) < SIGNIFICANT, worse, better
