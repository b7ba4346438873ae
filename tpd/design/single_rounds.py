"""Linear equations inside, nonlinear ones outside: the best design is put to (4), and where it breaks a
limit there, the search goes on under a corrected one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np

from tpd.analysis.compare_models import nonlinear, objections
from tpd.core.parameters import Parameters
from tpd.core.progress import Progress
from tpd.design.result import Candidate, DesignSpace, DesignStatus, Round
from tpd.design.single_candidates import judge, rank, solved
from tpd.design.single_found import Found, choose
from tpd.design.single_search import descend, with_design
from tpd.models.base import AbstractModel

ROUNDS = 4
"""Most designs put to the nonlinear equations."""


@dataclass(frozen=True)
class Inside:
    """What the linear search needs to go on."""

    p: Parameters
    """Of the bare block."""
    space: DesignSpace
    model: AbstractModel
    tolerance: float
    steps: int
    progress: Progress | None
    jury: Callable[[Candidate], tuple[str, ...]] | None = None
    """What an ensemble of runs has against a design."""


def confirmed(
    inside: Inside, found: Found, bare: Candidate, candidates: list[Candidate]
) -> tuple[Candidate | None, Candidate | None, DesignStatus, tuple[Round, ...]]:
    """The best design that the nonlinear equations have nothing against, the second best, what it is
    worth, and every round on the way: linear equations inside, nonlinear ones outside."""
    space, pool, rounds = inside.space, list(candidates), []
    without = math.nan
    while True:
        winner, runner_up = rank(pool, space)
        status = judge(winner, bare, inside.tolerance)
        offered = status in (DesignStatus.found, DesignStatus.models_disagree)
        if winner is None or not offered or found.interrupted:
            if rounds and not offered:
                status = DesignStatus.nonlinear_objects
            return winner, runner_up, status, tuple(rounds)
        try:
            without = nonlinear(inside.p)[0] if not rounds else without
            rounds.append(_round(inside, space.stroke, winner, without))
            if not rounds[-1].objections and inside.jury is not None:
                rounds[-1] = replace(rounds[-1], objections=inside.jury(winner))
        except KeyboardInterrupt:
            return winner, runner_up, DesignStatus.interrupted, tuple(rounds)
        if not rounds[-1].objections:
            return winner, runner_up, status, tuple(rounds)
        if len(rounds) == ROUNDS:
            return winner, runner_up, DesignStatus.nonlinear_objects, tuple(rounds)
        space = replace(space, stroke=_corrected(inside.space.stroke, winner, rounds[-1]))
        try:
            more = _onward(inside, space, found)
        except KeyboardInterrupt:
            return winner, runner_up, DesignStatus.interrupted, tuple(rounds)
        pool = [c for c in pool if c is not winner] + more


def at_rest(inside: Inside, bare: Candidate) -> tuple[DesignStatus, tuple[Round, ...]]:
    """Whether a bare block that settles at rest by the linear equations does so by the nonlinear ones."""
    told = _round(inside, math.inf, bare, math.inf)
    if told.status == "rest":
        return DesignStatus.no_uplift, ()
    objection = f"by the nonlinear equations the bare block does not settle at rest but ends {told.status}"
    return DesignStatus.nonlinear_objects, (replace(told, objections=(objection,)),)


def _round(inside: Inside, limit: float, winner: Candidate, without: float) -> Round:
    """A design put to the nonlinear equations, under the limit asked for; `without` is the bare block's
    amplitude by them."""
    at = np.array([winner.mass_ratio, winner.length_ratio, winner.damping_ratio])
    amplitude, stroke, status = nonlinear(with_design(inside.p, jnp.asarray(at)))
    return Round(
        limit=limit,
        mass_ratio=winner.mass_ratio,
        length_ratio=winner.length_ratio,
        damping_ratio=winner.damping_ratio,
        amplitude=amplitude,
        stroke=stroke,
        status=status,
        objections=objections(amplitude, stroke, status, inside.space.stroke, without),
    )


def _corrected(limit: float, winner: Candidate, last: Round) -> float:
    """A linear stroke at which the nonlinear one keeps to the limit, if both stay in proportion; where
    the motion is another one, less of it."""
    share = limit / last.stroke if last.stroke > limit and np.isfinite(last.stroke) else 0.8
    return min(0.98 * share * winner.stroke, 0.98 * last.limit) if winner.stroke > 0 else 0.8 * last.limit


def _onward(inside: Inside, space: DesignSpace, found: Found) -> list[Candidate]:
    """More designs, searched for under another limit from the best of those screened."""
    if found.evaluate is None or inside.steps == 0:
        return []
    chosen = choose(found.screened, space, len(found.best))
    path, interrupted = descend(found.evaluate, space, chosen, steps=inside.steps, progress=inside.progress)
    if interrupted:
        raise KeyboardInterrupt
    best = path.best(space.stroke)
    designs = [path.designs[i, j] for i, j in enumerate(best) if j >= 0]
    designs += list(found.screened.designs[found.screened.order(space.stroke)[:2]])
    if not designs:
        return []
    return solved(inside.p, designs, found, inside.tolerance, inside.model, inside.progress)
