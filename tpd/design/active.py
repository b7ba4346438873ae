"""Conditions, limits and bounds that hold a design at its optimum, or that no design keeps."""

from __future__ import annotations

import numpy as np

from tpd.design.ends import Ends
from tpd.design.objective import BACK_OFF, Orbits
from tpd.design.result import Nearest
from tpd.design.search import AT_BOUND
from tpd.design.survey import Survey
from tpd.design.verified import Active, Reason, ReasonKind, Step

_MOST = 6
"""Most conditions that are listed."""
_LIGHT = 0.02
"""Weight below which a condition does not count as holding the design."""


def active(objective: Orbits, end: Ends, at_limit: float) -> tuple[Active, ...]:
    """Active conditions, limits and bounds at one end; a limit counts as met within a share `at_limit` of
    it."""
    return (*_conditions(objective, end), *_limits(objective, end, at_limit), *_bounds(objective, end))


def _conditions(objective: Orbits, end: Ends) -> list[Active]:
    """Conditions by their weight in the gradient of the risk; none for the mean, where all weigh alike."""
    if objective.risk.share >= 1.0:
        return []
    weights = end.weights[0][0]
    label = objective.conditions.label
    # Weights sum to one: what is left out weighs less than a fiftieth.
    heavy = [int(j) for j in np.argsort(-weights)[:_MOST] if weights[j] > _LIGHT]
    return [Active(kind="tilt", name="tilt", condition=label(j), weight=float(weights[j])) for j in heavy]


def _limits(objective: Orbits, end: Ends, at_limit: float) -> list[Active]:
    """Limits that are met, each under the condition that holds the design most."""
    conditions = objective.conditions
    names, n = objective.constraint_names(), len(conditions)
    weights = end.weights[1][0].reshape(len(names), n)
    excess = end.local.limit[0].reshape(len(names), n) - BACK_OFF
    # A limit that is met may carry no weight where another one beside it does.
    met = (weights > 1e-4) | (excess > -at_limit)
    best = [int(np.lexsort((-excess[k], -weights[k]))[0]) for k in range(len(names))]
    order = sorted(range(len(names)), key=lambda k: (-weights[k].sum(), -excess[k].max()))
    return [
        Active(
            kind="limit", name=names[k], condition=conditions.label(best[k]), weight=float(weights[k].sum())
        )
        for k in order
        if met[k].any()
    ]


def _bounds(objective: Orbits, end: Ends) -> list[Active]:
    low, high = objective.space.bounds
    design, out = objective.space.unscaled(end.x)[0], []
    for value, least, most, name in zip(design, low, high, ("mass", "length", "damping"), strict=False):
        for kind, bound in (("lower bound", least), ("upper bound", most)):
            # A search that ends at a bound asks for another bound, not for another design.
            if abs(value - bound) < AT_BOUND * (most - least):
                out.append(Active(kind=kind, name=name, condition="", weight=float(value)))
    return out


def nearest_of(found: Survey) -> Nearest:
    """Design of least excess in a survey; its best one comes first."""
    excess = sorted(((float(x[0]), name) for name, x in found.excess.items() if x[0] > 0.0), reverse=True)
    step = Step.exact if found.equations == "linear" else Step.nonlinear
    broken = tuple(
        Reason(step=step, kind=ReasonKind.breaks_limit, limit=name, value=1.0 + x) for x, name in excess
    )
    return Nearest(design=found.designs[0], broken=broken)
