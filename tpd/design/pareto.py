"""Pareto front of the bob's mass against the rocking that is left, found in one sweep."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tpd.analysis.attractors import StartKind, Starts
from tpd.core import checks
from tpd.core.conditions import Conditions
from tpd.core.progress import Progress, shown
from tpd.core.scene import Scene
from tpd.design.criteria import Limit, Risk
from tpd.design.inputs import check_types
from tpd.design.methods import Method, Sequential
from tpd.design.objective import BACK_OFF
from tpd.design.problem import Problem
from tpd.design.search import Multistart, stage
from tpd.design.sequential import minimise
from tpd.design.space import DesignSpace


@dataclass(frozen=True, kw_only=True)
class Front:
    """Designs of which none is lighter and rocks less than another; arrays of shape (points,)."""

    mass_ratio: np.ndarray
    """Largest mass ratio allowed."""
    value: np.ndarray
    """Risk of the merits, see `Evaluation`; infinite where no design keeps the limits."""
    design: np.ndarray
    """(mu, lam, zeta), (points, 3)."""
    evaluations: int
    """Designs evaluated."""


def pareto(
    scene: Scene,
    space: DesignSpace | None = None,
    *,
    conditions: Conditions | None = None,
    starts: Starts | None = None,
    risk: Risk | None = None,
    limits: Iterable[Limit] | None = None,
    points: int = 12,
    method: Method | None = None,
    seed: int = 0,
    progress: Progress | bool | None = None,
) -> Front:
    """Least risk for every mass: for each of `points` bounds on the mass ratio, in equal ratios over the
    space, the best of several sequential searches. Designs are not verified; see `optimise` for that.

    Args:
        scene, space, conditions, starts, risk, limits, seed, progress: as for `optimise`.
        points: bounds on the mass ratio.
        method: budget, `searches` for every point; default `Sequential(searches=8, steps=30)`.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.count("points", points, least=2)
    method = Sequential(searches=8, steps=30) if method is None else method
    check_types(scene, space, conditions, starts, risk, method)
    if starts is not None and starts.kind is StartKind.sampled and method.on_orbits:
        raise ValueError(
            "`starts` of a front must be Starts.rest() or Starts.any() where every orbit is known, but is a "
            "sampled set: give `method` a model to follow it by"
        )
    problem = Problem.of(scene, space, conditions, starts, risk, limits, method, seed).against_bare()
    with shown(progress) as report:
        return _front(problem, points, report)


def _front(problem: Problem, points: int, progress: Progress | None) -> Front:
    method, seed = problem.method, problem.seed
    objective, space = problem.objective, problem.space
    search = Multistart(objective, problem.method, seed, progress)
    # The searches run on lanes with bounds of their own, so that only the screening is shared.
    search.screen()
    least = max(space.mass_ratio[0], 1e-3 * space.mass_ratio[1])
    # Equal ratios: the first kilogrammes buy most.
    bounds = np.geomspace(least, space.mass_ratio[1], points + 1)[1:]
    units, ceiling = _lanes(search, bounds, method.searches)
    found = minimise(
        objective.at,
        units,
        objective.risk.cap(len(objective.conditions)),
        objective.risk.of,
        high=ceiling,
        steps=method.steps,
        after=None if progress is None else stage(progress, "front"),
    )
    excess = found.local.limit.max(axis=1, initial=-1.0) - BACK_OFF
    value = np.where(excess <= 0.0, objective.risk.of(found.local.value), np.inf)
    value, x = _monotone(value.reshape(points, -1), found.x.reshape(points, -1, found.x.shape[1]))
    evaluations = len(search.screened) + found.evaluations
    return Front(mass_ratio=bounds, value=value, design=space.unscaled(x), evaluations=evaluations)


def _lanes(search: Multistart, bounds: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """`count` designs for every bound on the mass ratio, in shares of the bounds, and their upper bounds."""
    space = search.objective.space
    low, high = space.bounds
    units = space.scaled(search.screened)
    order = np.argsort(search.screened_value, kind="stable")
    lanes, tops = [], []
    for most in bounds:
        light = [i for i in order if search.screened[i, 0] <= most][: count - 1]
        # The best of all, brought down to the bound, follows the heavier designs' basin.
        lanes += [units[i] for i in light] + [units[order[0]]] * (count - len(light))
        tops += [(most - low[0]) / (high[0] - low[0])] * count
    ceiling = np.ones((len(lanes), low.size))
    ceiling[:, 0] = tops
    return np.array(lanes), ceiling


def _monotone(value: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Best search of every point (points, searches): a lighter design that is better holds for heavier
    bounds."""
    rows, best = np.arange(len(value)), np.argmin(value, axis=1)
    value, x = value[rows, best], x[rows, best]
    for i in range(1, len(value)):
        if value[i] > value[i - 1]:
            value[i], x[i] = value[i - 1], x[i - 1]
    return value, x
