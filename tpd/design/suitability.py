"""Whether a pendulum can be hung: what `optimise` asks of its designs, asked of one; and how it moves by all
models."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from tpd.answers.compare_models import Check, check
from tpd.core.progress import Progress
from tpd.design.criteria import DesignSpace, Mass, Offset, Worsening, Worth, stroke_limit
from tpd.design.problem import Problem
from tpd.design.survey import ROOM
from tpd.design.verified import Reason, ReasonKind, Verified, one_of_a_kind
from tpd.design.verify import HEIGHT, Verification
from tpd.scene.scene import Pendulum, Scene


@dataclass(frozen=True, kw_only=True)
class Suitability:
    """A pendulum by all models, from rest under the conditions of the question, and by paired runs."""

    scene: Scene
    pendulum: Pendulum
    check: Check
    verified: Verified
    """The pendulum by the steps that verify a design of `optimise`; its reasons are the verdict."""
    needed: bool
    """Whether the bare block moves under some condition."""
    worth: Worth

    @property
    def refusals(self) -> tuple[str, ...]:
        """Sentences that say why not to hang it, the gravest last; empty if nothing speaks against it."""
        if not self.needed:
            return ("does not help: under all conditions the bare block settles at rest: none is needed",)
        found = [f"{_sort(reason)}: {reason}" for reason in one_of_a_kind(self.verified.reasons)]
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
    kinds = ReasonKind.rocks_more, ReasonKind.too_little_benefit, ReasonKind.rests_less
    if reason.kind in (ReasonKind.strikes, ReasonKind.as_built) or reason.limit in (
        *ROOM,
        HEIGHT,
        Mass.name,
        Offset.name,
    ):
        return "does not fit"
    helps_less = reason.kind in (*kinds, ReasonKind.worse_condition) or reason.limit == Worsening.name
    return "does not help" if helps_less else "DO NOT USE"


def rests(asked: Problem) -> bool:
    """Whether the bare block settles at rest under all conditions, so that no pendulum is needed."""
    return Verification(asked, None).bare_rests


def judged(
    asked: Problem, pendulum: Pendulum, progress: Progress | None = None
) -> tuple[Verified, Verification]:
    """A pendulum by the steps that verify a design of `optimise` and the fresh runs that judge once, and what
    it is compared with. Where something refuses it, the other steps are told all the same."""
    block = asked.scene.block
    ratios = pendulum.mass / block.mass, pendulum.length / block.half_height, pendulum.damping_ratio
    design = np.array([float(x) for x in ratios])
    # A space that holds the design: it may lie outside of that of the search.
    verification = Verification(replace(asked, space=_holding(asked.space, design)), progress)
    v = verification.at_once(design)
    if not v.reasons:
        v = verification.by_fresh_runs(v)
    if v.rest is None:
        rested = verification.by_rest(v)
        v = replace(rested, reasons=(*v.reasons, *rested.reasons))
    if v.paired is None:
        counted = verification.by_runs(v)
        v = replace(counted, reasons=(*v.reasons, *counted.reasons))
    return replace(v, source="check"), verification


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


def suitability(
    scene: Scene,
    pendulum: Pendulum,
    *,
    asked: Problem | None = None,
    models: tuple[str, ...] | None = None,
    progress: Progress | None = None,
) -> Suitability:
    """Ask whether a pendulum can be hung, as `optimise` asks it of its designs.

    Args:
        scene: the block and its shaking.
        pendulum: the one to be hung.
        asked: question of `optimise` about the scene; by default with all its defaults.
        models: names of models, as in `tpd.check`.
        progress: called with ("checking", models done, of how many), and by the stages of the verification.

    Raises:
        ValueError: an unknown model, a block without a cavity, or a limit that is not positive.
        RuntimeError: JAX is in 32-bit mode.
    """
    asked = Problem.of(scene) if asked is None else asked
    found = check(scene, pendulum, stroke=stroke_limit(asked.limits), models=models, progress=progress)
    v, verification = judged(asked, pendulum, progress)
    return Suitability(
        scene=scene,
        pendulum=pendulum,
        check=found,
        verified=v,
        needed=not verification.bare_rests,
        worth=asked.worth,
    )
