"""Whether a pendulum can be hung: what `optimise` asks of its designs, asked of one; and how it moves by all
models."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from tpd.analysis.attractors import Starts
from tpd.analysis.compare_models import Check, check
from tpd.analysis.ensemble import Ensemble
from tpd.core.conditions import Conditions
from tpd.core.progress import Progress
from tpd.core.scene import Pendulum, Scene
from tpd.design.active import nearest_of
from tpd.design.criteria import (
    DEFAULT_LIMITS,
    Limit,
    Mass,
    Offset,
    Risk,
    Room,
    Worsening,
    limit_of,
    stroke_limit,
)
from tpd.design.inputs import check_cavity
from tpd.design.methods import Method
from tpd.design.optimise import SURVEYED
from tpd.design.problem import Problem
from tpd.design.reasons import Reason, ReasonKind, Step
from tpd.design.space import DesignSpace
from tpd.design.steps import HEIGHT
from tpd.design.survey import ON_THE_WAY, ROOM, Survey, followed
from tpd.design.verified import Verified
from tpd.design.verify import Verification
from tpd.design.worth import Worth


@dataclass(frozen=True, kw_only=True)
class Suitability:
    """A pendulum by all models, from rest under the conditions of the question, and by paired runs."""

    scene: Scene
    pendulum: Pendulum
    check: Check
    rest: Survey
    """Motions from rest by the nonlinear equations under the conditions, a choice of them where there are
    many; of one design."""
    verified: Verified
    """The pendulum by the steps that verify a design of `optimise`; its reasons are the verdict."""
    needed: bool
    """Whether the bare block moves under some condition."""
    worth: Worth

    @property
    def from_rest(self) -> str:
        """Sentences on the motions from rest."""
        hung, bare, excess = self.rest.severity[0], self.rest.bare, self.rest.excess
        said = (
            f"By the nonlinear equations from rest, of {len(bare)} conditions: {np.sum(hung >= 1.0)} "
            f"overturn the block with the pendulum, {np.sum(bare >= 1.0)} without; under "
            f"{np.sum(hung > bare)} it rocks more with it."
        )
        if Room.name not in excess or np.all(hung >= 1.0):
            return said
        settled, way = (1.0 + float(excess[name][0]) for name in (Room.name, ON_THE_WAY))
        return f"{said} The bob comes to {settled:.0%} of the wall's distance once settled, {way:.0%} before."

    @property
    def refusals(self) -> tuple[str, ...]:
        """Sentences that say why not to hang it, the gravest last; empty if nothing speaks against it."""
        if not self.needed:
            return ("does not help: under all conditions the bare block settles at rest: none is needed",)
        kinds: dict[tuple[ReasonKind, str], Reason] = {}
        for reason in self.verified.reasons:
            kinds.setdefault((reason.kind, reason.limit), reason)
        found = [f"{_sort(reason)}: {reason}" for reason in kinds.values()]
        return tuple(sorted(found, key=lambda said: _SORTS.index(said.split(":")[0])))

    @property
    def counted(self) -> str:
        """In how many runs the block overturns and the bob strikes, and the benefit, in one sentence."""
        v = self.verified
        assert v.paired is not None
        hung, bare = v.paired.hung, v.paired.bare
        fresh = "" if v.chosen_by is None else "fresh "
        said = (
            f"Over {len(hung.status)} {fresh}paired runs of the nonlinear equations (seed "
            f"{hung.ensemble.seed}): {v.benefit}; {hung.overturned.value:.1%} overturn, "
            f"{bare.overturned.value:.1%} without"
        )
        if math.isnan(v.strikes):
            return f"{said}. No room for the bob is asked for."
        stands, unknown = int(np.sum(~(hung.lost | hung.undecided))), int(np.sum(hung.undecided))
        left = f"; {unknown} have no answer and are left out" if unknown else ""
        return (
            f"{said}; the bob strikes a wall in {v.strikes * stands:.0f} of the {stands} that stand "
            f"({v.strikes:.1%}, and {self.worth.allowed:.1%} is allowed){left}."
        )


_SORTS = ("does not help", "does not fit", "DO NOT USE")
"""Kinds of refusals, the gravest last."""


def _sort(reason: Reason) -> str:
    """Kind of a refusal that a reason belongs to."""
    match reason.kind:
        case ReasonKind.strikes:
            return "does not fit"
        case ReasonKind.breaks_limit if reason.limit in (*ROOM, HEIGHT, Mass.name, Offset.name):
            return "does not fit"
        case ReasonKind.breaks_limit if reason.limit == Worsening.name:
            return "does not help"
        case ReasonKind.rocks_more | ReasonKind.too_little_benefit:
            return "does not help"
        case ReasonKind.rests_less | ReasonKind.worse_condition:
            return "does not help"
        case _:
            return "DO NOT USE"


@dataclass(frozen=True, kw_only=True)
class Question:
    """Question that `optimise` asks of a design, in the same words: its arguments."""

    scene: Scene
    space: DesignSpace = field(default_factory=DesignSpace)
    conditions: Conditions | None = None
    """None is the neighbourhood of the scene's own shaking."""
    starts: Starts | None = None
    risk: Risk | None = None
    limits: tuple[Limit, ...] = DEFAULT_LIMITS
    method: Method | None = None
    ensemble: Ensemble = field(default_factory=Ensemble)
    worth: Worth = field(default_factory=Worth)
    seed: int = 0

    def problem(self, design: np.ndarray | None = None) -> Problem:
        """Problem in whose space a design (mu, lam, zeta) lies.

        Raises:
            ValueError: bad input.
        """
        # The limit on the mass narrows a space, and a design beyond it would lie outside.
        limits = tuple(x for x in self.limits if not isinstance(x, Mass))
        space = self.space if design is None else _holding(self.space, design)
        given = self.conditions, self.starts, self.risk, limits, self.method, self.seed, self.worth
        return Problem.of(self.scene, space, *given).against_bare()

    def verification(self, problem: Problem, progress: Progress | None) -> Verification:
        """Verification of designs of a problem."""
        return Verification(self.scene, problem.objective, self.ensemble, problem.worth, progress)


def rests(asked: Question) -> bool:
    """Whether the bare block settles at rest under all conditions, so that no pendulum is needed."""
    return _rests(asked.verification(asked.problem(), None))


def _rests(verification: Verification) -> bool:
    return verification.rests and verification.bare_rests_nonlinearly()


def judged(
    asked: Question, pendulum: Pendulum, progress: Progress | None = None
) -> tuple[Verified, Verification, Survey]:
    """A pendulum by the steps that verify a design of `optimise`, what it is compared with, and its motions
    from rest: limits from rest under the conditions of a survey, then the verification, then the fresh
    runs that judge once. Where something else refuses it, its paired runs are counted all the same.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    block = asked.scene.block
    ratios = pendulum.mass / block.mass, pendulum.length / block.half_height, pendulum.damping_ratio
    design = np.array([float(x) for x in ratios])
    problem = asked.problem(design)
    verification = asked.verification(problem, progress)
    objective = verification.objective
    few = objective.over(objective.conditions.subset(SURVEYED, asked.seed))
    rest = followed(few, design[None], asked.ensemble.periods, "nonlinear", None)
    v = verification.at_once(design)
    broken = *_too_heavy(asked.limits, pendulum), *nearest_of(rest).broken
    if not v.reasons and not broken:
        v = verification.by_fresh_runs(v)
    elif v.paired is None:
        counted = verification.by_runs(v)
        v = replace(counted, reasons=(*v.reasons, *counted.reasons))
    return replace(v, source="check", reasons=(*broken, *v.reasons)), verification, rest


def _holding(space: DesignSpace, design: np.ndarray) -> DesignSpace:
    """The space, wide enough for a design."""

    def with_it(bounds: float | tuple[float, float], x: float) -> float | tuple[float, float]:
        low, high = bounds if isinstance(bounds, tuple) else (bounds, bounds)
        low, high = min(low, x), max(high, x)
        return (low, high) if high > low else low

    mu, lam, zeta = map(float, design)
    return DesignSpace(
        mass_ratio=with_it(space.mass_ratio, mu),  # type: ignore[arg-type]
        length_ratio=with_it(space.length_ratio, lam),  # type: ignore[arg-type]
        damping_ratio=with_it(space.damping_ratio, zeta),
    )


def _too_heavy(limits: tuple[Limit, ...], pendulum: Pendulum) -> list[Reason]:
    """The limit on the mass, by which a search narrows its space, if a bob breaks it."""
    limit = limit_of(limits, Mass)
    # A mass that was made of its ratio may differ by rounding.
    if not isinstance(limit, Mass) or pendulum.mass <= limit.kg * (1.0 + 1e-9):
        return []
    value = float(pendulum.mass) / limit.kg
    return [Reason(step=Step.exact, kind=ReasonKind.breaks_limit, limit=Mass.name, value=value)]


def suitability(
    scene: Scene,
    pendulum: Pendulum,
    *,
    asked: Question | None = None,
    models: tuple[str, ...] | None = None,
    progress: Progress | None = None,
) -> Suitability:
    """Ask whether a pendulum can be hung, as `optimise` asks it of its designs.

    Args:
        scene: the block and its shaking.
        pendulum: the one to be hung.
        asked: conditions, starts, limits and runs; by default those of `optimise`.
        models: names of models, as in `tpd.check`.
        progress: called with ("checking", models done, of how many), and by the stages of the verification.

    Raises:
        ValueError: an unknown model, a block without a cavity, or a limit that is not positive.
        RuntimeError: JAX is in 32-bit mode.
    """
    asked = Question(scene=scene) if asked is None else asked
    check_cavity(scene.block, asked.limits)
    found = check(scene, pendulum, stroke=stroke_limit(asked.limits), models=models, progress=progress)
    v, verification, rest = judged(asked, pendulum, progress)
    return Suitability(
        scene=scene,
        pendulum=pendulum,
        check=found,
        rest=rest,
        verified=v,
        needed=not _rests(verification),
        worth=asked.worth,
    )
