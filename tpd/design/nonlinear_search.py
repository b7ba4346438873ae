"""Search on the nonlinear equations (4), for when they refuse what the linear equations find.

A linear search under tightened limits cannot find a design that only the nonlinear equations allow. So the
search goes on with the settled motion of the nonlinear equations itself, its limits and its exact
derivatives: what is offered then is a local optimum of the nonlinear problem. A motion by `Segmented` takes a
hundredth of a second or two, hence hundreds of designs are affordable."""

from __future__ import annotations

import numpy as np

from tpd.analysis.attractors import Starts
from tpd.core.progress import Progress
from tpd.core.sampling import latin_hypercube
from tpd.design.followed import Followed
from tpd.design.methods import Sequential
from tpd.design.objective import AbstractObjective, Orbits
from tpd.design.reasons import Step
from tpd.design.result import DesignStatus
from tpd.design.screening import best_apart
from tpd.design.search import Multistart, stage
from tpd.design.verified import Verified
from tpd.models.segmented import Segmented

MOST_CONDITIONS = 32
"""Conditions up to which the nonlinear search is affordable."""
_SPREAD, _BEST = 96, 32
"""Designs screened: a Latin hypercube, and the best designs of the linear search that lie apart."""
_METHOD = Sequential(model=Segmented(lyapunov_periods=0), searches=8, screening=_SPREAD + _BEST, steps=24)


def wanted(status: DesignStatus, verified: list[Verified], objective: AbstractObjective) -> bool:
    """Whether the nonlinear equations may have another answer than the linear search: with one condition
    whenever that offers none, with several where the nonlinear equations refused a design."""
    n = len(objective.conditions)
    # The search was on the nonlinear equations already: nothing more to be had from them.
    if isinstance(objective, Followed) and isinstance(objective.model, Segmented):
        return False
    if status is DesignStatus.found or n > MOST_CONDITIONS:
        return False
    refused = any(reason.step is Step.nonlinear for v in verified for reason in v.reasons)
    return n == 1 or (status is DesignStatus.refused and refused)


def nonlinear_search(
    objective: AbstractObjective, search: Multistart, seed: int, progress: Progress | None
) -> Multistart:
    """Sequential programming on the nonlinear motion from rest, from the best of a nonlinear screening."""
    o = objective
    followed = nonlinear_objective(objective)
    on = Multistart(followed, _METHOD, seed, progress)
    # Half of the budget on designs that the linear search knows nothing of: where the two sets of equations
    # differ most, its ranking is of no use.
    units = _screened(search, seed)
    after = None if progress is None else stage(progress, "nonlinear screening")
    e = followed.evaluate(o.space.unscaled(units), after)
    local = followed.linearised(e)
    excess = np.maximum(local.limit, 0.0).sum(axis=1)
    on.screened, on.screened_value = e.design, followed.value(e) + excess
    on.feasible, on.overturned = excess == 0.0, np.any(~e.attracts, axis=1)
    chosen = best_apart(units, on.screened_value, _METHOD.searches)

    def stepped(done: int, of: int) -> None:
        if progress is not None:
            progress("nonlinear search", done, of)

    ends = _METHOD.search(followed, units[chosen], known=local.at(chosen), after=stepped)
    on.groups, on.count = [ends], len(chosen)
    on.description = f"{len(units)} designs by the nonlinear equations"
    return on


def nonlinear_objective(objective: AbstractObjective) -> Followed:
    """Objective over the nonlinear motions from rest under the same limits. If the reserve of orbits was one
    of those that the linear search kept to, it still is: the closed form states it."""
    model, o = _METHOD.model, objective
    assert model is not None
    orbits = o if isinstance(o, Orbits) else o.orbits if isinstance(o, Followed) else None
    common = o.p, o.conditions, o.space, o.risk, o.limits, o.geometry
    return Followed(*common, model=model, starts=Starts.rest(), orbits=orbits)


def _screened(search: Multistart, seed: int) -> np.ndarray:
    """Designs in shares of the bounds: spread evenly, and the best that the linear search met."""
    space = search.objective.space
    rng = np.random.default_rng([seed, 5])
    spread = latin_hypercube(rng, _SPREAD, space.bounds.shape[1])
    ends = search.units[search.order(feasible=False)]
    # A linear search without groups was not needed: its screening is empty as well.
    order = np.argsort(search.screened_value, kind="stable")
    met = np.concatenate([ends, space.scaled(search.screened[order])])
    return np.concatenate([met[best_apart(met, np.arange(len(met), dtype=float), _BEST)], spread])
