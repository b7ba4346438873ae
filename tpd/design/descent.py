"""Descent by optax on a smoothed risk measure: Adam, L-BFGS or any other gradient transformation.

`minimise` solves the same problem by sequential programming. Here the capped weighted worst of n functions is
smoothed as the subproblem there smooths it,

    min over s of  s + cap width sum softplus((v - s)/width),

whose derivatives with respect to v are weights that sum to one; limits enter as a smoothed exact penalty. The
width falls from step to step, because the worst case has kinks that a fixed width would round off. Projected
methods stay within the bounds by clipping. L-BFGS runs in an angle whose squared sine is the share of the
bounds, and shortens a step until the merit falls; every trial counts as a step. The ends are measured by the
linear models of `minimise`, so that both kinds of search report the same quantities."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float

from tpd.design.sequential import Ends, merit_of, minimise
from tpd.design.subproblem import PENALTY, Linearisation

_WIDTHS = (1e-1, 1e-4)
"""First and last width of the smoothing, in units of the merit."""
_SHARPER = 0.1
"""The width of the penalty over that of the measure: there may be hundreds of limits with room to spare."""
_LEVELS = 4
"""Widths that L-BFGS goes through."""
_LONGEST = 0.15
"""Step of L-BFGS, in shares of the bounds."""
_STEEP = 1e-2
"""First-order gain at which a descent counts as not ended: merit per whole width of the bounds."""


def descend(
    optimiser: str | optax.GradientTransformation,
    evaluate: Callable[[np.ndarray], Linearisation],
    starts: np.ndarray,
    cap: float,
    risk: Callable[[np.ndarray], np.ndarray],
    *,
    known: Linearisation | None = None,
    steps: int = 40,
    after: Callable[[int, int], None] | None = None,
) -> Ends:
    """Descend from all starts (m, d) by an optimiser of optax; every step evaluates every start once.

    Args: optimiser: "adam" with a decaying step, "lbfgs" with a line search, or any transformation of optax,
        whose
            steps are in shares of the bounds.
        evaluate, starts, cap, risk, known: as for `minimise`.
        steps: number of steps.
        after: called with (steps done, of how many).
    """
    book = _Book(evaluate, risk, np.clip(starts, 0.0, 1.0), known)
    walk = _lbfgs(book, cap, steps) if optimiser == "lbfgs" else _projected(book, cap, steps, optimiser)
    for step in range(steps):
        next(walk)
        if after is not None:
            after(step + 1, steps)
    # No step is taken here: this measures stationarity and weights as the other method does.
    ended = minimise(evaluate, book.x, cap, risk, known=book.local, steps=0)
    path, merits, spent = (np.stack(part) for part in zip(*book.path, strict=True))
    return ended._replace(
        steps=np.full(len(starts), steps),
        open=ended.stationarity > _STEEP,
        path=path,
        path_merit=merits,
        path_spent=spent,
    )


class _Book:
    """Best design of every start so far, its linearisation, and the path."""

    def __init__(
        self,
        evaluate: Callable[[np.ndarray], Linearisation],
        risk: Callable[[np.ndarray], np.ndarray],
        starts: np.ndarray,
        known: Linearisation | None,
    ) -> None:
        self.evaluate, self.risk = evaluate, risk
        self.evaluations = len(starts) if known is None else 0
        self.x = starts.copy()
        self.local = evaluate(starts) if known is None else Linearisation(*(np.array(part) for part in known))
        self.merit = merit_of(self.local, risk)
        self.path = [(self.x.copy(), self.merit.copy(), self.evaluations)]

    def tried(self, x: np.ndarray) -> Linearisation:
        """Linearisation at one design of each start; the best designs are recorded."""
        at = self.evaluate(x)
        self.evaluations += len(x)
        merit = merit_of(at, self.risk)
        better = merit < self.merit
        self.x[better], self.merit[better] = x[better], merit[better]
        for old, fresh in zip(self.local, at, strict=True):
            old[better] = fresh[better]
        self.path.append((self.x.copy(), self.merit.copy(), self.evaluations))
        return at


def _projected(
    book: _Book, cap: float, steps: int, optimiser: str | optax.GradientTransformation
) -> Iterator[None]:
    """Steps of any optimiser, projected onto the bounds, every start with a state of its own. A start whose
    value is infinite goes half way back to its best design."""
    # A wide kink first, which shows the way; a sharp one last, which shows the value.
    widths = np.geomspace(*_WIDTHS, max(steps, 2))
    schedule = optax.cosine_decay_schedule(0.06, max(steps, 1), alpha=0.02)
    chosen = optax.adam(schedule, b1=0.8, b2=0.95) if isinstance(optimiser, str) else optimiser
    u, at = book.x.copy(), book.local

    @jax.jit
    @jax.vmap
    def onward(slope: Array, state: Any, u: Array) -> tuple[Array, Any]:
        updates, state = chosen.update(slope, state, u)
        return jnp.clip(jnp.asarray(optax.apply_updates(u, updates)), 0.0, 1.0), state

    state = jax.jit(jax.vmap(chosen.init))(u)
    for width in widths:
        value, slope = smoothed_merit(at, cap, float(width))
        moved, state = onward(slope, state, u)
        u = np.where(np.isfinite(value)[:, None], np.asarray(moved), 0.5 * (u + book.x))
        at = book.tried(u)
        yield


def _lbfgs(book: _Book, cap: float, steps: int) -> Iterator[None]:
    """L-BFGS of optax, every start with a memory of its own, from level to level of the smoothing."""
    begin, update = _memory()
    per_level = -(-steps // _LEVELS)
    for width in np.geomspace(*_WIDTHS, _LEVELS):
        # From the best so far, off the bounds, where the angle would have no slope.
        z = _angle(np.clip(book.x, 1e-4, 1.0 - 1e-4))
        value, slope = smoothed_merit(book.tried(np.sin(z) ** 2), cap, float(width))
        yield
        slope, state, size = slope * _turn(z), begin(z), np.ones(len(z))
        move, after = _direction(update, slope, state, z)
        for _ in range(per_level - 1):
            there = z + size[:, None] * move
            at = book.tried(np.sin(there) ** 2)
            new, new_slope = smoothed_merit(at, cap, float(width))
            new_slope = new_slope * _turn(there)
            fits = new <= value + 1e-4 * size * np.sum(slope * move, axis=1)
            rows, bent = fits[:, None], np.sum((new_slope - slope) * (there - z), axis=1) > 0.0
            z, value, slope = (
                np.where(rows, there, z),
                np.where(fits, new, value),
                np.where(rows, new_slope, slope),
            )
            state = _chosen(fits, after, state)
            # A pair along which the slope falls would make a memory that points uphill.
            state = _chosen(fits & ~bent, begin(z), state)
            onward, later = _direction(update, slope, state, z)
            move = np.where(rows, onward, move)
            after = _chosen(fits, later, after)
            size = np.where(fits, 1.0, 0.4 * size)
            yield


def _angle(u: np.ndarray) -> np.ndarray:
    return np.arcsin(np.sqrt(u))


def _turn(z: np.ndarray) -> np.ndarray:
    """d sin(z)^2 / dz."""
    return np.sin(2.0 * z)


@lru_cache
def _memory() -> tuple[Callable, Callable]:
    """`init` and `update` of optax's L-BFGS, for a batch of starts, each with a memory of its own."""
    method = optax.lbfgs(learning_rate=1.0, memory_size=6, linesearch=None)
    return jax.jit(jax.vmap(method.init)), jax.jit(jax.vmap(method.update))


def _chosen(rows: np.ndarray, one: Any, other: Any) -> Any:
    """Row by row the one state or the other."""

    def choose(a: Array | np.ndarray, b: Array | np.ndarray) -> np.ndarray:
        return np.where(rows.reshape(-1, *(1,) * (a.ndim - 1)), a, b)

    return jax.tree.map(choose, one, other)


def _direction(update: Callable, slope: np.ndarray, state: Any, z: np.ndarray) -> tuple[np.ndarray, Any]:
    """Where L-BFGS would go, no farther than `_LONGEST`, and its memory after it; downhill in any case."""
    move, after = update(slope, state, z)
    move = np.asarray(move)
    uphill = np.sum(move * slope, axis=1, keepdims=True) > 0.0
    move = np.where(uphill | ~np.isfinite(move), -slope, move)
    longest = np.max(np.abs(move), axis=1, keepdims=True)
    return move * np.minimum(1.0, _LONGEST / np.maximum(longest, 1e-300)), after


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
