"""What is said for and against a design that a search over many conditions has found."""

from __future__ import annotations

import math
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from tpd.analysis.compare_models import nonlinear
from tpd.analysis.ensemble import SIGNIFICANT, Ensemble, Outcomes, chance_of, outcomes, verdict
from tpd.analysis.work_queue import prepare, settle_all
from tpd.core.conditions import under, under_all
from tpd.core.progress import Progress
from tpd.core.scene import Pendulum, Scene
from tpd.core.status import SETTLED, names_of
from tpd.design.many_result import Judged, OverStatus
from tpd.design.objective import KINDS, Objective, Told
from tpd.design.search import AT_BOUND, FEASIBLE, Search, spread_out, stage
from tpd.models.piecewise import Piecewise

LOOKED_AT = 6
"""Most designs that are judged, the best first."""
_ASKED, _NEAR = 4, 2
"""Conditions under which the nonlinear equations are asked: the worst, and those at a limit."""
_RUNS = 4096
"""Runs from rest spent on choosing what is judged."""
_MET = 1e-3
"""Share of a limit that is left of one that counts as met."""


def pendulum_of(scene: Scene, of: Judged) -> Pendulum:
    """A design in SI."""
    return scene.pendulum(
        mass_ratio=of.mass_ratio, length_ratio=of.length_ratio, damping_ratio=of.damping_ratio
    )


def make_ready(objective: Objective, ensemble: Ensemble) -> None:
    """Compile what judging takes: events of few motions and of many, and the nonlinear equations."""
    p = objective.p
    q = replace(p, mu=0.0, rho=float(p.inertia_ratio))
    prepare(q, max(ensemble.size, len(objective.conditions)), Piecewise())
    nonlinear(p)


class Judge:
    """The bare block under all conditions, and designs compared with it."""

    def __init__(
        self,
        scene: Scene,
        objective: Objective,
        ensemble: Ensemble,
        by_overturning: bool,
        progress: Progress | None,
    ) -> None:
        self.scene, self.objective, self.ensemble, self.progress = scene, objective, ensemble, progress
        self.by_overturning = by_overturning
        self.none = jnp.array([0.0, float(objective.p.lam), float(objective.p.zeta)])
        self.bare = objective.told(np.asarray(self.none)[None])
        self.bare_value = float(objective.value(self.bare)[0])
        self.bare_reached = self._reached(np.asarray(self.none))
        self._bare_status: dict[int, str] = {}
        self.bare_outcomes: Outcomes | None = None

    def best_of(self, search: Search) -> tuple[OverStatus, tuple[Judged, ...]]:
        """The best design that nothing is to be said against, after those that something is."""
        if np.all(self.bare.kind == KINDS.index("rest")) and not np.any(self.bare.lost):
            return OverStatus.no_uplift, ()
        order = search.order()
        if not len(order):
            return OverStatus.none_feasible, ()
        helps = order[search.values[order] < self.bare_value]
        if not len(helps):
            return OverStatus.no_improvement, ()
        out: list[Judged] = []
        if self._stands(search, helps, out, 1):
            return OverStatus.found, tuple(out)
        # What stands need not be where a descent ends: a neighbour of the best is better than another's best.
        wider = search.with_the_way(self.bare_value)
        order = wider.order()
        helps = order[wider.values[order] < self.bare_value]
        found = self._stands(wider, helps, out, LOOKED_AT)
        return OverStatus.found if found else OverStatus.refused, tuple(out)

    def nearest(self, search: Search) -> str:
        """Where no design keeps to the limits: the one whose largest excess is least, and what it breaks."""
        order = search.order(feasible=False)
        if not len(order) or np.isfinite(search.values[order]).any():
            return ""
        over = search.column(lambda g: g.local.limit)
        i = order[np.argmin(np.max(over[order], axis=1))]
        name, n = self.objective.conditions.name, len(self.objective.conditions)
        each = dict(zip(self.objective.limit_names()[::n], over[i].reshape(-1, n), strict=True))
        broken = [
            f"{limit} by {excess.max():.2g} of it {name(int(np.argmax(excess)))}"
            for limit, excess in sorted(each.items(), key=lambda item: -item[1].max())
            if excess.max() > FEASIBLE
        ]
        at = "mu {:.4g}, lam {:.4g}, zeta {:.4g}".format(*search.designs[i])
        return f"{at}: it breaks the limit on {', and that on '.join(broken)}"

    def _stands(self, search: Search, helps: np.ndarray, out: list[Judged], most: int) -> bool:
        """Judge the first of some designs until nothing is to be said against one, or `most` are judged."""
        apart = self._apart(search, helps)
        reached = [self._reached(search.designs[i]) for i in apart]
        # Designs that events from rest speak against come last: they are told of if all are refused.
        worse = np.array([self._harm(names)[0] for names, _ in reached])
        lost = np.array([np.sum(names == "overturned") for names, _ in reached])
        order = np.lexsort((lost if self.by_overturning else np.zeros_like(lost), worse))
        known = {(j.mass_ratio, j.length_ratio, j.damping_ratio) for j in out}
        for i in (i for i in order if tuple(search.designs[apart[i]].tolist()) not in known):
            if len(out) == most:
                break
            if self.progress is not None:
                self.progress("judging", len(out) + 1, LOOKED_AT)
            out.append(self._judged(search, apart[i], *reached[i]))
            if not out[-1].objections:
                return True
        return False

    def _apart(self, search: Search, order: np.ndarray) -> list[int]:
        """The best designs that are no neighbours, as many as can be followed under all conditions."""
        return spread_out(search.units, order, max(LOOKED_AT, _RUNS // len(self.objective.conditions)))

    def _harm(self, reached: np.ndarray) -> tuple[bool, int, int]:
        """Whether significantly more conditions overturn the block from rest with a design than without,
        and under how many it does so with the one only and with the other only."""
        lost, bare = reached == "overturned", self.bare_reached[0] == "overturned"
        worse, better = int(np.sum(lost & ~bare)), int(np.sum(bare & ~lost))
        return worse > better and chance_of(worse, better) < SIGNIFICANT, worse, better

    def _judged(self, search: Search, i: int, reached: np.ndarray, tilt: np.ndarray) -> Judged:
        objective, design = self.objective, search.designs[i]
        told = objective.told(design[None])
        asked = self._nonlinear(design, told)
        found = Judged(
            mass_ratio=float(design[0]),
            length_ratio=float(design[1]),
            damping_ratio=float(design[2]),
            value=float(objective.value(told)[0]),
            told=told,
            reached=reached,
            reached_tilt=tilt,
            nonlinear=asked,
            nonlinear_bare=tuple(
                self._bare_nonlinear(i) if s == "overturned" else "" for i, _, _, s in asked
            ),
            verdict=None,
            stationarity=float(search.column(lambda g: g.stationarity)[i]),
            active=self._active(search, i, design),
            ended=i < search.ended,
            objections=self._objections(design, reached, asked),
        )
        if found.objections:
            return found
        return self._with_ensemble(found)

    def _with_ensemble(self, found: Judged) -> Judged:
        conditions, pendulum = self.objective.conditions, pendulum_of(self.scene, found)
        told = None if self.progress is None else stage(self.progress, "ensemble")
        if self.bare_outcomes is None:
            self.bare_outcomes = outcomes(
                self.scene, ensemble=self.ensemble, conditions=conditions, progress=told
            )
        judged = verdict(
            self.scene,
            pendulum,
            ensemble=self.ensemble,
            conditions=conditions,
            bare=self.bare_outcomes,
            progress=told,
        )
        against = (judged.objection,) if judged.harms else ()
        return replace(found, verdict=judged, objections=against)

    def _reached(self, design: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Names and settled tilts from rest, by events, under all conditions."""
        n = len(self.objective.conditions)
        p = under_all(self.objective.p, jnp.asarray(design)[None], self.objective.conditions)
        settled = settle_all(p, np.zeros((n, 4)), model=Piecewise(max_periods=self.ensemble.periods))
        names = names_of(settled.status)
        return names, np.where(names == "overturned", math.inf, np.asarray(settled.amplitude))

    def _nonlinear(self, design: np.ndarray, told: Told) -> tuple[tuple[int, float, float, str], ...]:
        """What the nonlinear equations say of the worst conditions and of those nearest to a limit, from
        rest."""
        rows = self.objective.conditions.rows()
        over = self.objective.limited(told)[0].reshape(-1, len(rows))
        names = self.objective.limit_names()[:: len(rows)]
        # How near an orbit is to where it stops attracting is no size that these equations give.
        unasked = ("reserve", "multiplier", "ball")
        held = np.max([row for row, n in zip(over, names, strict=True) if n not in unasked], axis=0)
        worst = np.argsort(-told.merit[0], kind="stable")[:_ASKED]
        near = [i for i in np.argsort(-held, kind="stable") if i not in worst and held[i] > -_MET]
        out = []
        for i in [*worst, *near[:_NEAR]]:
            out.append((int(i), *nonlinear(under(self.objective.p, jnp.asarray(design), rows[int(i)]))))
        return tuple(out)

    def _bare_nonlinear(self, i: int) -> str:
        """What becomes of the bare block by the same equations."""
        if i not in self._bare_status:
            p = under(self.objective.p, self.none, self.objective.conditions.rows()[i])
            self._bare_status[i] = nonlinear(p)[2]
        return self._bare_status[i]

    def _objections(
        self, design: np.ndarray, reached: np.ndarray, asked: tuple[tuple[int, float, float, str], ...]
    ) -> tuple[str, ...]:
        out, name = [], self.objective.conditions.name
        harms, worse, better = self._harm(reached)
        if harms:
            out.append(
                f"from rest the block overturns under {worse} of {len(reached)} conditions that it stands "
                f"without the pendulum, and stands {better} under which it overturns without"
            )
        for i, amplitude, stroke, status in asked:
            bare = self.bare_reached[0][i], self._bare_nonlinear(i) if status == "overturned" else ""
            if status == "overturned" and "overturned" not in bare:
                out.append(f"by the nonlinear equations the block overturns {name(i)}, and bare it stands")
            elif status in SETTLED:
                broken = self._broken(design, i, amplitude, stroke)
                out += [f"by the nonlinear equations it breaks {what} {name(i)}" for what in broken]
        return tuple(out)

    def _broken(self, design: np.ndarray, i: int, amplitude: float, stroke: float) -> list[str]:
        """The limits that angles (rad) of these sizes break under the i-th condition."""
        objective, limits = self.objective, self.objective.limits
        sizes = {"stroke": stroke / objective.space.stroke}
        if limits.relative_stroke is not None:
            sizes["relative_stroke"] = (stroke + amplitude) / limits.relative_stroke
        if limits.tilt is not None:
            nu = float(objective.p.nu) * objective.conditions.column("slenderness")[i]
            sizes["tilt"] = amplitude / nu / limits.tilt
        angle = np.full((1, len(objective.conditions)), amplitude + stroke)
        sizes |= {name: taken[0, i] for name, taken in objective.room(design[None], angle).items()}
        return [f"the limit on {n} by {x - 1.0:.2g} of it" for n, x in sizes.items() if x > 1.0 + FEASIBLE]

    def _active(self, search: Search, i: int, design: np.ndarray) -> tuple[str, ...]:
        """What holds the design."""
        on = search.column(lambda g: g.weights[0])[i]
        by = search.column(lambda g: g.weights[1])[i]
        name, n = self.objective.conditions.name, len(self.objective.conditions)
        out = [f"tilt {name(int(j))} ({on[j]:.2f})" for j in np.argsort(-on)[:6] if on[j] > 0.02]
        if self.objective.measure.share >= 1.0:
            out = ["the mean tilt"]
        names = self.objective.limit_names()
        over = search.column(lambda g: g.local.limit)[i]
        # A limit that is met may carry no weight where another one beside it does.
        met = (by > 1e-4) | (over > -_MET)
        order = np.lexsort((-over, -by))[:6]
        out += [f"limit on {names[j]} {name(int(j) % n)}" for j in order if met[j]]
        low, high = self.objective.space.bounds
        for value, least, most, what in zip(design, low, high, ("mass", "length", "damping"), strict=False):
            for word, bound in (("least", least), ("largest", most)):
                if abs(value - bound) < AT_BOUND * (most - least):
                    out.append(f"the {word} {what} ratio, {value:.4g}")
        return tuple(out)
