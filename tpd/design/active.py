"""Conditions, limits and bounds that hold a design at its optimum."""

from __future__ import annotations

import numpy as np

from tpd.design.result import Active
from tpd.design.search import AT_BOUND, Multistart

_MOST = 6
"""Most conditions, and most limits, that are listed."""
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
    heavy = [int(j) for j in np.argsort(-weights)[:_MOST] if weights[j] > _LIGHT]
    return [Active(kind="tilt", name="tilt", condition=label(j), weight=float(weights[j])) for j in heavy]


def _limits(search: Multistart, i: int, at_limit: float) -> list[Active]:
    conditions = search.objective.conditions
    weights, excess = search.column(lambda g: g.weights[1])[i], search.excess[i]
    # A limit that is met may carry no weight where another one beside it does.
    met = (weights > 1e-4) | (excess > -at_limit)
    order = [int(j) for j in np.lexsort((-excess, -weights))[:_MOST] if met[j]]
    names, n = search.objective.constraint_names(), len(conditions)
    return [
        Active(kind="limit", name=names[j // n], condition=conditions.label(j % n), weight=float(weights[j]))
        for j in order
    ]


def _bounds(search: Multistart, i: int) -> list[Active]:
    low, high = search.objective.space.bounds
    out = []
    for value, least, most, name in zip(
        search.designs[i], low, high, ("mass", "length", "damping"), strict=False
    ):
        for kind, bound in (("lower bound", least), ("upper bound", most)):
            if abs(value - bound) < AT_BOUND * (most - least):
                out.append(Active(kind=kind, name=name, condition="", weight=float(value)))
    return out
