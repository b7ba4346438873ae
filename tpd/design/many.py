"""The pendulum that is best under many conditions, judged by events, nonlinear equations and an ensemble."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from tpd.analysis.attractors import Starts
from tpd.analysis.ensemble import Ensemble
from tpd.core import checks
from tpd.core.conditions import FACTORS, Conditions, Limits, Measure
from tpd.core.progress import Progress
from tpd.core.scene import Scene
from tpd.core.threads import aside
from tpd.design.basins import ReachedObjective
from tpd.design.checkpoint import Kept
from tpd.design.many_asked import METHODS
from tpd.design.many_result import DesignOver, Judged, OverStatus
from tpd.design.objective import Objective
from tpd.design.result import DesignSpace
from tpd.design.search import GROUP, Search
from tpd.design.verify import Judge, make_ready, pendulum_of

FOLLOWED = 500
"""Most forcing periods that a start is followed for its motion: what decays slowly has a slope as well."""
_MANY, _SAMPLED = 128, 64
"""From so many conditions on the starts are searched from under a sample of them, of this size."""
_FINISHING = 12
"""Bound on the steps over what starts reach."""


def optimise_over(
    scene: Scene,
    conditions: Conditions,
    space: DesignSpace | None = None,
    *,
    measure: Measure | None = None,
    limits: Limits | None = None,
    from_rest: bool = False,
    reached: Starts | None = None,
    by_share: bool = True,
    by_overturning: bool = False,
    ensemble: Ensemble | None = None,
    starts: int = 64,
    screening: int = 512,
    steps: int = 40,
    method: str = "sequential",
    seed: int = 0,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> DesignOver:
    """The pendulum of least rocking in the worst (or mean, or worst share) of many conditions.

    Under every condition the tilt is that of the largest attracting symmetric orbit, whichever start leads
    to it, or the uplift margin where there is none. The search is multi-start sequential programming on
    exact gradients; from 128 conditions on it first looks at 64 of them, and the best designs that lie apart
    are finished under all. Of what it finds the best is followed by events from rest under every condition,
    put to the nonlinear equations under the worst, and to the ensemble; the next best takes its place if it
    does not stand them.

    Args:
        scene: block and base motion, SI.
        conditions: see `Conditions`.
        space: bounds and stroke limit; default `DesignSpace()`.
        measure: default `Measure.worst()`.
        limits: more limits; default none.
        from_rest: count a condition as resting wherever a resting block stays, though rocking may attract
            from other starts.
        reached: finish the search over the motions that these starts settle into, followed by events under
            every condition, rather than over all symmetric orbits.
        by_share: of these the mean over the starts counts, every motion weighted by the share of the starts
            that reaches it; otherwise the worst start, which asks for the uplift margin alone as long as one
            of them overturns.
        by_overturning: of the designs found that rock less than the bare block, look first at those that
            overturn under the fewest conditions from rest, rather than at those that rock least.
        ensemble: that judges; default `Ensemble()`, its runs dealt out among the conditions.
        starts: searches.
        screening: designs solved before.
        steps: bound on the steps of each search; with optax their number.
        method: "sequential" programming, or optax on a smoothed measure: "adam", "lbfgs". The first needs the
            fewest designs and ends at kinks as surely as elsewhere.
        seed: of every random choice.
        checkpoint: a file that keeps finished searches; what it holds of the same problem is not repeated.
        progress: called with (stage, done, of how many).

    Raises:
        ValueError: bad input, or a checkpoint of another problem.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    for name, value in {"starts": starts, "steps": steps, "screening": screening}.items():
        checks.count(name, value)
    checks.count("seed", seed, least=0)
    checks.one_of("method", method, METHODS)
    if from_rest and reached is not None:
        raise ValueError("`from_rest` and `reached` exclude each other: one start, or several")
    limits = Limits() if limits is None else limits
    space = _narrowed(DesignSpace() if space is None else space, scene, limits)
    measure = Measure.worst() if measure is None else measure
    ensemble = Ensemble(seed=seed) if ensemble is None else ensemble
    objective = Objective.of(scene, conditions, space, measure, limits, from_rest)
    sampled = objective.fewer(_SAMPLED, seed) if len(conditions) >= _MANY else objective
    search = Search(sampled, starts, screening, steps, seed, progress, method)
    search.settings["conditions"] = len(sampled.conditions)
    problem = (scene, conditions, space, measure, limits, from_rest, search.settings)
    kept = Kept.of(checkpoint, problem if reached is None else (*problem, reached, by_share))
    sampled.trace()
    aside(lambda: make_ready(objective, ensemble))
    search.run(kept)
    if sampled is not objective:
        search.words += f" under {_SAMPLED} of the {len(conditions)} conditions"
        search = search.carry_on(objective, kept, "under all of them", steps, GROUP)
        if search.interrupted:
            search.look_at_the_rest()
    if reached is not None and len(search.units) and not search.interrupted:
        finer = ReachedObjective(**vars(objective), starts=reached, by_share=by_share, periods=FOLLOWED)
        on = search.carry_on(finer, kept, "over what starts reach", _FINISHING, 1)
        if on.groups:
            search, objective = on, finer
        search.interrupted = on.interrupted
    judge = Judge(scene, objective, ensemble, by_overturning, progress)
    status, judged = judge.best_of(search)
    offered = judged[-1] if judged and not judged[-1].objections else None
    return DesignOver(
        scene=scene,
        conditions=conditions,
        space=space,
        measure=measure,
        limits=limits,
        from_rest=from_rest,
        reached=objective.starts if isinstance(objective, ReachedObjective) else None,
        by_share=by_share,
        status=OverStatus.interrupted if search.interrupted else status,
        pendulum=None if offered is None else pendulum_of(scene, offered),
        judged=judged,
        nearest=judge.nearest(search),
        bare=judge.bare,
        bare_value=judge.bare_value,
        bare_reached=judge.bare_reached[0],
        bare_outcomes=judge.bare_outcomes,
        elasticities={} if offered is None else _elasticities(objective, offered),
        screened=search.screened,
        screened_value=search.screened_value,
        starts=search.statuses(),
        paths=tuple(search.paths),
        ends=search.designs,
        end_values=search.values,
        evaluations=search.evaluations,
        searched=search.words,
        seed=seed,
        settings=search.settings,
    )


def _narrowed(space: DesignSpace, scene: Scene, limits: Limits) -> DesignSpace:
    """The space within the limit on the bob's mass."""
    if limits.mass is None:
        return space
    low, high = space.mass_ratio
    most = limits.mass / scene.block.mass
    if most <= low:
        raise ValueError(
            f"`mass` must be above the least bob of the design space, {low * scene.block.mass:g} kg, but is "
            f"{limits.mass:g} kg"
        )
    return replace(space, mass_ratio=(low, min(high, most)))


def _elasticities(objective: Objective, of: Judged) -> dict[str, float]:
    """d ln(value)/d ln(factor) by central differences of 0.1 %; over what starts reach exact, of the
    pendulum's own three only: a difference would be one of leaps of single starts."""
    design, step = np.array([[of.mass_ratio, of.length_ratio, of.damping_ratio]]), 1e-3
    if isinstance(objective, ReachedObjective):
        return objective.elasticities(of.told, design[0])
    out = {}
    for name in FACTORS:
        sides = []
        for factor in (1.0 - step, 1.0 + step):
            moved = objective.conditions * Conditions({name: np.array([factor])})
            changed = replace(objective, conditions=moved)
            sides.append(float(changed.value(changed.told(design))[0]))
        out[name] = (sides[1] - sides[0]) / (2.0 * step * abs(of.value)) if of.value else math.nan
    return out
