"""Conditions, limits and bounds that hold a design at its optimum, or that no design keeps."""

from __future__ import annotations

import numpy as np

from tpd.design.reasons import Reason, ReasonKind, Step
from tpd.design.result import Nearest
from tpd.design.search import AT_BOUND, Multistart
from tpd.design.survey import Survey
from tpd.design.verified import Active

_MOST = 6
"""Most conditions that are listed."""
_LIGHT = 0.02
"""Weight below which a condition does not count as holding the design."""


def active(search: Multistart, i: int, at_limit: float) -> tuple[Active, ...]:
    """Active conditions, limits and bounds of the i-th end of a search; a limit counts as met within a share
    `at_limit` of it."""
    return (*_conditions(search, i), *_limits(search, i, at_limit), *_bounds(search, i))


def _conditions(search: Multistart, i: int) -> list[Active]:
    """Conditions by their weight in the gradient of the risk; none for the mean, where all weigh alike."""
    if search.objective.risk.share >= 1.0:
        return []
    weights = search.column(lambda g: g.weights[0])[i]
    label = search.objective.conditions.label
    # Weights sum to one: what is left out weighs less than a fiftieth.
    heavy = [int(j) for j in np.argsort(-weights)[:_MOST] if weights[j] > _LIGHT]
    return [Active(kind="tilt", name="tilt", condition=label(j), weight=float(weights[j])) for j in heavy]


def _limits(search: Multistart, i: int, at_limit: float) -> list[Active]:
    """Limits that are met, each under the condition that holds the design most."""
    conditions = search.objective.conditions
    names, n = search.objective.constraint_names(), len(conditions)
    weights = search.column(lambda g: g.weights[1])[i].reshape(len(names), n)
    excess = search.excess[i].reshape(len(names), n)
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


def _bounds(search: Multistart, i: int) -> list[Active]:
    low, high = search.objective.space.bounds
    out = []
    for value, least, most, name in zip(
        search.designs[i], low, high, ("mass", "length", "damping"), strict=False
    ):
        for kind, bound in (("lower bound", least), ("upper bound", most)):
            # A search that ends at a bound asks for another bound, not for another design.
            if abs(value - bound) < AT_BOUND * (most - least):
                out.append(Active(kind=kind, name=name, condition="", weight=float(value)))
    return out


def nearest(search: Multistart, surveys: tuple[Survey, ...] = ()) -> Nearest | None:
    """Where no design keeps the limits: the design whose largest excess is least, in the last survey if there
    is one."""
    if surveys:
        return nearest_of(surveys[-1])
    order = search.order(feasible=False)
    if not len(order) or np.isfinite(search.values[order]).any():
        return None
    excess = search.excess
    # Excesses are shares of their limits, so that limits in rad, m and kg compare.
    i = order[np.argmin(excess[order].max(axis=1))]
    broken = sorted(broken_at(search, excess[i]), key=lambda reason: -reason.value)
    return Nearest(design=search.designs[i], broken=tuple(broken))


def nearest_of(found: Survey) -> Nearest:
    """Design of least excess in a survey; its best one comes first."""
    excess = sorted(((float(x[0]), name) for name, x in found.excess.items() if x[0] > 0.0), reverse=True)
    step = Step.exact if found.equations == "linear" else Step.nonlinear
    broken = tuple(
        Reason(step=step, kind=ReasonKind.breaks_limit, limit=name, value=1.0 + x) for x, name in excess
    )
    return Nearest(design=found.designs[0], broken=broken)


def broken_at(search: Multistart, excess: np.ndarray) -> list[Reason]:
    """Limits that a design breaks, each under the condition of its largest excess."""
    conditions = search.objective.conditions
    rows = zip(search.objective.constraint_names(), excess.reshape(-1, len(conditions)), strict=True)
    return [
        Reason(
            step=Step.exact,
            kind=ReasonKind.breaks_limit,
            limit=name,
            value=1.0 + float(row.max()),
            condition=conditions.label(int(np.argmax(row))),
        )
        for name, row in rows
        if row.max() > 0.0
    ]
