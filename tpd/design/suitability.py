"""Whether a pendulum can be hung: what `optimise` asks of its designs, asked of one; and how it moves by all
models and under shakings around its own."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from tpd.analysis.attractors import Starts
from tpd.analysis.compare_models import Check, check
from tpd.analysis.ensemble import Ensemble
from tpd.core.bob import Bob
from tpd.core.conditions import Conditions, under_all
from tpd.core.parameters import as_arrays
from tpd.core.progress import Progress
from tpd.core.scene import Pendulum, Scene
from tpd.core.status import names_of
from tpd.design.active import broken_at, nearest_of
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
from tpd.design.search import Multistart
from tpd.design.space import DesignSpace
from tpd.design.steps import HEIGHT
from tpd.design.survey import ROOM, followed
from tpd.design.verified import Verified
from tpd.design.verify import Verification
from tpd.design.worth import Worth
from tpd.models.compiled_nonlinear import settle_nonlinear

_NEARBY = (-0.01, -0.005, 0.005, 0.01)
"""Changes of the base motion's amplitude, and of its frequency."""
_MOST = 64
"""Most conditions of a job that are followed."""


@dataclass(frozen=True, kw_only=True)
class Motions:
    """Motions from rest by the nonlinear equations, (n,); infinite where the block overturns."""

    status: np.ndarray
    amplitude: np.ndarray
    """Settled |phi|, rad."""
    settled: np.ndarray
    """Bound on the settled angle between rod and block, rad."""
    way: np.ndarray
    """Bound on that angle from the start on, rad."""

    @property
    def overturned(self) -> int:
        """Number of motions that overturn the block."""
        return int(np.sum(self.status == "overturned"))


@dataclass(frozen=True, kw_only=True)
class Suitability:
    """A pendulum by all models, under the shakings around its own, and in the cavity of its block."""

    scene: Scene
    pendulum: Pendulum
    bob: Bob
    check: Check
    shakings: Conditions
    """The scene's own shaking first, then its neighbours, or the conditions of the question."""
    several: bool
    """Whether the shakings are these conditions."""
    hung: Motions
    bare: Motions
    verified: Verified
    """The pendulum by the steps that verify a design of `optimise`; its reasons are the verdict."""
    needed: bool
    """Whether the bare block moves under some condition."""
    worth: Worth

    @property
    def tried(self) -> int:
        """Number of shakings beside the scene's own."""
        return len(self.shakings) - 1

    @property
    def lost(self) -> tuple[int, int]:
        """Shakings beside the own one that overturn the block: with the pendulum and without."""
        # The own shaking is told by the comparison of models already.
        own = (m.status[0] == "overturned" for m in (self.hung, self.bare))
        with_it, without = (m.overturned - int(o) for m, o in zip((self.hung, self.bare), own, strict=True))
        return with_it, without

    @property
    def worse(self) -> int:
        """Shakings beside the own one under which the block stands bare, and with the pendulum rocks more."""
        with_it, without = self.hung.amplitude[1:], self.bare.amplitude[1:]
        # A block that rests up to round-off is no worse than any other.
        return int(np.sum(np.isfinite(without) & (with_it > 1e-9) & (with_it > without)))

    @property
    def around(self) -> str:
        """Phrase for the shakings."""
        what = "conditions" if self.several else "shakings within 1 % in amplitude or frequency"
        return f"{self.tried} {what}"

    @property
    def reach(self) -> tuple[float, float]:
        """Largest distances (m) of the bob's surface from the block's axis, settled and on the way from
        rest, of the motions that stand; NaN where none does."""
        # A job's conditions need not hold the scene's own shaking.
        rows = slice(1, None) if self.several else slice(0, 1)
        length, mass = (self.shakings.column(name)[rows] for name in ("length", "mass"))
        rod, heavy = self.pendulum.length * length, self.pendulum.mass * mass

        def largest(angle: np.ndarray) -> float:
            stands = np.isfinite(angle)
            far = np.asarray(self.bob.reach(heavy, rod, np.where(stands, angle, 0.0)))
            return float(np.max(far[stands], initial=-math.inf)) if stands.any() else math.nan

        return largest(self.hung.settled[rows]), largest(self.hung.way[rows])

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
            f"({v.strikes:.1%}, and {self.worth.strikes:.1%} is allowed){left}."
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
        inputs = self.scene, problem.objective, problem.method, self.ensemble, problem.worth
        made, finer = Verification(*inputs, False, progress), problem.over_basins
        return made if finer is None else made.on(finer, "check")


def rests(asked: Question) -> bool:
    """Whether the bare block settles at rest under all conditions, so that no pendulum is needed."""
    return _rests(asked.verification(asked.problem(), None))


def _rests(verification: Verification) -> bool:
    return verification.rests and verification.bare_rests_nonlinearly()


def judged(
    asked: Question, pendulum: Pendulum, progress: Progress | None = None
) -> tuple[Verified, Verification]:
    """A pendulum by the steps that verify a design of `optimise`, and what it is compared with: limits from
    rest under every condition as in the survey, then the verification, then the fresh runs that judge once.
    Where something else refuses it, its paired runs are counted all the same.

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
    search = Multistart(objective, problem.method, asked.seed, progress)
    v = verification.at_once(search, design)
    broken = [*_too_heavy(asked.limits, pendulum), *_limits_broken(verification, search, design, asked.seed)]
    if not v.reasons and not broken:
        v = verification.by_fresh_runs(v)
    elif v.paired is None:
        counted = verification.by_runs(v)
        v = replace(counted, reasons=(*v.reasons, *counted.reasons))
    return replace(v, source="check", reasons=(*broken, *v.reasons)), verification


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


def _limits_broken(
    verification: Verification, search: Multistart, design: np.ndarray, seed: int
) -> tuple[Reason, ...]:
    """Limits that a search or its survey would drop the design for."""
    objective = verification.objective
    if len(objective.conditions) > 1:
        few = objective.over(objective.conditions.subset(SURVEYED, seed))
        found = followed(few, design[None], verification.ensemble.periods, "nonlinear", None)
        return nearest_of(found).broken
    wider = search.with_designs(objective.space.scaled(design[None]))
    return tuple(broken_at(wider, wider.excess[-1]))


def suitability(
    scene: Scene,
    pendulum: Pendulum,
    *,
    asked: Question | None = None,
    bob: Bob | None = None,
    models: tuple[str, ...] | None = None,
    progress: Progress | None = None,
) -> Suitability:
    """Ask whether a pendulum can be hung, as `optimise` asks it of its designs.

    Args:
        scene: the block and its shaking.
        pendulum: the one to be hung.
        asked: conditions, starts, limits and runs; by default those of `optimise`.
        bob: the body at the end of the rod; default that of the limit on room, else a ball of steel.
        models: names of models, as in `tpd.check`.
        progress: called with ("checking", models done, of how many), and by the stages of the verification.

    Raises:
        ValueError: an unknown model, a block without a cavity, or a limit that is not positive.
        RuntimeError: JAX is in 32-bit mode.
    """
    asked = Question(scene=scene) if asked is None else asked
    room = limit_of(asked.limits, Room)
    check_cavity(scene.block, asked.limits)
    found = check(scene, pendulum, stroke=stroke_limit(asked.limits), models=models, progress=progress)
    v, verification = judged(asked, pendulum, progress)
    conditions = verification.objective.conditions
    several = len(conditions) > 1
    shakings = _with_own(conditions.subset(_MOST) if several else neighbours())
    return Suitability(
        scene=scene,
        pendulum=pendulum,
        bob=bob or (room.bob if isinstance(room, Room) else Bob()),
        check=found,
        shakings=shakings,
        several=several,
        hung=motions(scene, pendulum, shakings),
        bare=motions(scene, None, shakings),
        verified=v,
        needed=not _rests(verification),
        worth=asked.worth,
    )


def neighbours() -> Conditions:
    """Eight shakings within 1 % in amplitude or frequency."""
    shakes = [(1.0 + d, 1.0) for d in _NEARBY] + [(1.0, 1.0 + d) for d in _NEARBY]
    amplitude, frequency = np.array(shakes).T
    return Conditions({"amplitude": amplitude, "frequency": frequency})


def _with_own(conditions: Conditions) -> Conditions:
    """The scene's own shaking, followed by the conditions."""
    return Conditions({name: np.concatenate([[1.0], x]) for name, x in conditions.factors.items()})


def motions(scene: Scene, pendulum: Pendulum | None, conditions: Conditions) -> Motions:
    """Follow the block from rest by the nonlinear equations under every condition."""
    p = as_arrays(scene.parameters(pendulum))
    design = np.array([[p.mu, p.lam, p.zeta]])
    settled = settle_nonlinear(under_all(p, design, conditions), np.zeros((len(conditions), 4)))
    status = names_of(settled.status)

    def column(*names: str) -> np.ndarray:
        return np.where(status == "overturned", np.inf, sum(np.asarray(getattr(settled, n)) for n in names))

    return Motions(
        status=status,
        amplitude=np.where(status == "rest", 0.0, column("amplitude")),
        # Both largest angles need not occur at once: their sum is a bound.
        settled=column("amplitude", "stroke"),
        way=column("peak", "peak_stroke"),
    )
