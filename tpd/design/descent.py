"""Descent by optax on a smoothed risk measure, by any gradient transformation.

`tpd.design.sequential` solves the same problem by sequential programming. Here the capped weighted worst of n
functions is smoothed,

    min over s of  s + cap width sum softplus((v - s)/width),

whose derivatives with respect to v are weights that sum to one; limits enter as a smoothed exact penalty. The
width falls from step to step, because the worst case has kinks that a fixed width would round off. Steps are
clipped to the bounds."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float

from tpd.design.ends import PENALTY, Book, Ends, Evaluate, Linearisation, Measure

OPTIMISERS: dict[str, Callable[[Any], optax.GradientTransformation]] = {
    "adam": partial(optax.adam, b1=0.8, b2=0.95),
    "rmsprop": partial(optax.rmsprop, decay=0.95),
}
"""Optimisers of optax that have a name, functions of a schedule of steps."""
_WIDTHS = (1e-1, 1e-4)
"""First and last width of the smoothing, in units of the merit."""
_SHARPER = 0.1
"""The width of the penalty over that of the measure: there may be hundreds of limits with room to spare."""


def descend(
    optimiser: optax.GradientTransformation,
    evaluate: Evaluate,
    starts: np.ndarray,
    cap: float,
    risk: Measure,
    *,
    known: Linearisation | None = None,
    steps: int = 40,
    after: Callable[[int, int], None] | None = None,
) -> Ends:
    """Descend from all starts (m, d) by an optimiser of optax; every step evaluates every start once.

    Args:
        optimiser: its steps are in shares of the bounds.
        evaluate, starts, cap, risk, known: as for `minimise`.
        steps: number of steps.
        after: called with (steps done, of how many).
    """
    book = Book(evaluate, risk, np.clip(starts, 0.0, 1.0), known)

    @jax.jit
    @jax.vmap
    def onward(slope: Array, state: Any, u: Array) -> tuple[Array, Any]:
        updates, state = optimiser.update(slope, state, u)
        return jnp.clip(jnp.asarray(optax.apply_updates(u, updates)), 0.0, 1.0), state

    u, at, state = book.x.copy(), book.local, jax.jit(jax.vmap(optimiser.init))(book.x)
    # A wide kink first, which shows the way; a sharp one last, which shows the value.
    for step, width in enumerate(np.geomspace(*_WIDTHS, max(steps, 2))[:steps]):
        value, slope = smoothed_merit(at, cap, float(width))
        moved, state = onward(slope, state, u)
        # A start whose value is infinite goes half way back to its best design.
        u = np.where(np.isfinite(value)[:, None], np.asarray(moved), 0.5 * (u + book.x))
        at = book.tried(u)
        if after is not None:
            after(step + 1, steps)
    return book.ends(cap)


def named(name: str, steps: int) -> optax.GradientTransformation:
    """The optimiser of a name in `OPTIMISERS`, with a step that falls from 6 % of the bounds to a fiftieth of
    that."""
    schedule = optax.cosine_decay_schedule(0.06, max(steps, 1), alpha=0.02)
    return OPTIMISERS[name](schedule)


def smoothed_merit(at: Linearisation, cap: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    """The smoothed merit (m,) and its slopes (m, d); of a design with an infinite value not finite."""
    known = np.all(np.isfinite(at.value), axis=1)
    at = at._replace(value=np.where(known[:, None], at.value, 0.0))
    level = _level(at.value, cap, width)
    above = (at.value - level[:, None]) / width
    value = level + cap * width * np.sum(np.logaddexp(0.0, above), axis=1)
    over = at.limit / (_SHARPER * width)
    value = value + PENALTY * _SHARPER * width * np.sum(np.logaddexp(0.0, over), axis=1)
    slope = cap * np.einsum("mn,mnd->md", _sigmoid(above), at.slope)
    slope = slope + PENALTY * np.einsum("ml,mld->md", _sigmoid(over), at.limit_slope)
    return np.where(known, value, np.inf), np.where(known[:, None], slope, 0.0)


def _level(value: np.ndarray, cap: float, width: float) -> Float[np.ndarray, "m"]:
    """The s of the smoothed measure: where the weights sum to one, by bisection."""
    n = value.shape[1]
    low = value.min(axis=1) - 40.0 * width
    high = value.max(axis=1) + width * np.log(n + 1.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        over = cap * np.sum(_sigmoid((value - middle[:, None]) / width), axis=1) < 1.0
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    return 0.5 * (low + high)


def _sigmoid(x: np.ndarray) -> np.ndarray:
    return 0.5 * (1.0 + np.tanh(0.5 * x))
