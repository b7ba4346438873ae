"""The least rocking for every mass: a front of designs, found in one sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpd.core import checks
from tpd.core.conditions import Conditions, Limits, Measure
from tpd.core.progress import Progress
from tpd.core.scene import Scene
from tpd.design.objective import Objective
from tpd.design.result import DesignSpace
from tpd.design.search import Search, stage
from tpd.design.sequential import minimise

_FEASIBLE = 1e-5
"""Largest relative excess of a limit that is rounding."""


@dataclass(frozen=True, kw_only=True)
class Front:
    """Designs of which none is lighter and rocks less than another; arrays of shape (points,)."""

    mass_ratio: np.ndarray
    """Largest mass ratio allowed."""
    value: np.ndarray
    """The measure, see `Told.merit`; infinite where no design keeps to the limits."""
    design: np.ndarray
    """(mu, lam, zeta), (points, 3)."""
    evaluations: int


def pareto(
    scene: Scene,
    conditions: Conditions,
    space: DesignSpace | None = None,
    *,
    measure: Measure | None = None,
    limits: Limits | None = None,
    points: int = 12,
    starts: int = 8,
    screening: int = 512,
    steps: int = 30,
    seed: int = 0,
    progress: Progress | None = None,
) -> Front:
    """The front of mass against rocking: for each of `points` bounds on the mass ratio, in equal ratios over
    the space, the best of `starts` searches. Designs are not judged; see `optimise_over` for that.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    checks.count("points", points, least=2)
    space = DesignSpace() if space is None else space
    measure = Measure.worst() if measure is None else measure
    limits = Limits() if limits is None else limits
    objective = Objective.of(scene, conditions, space, measure, limits, False)
    search = Search(objective, starts, screening, steps, seed, progress)
    search.screen()
    low, high = space.bounds
    bounds = np.geomspace(
        max(space.mass_ratio[0], 1e-3 * space.mass_ratio[1]), space.mass_ratio[1], points + 1
    )[1:]
    unit = (search.screened[:, : low.size] - low) / (high - low)
    order = np.argsort(search.screened_value, kind="stable")
    lanes, tops = [], []
    for most in bounds:
        light = [i for i in order if search.screened[i, 0] <= most][: starts - 1]
        # The best of all, brought down to the bound, follows the heavier designs' basin.
        lanes += [unit[i] for i in light] + [unit[order[0]]] * (starts - len(light))
        tops += [(most - low[0]) / (high[0] - low[0])] * starts
    ceiling = np.ones((len(lanes), low.size))
    ceiling[:, 0] = tops
    found = minimise(
        objective.local,
        np.array(lanes),
        measure.cap(len(conditions)),
        measure.of,
        high=ceiling,
        steps=steps,
        after=None if progress is None else stage(progress, "front"),
    )
    value = np.where(found.local.limit.max(axis=1) <= _FEASIBLE, measure.of(found.local.value), np.inf)
    value, x = value.reshape(points, starts), found.x.reshape(points, starts, -1)
    best = np.argmin(value, axis=1)
    value, x = value[np.arange(points), best], x[np.arange(points), best]
    for i in range(1, points):
        if value[i] > value[i - 1]:
            # What is lighter and better is allowed here as well.
            value[i], x[i] = value[i - 1], x[i - 1]
    return Front(
        mass_ratio=bounds,
        value=value,
        design=space.full(low + x * (high - low)),
        evaluations=len(search.screened) + found.evaluations,
    )
