"""Finishing a search: sequential linear programming on the gradients, within a trust region.

Adam comes near an optimum but rattles at an active stroke limit. Here every step minimises the
linearised merit under the linearised stroke limit, the bounds and a trust region, all of it a
linear programme with one coupling constraint, solved by sorting. A step that does not help is
taken back and the region halved.
"""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tpd.core.progress import Progress
from tpd.design.result import DesignSpace
from tpd.design.single_search import Evaluation, Trace, trace

KEEP = 1.0 - 2e-4
"""Share of the stroke limit used, the rest being the difference of the two models."""


def knapsack(
    cost: np.ndarray, low: np.ndarray, high: np.ndarray, weight: np.ndarray, capacity: float
) -> np.ndarray:
    """min cost @ d subject to low <= d <= high and weight @ d <= capacity; all of shape (d,).

    If nothing satisfies the capacity, the d of least weight.
    """
    d = np.where(cost > 0, low, high)
    rate = np.where(weight != 0, -cost / np.where(weight != 0, weight, 1.0), np.inf)
    lighter = np.where(weight > 0, low, high)
    # Turning coordinate i to its lighter end costs `rate` per unit of weight: cheapest first.
    for i in np.argsort(rate):
        excess = weight @ d - capacity
        if excess <= 0:
            break
        if weight[i] == 0 or d[i] == lighter[i]:
            continue
        gain = weight[i] * (d[i] - lighter[i])
        d[i] += min(1.0, excess / gain) * (lighter[i] - d[i])
    return d


def polish(
    evaluate: Callable[[Float[Array, "n 3"]], Evaluation],
    space: DesignSpace,
    starts: np.ndarray,
    *,
    steps: int,
    radius: float = 0.04,
    progress: Progress | None = None,
) -> tuple[Trace, bool]:
    """Improve all `starts` (n, 3) at once, at most `steps` steps, each within `radius` (a share of
    the bounds) at first. Returns the trace and whether Ctrl-C cut it short."""
    low, high = space.bounds
    width, searched, limit = high - low, low.size, KEEP * space.stroke
    here = (starts[:, :searched] - low) / width
    reach = np.full(len(starts), radius)
    records: list[tuple[Array, Evaluation]] = []
    held: Evaluation | None = None
    there = here
    try:
        for step in range(steps):
            designs = jnp.asarray(space.full(low + there * width))
            e = evaluate(designs)
            records.append((designs, e))
            if held is None:
                held = e
            else:
                better = _better(e, held, limit)
                here = np.where(better[:, None], there, here)
                held = _merge(better, e, held)
                reach = np.where(better, np.minimum(1.5 * reach, radius), 0.4 * reach)
            there = np.stack([_step(held, here, reach, i, width, limit) for i in range(len(starts))])
            if progress is not None:
                progress("finishing", step + 1, steps)
            if reach.max() < 2e-4:
                break
    except KeyboardInterrupt:
        return trace(records, len(starts)), True
    return trace(records, len(starts)), False


def _better(new: Evaluation, old: Evaluation, limit: float) -> np.ndarray:
    """Whether each new design improves on the old: first in keeping the limit, then in merit."""
    over_new, over_old = (np.maximum(np.asarray(e.stroke) - limit, 0.0) for e in (new, old))
    lower = np.asarray(new.merit) < np.asarray(old.merit)
    closer = np.where((over_new == 0) & (over_old == 0), lower, over_new < over_old)
    return np.asarray(new.usable) & (closer | ~np.asarray(old.usable))


def _merge(better: np.ndarray, new: Evaluation, old: Evaluation) -> Evaluation:
    def pick(a: Array, b: Array) -> Array:
        return jnp.where(better.reshape(-1, *[1] * (a.ndim - 1)), a, b)

    return jax.tree.map(pick, new, old)


def _step(
    e: Evaluation, here: np.ndarray, reach: np.ndarray, i: int, width: np.ndarray, limit: float
) -> np.ndarray:
    """Where start `i` goes next, in shares of the bounds."""
    low, high = np.maximum(-reach[i], -here[i]), np.minimum(reach[i], 1.0 - here[i])
    slope, weight = np.asarray(e.slope)[i] * width, np.asarray(e.stroke_slope)[i] * width
    capacity = limit - float(e.stroke[i])
    if not np.isfinite(capacity):
        weight, capacity = np.zeros_like(slope), 0.0
    return here[i] + knapsack(slope, low, high, weight, capacity)
