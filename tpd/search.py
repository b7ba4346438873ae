"""Searching a design space: closed forms first, an exact screening, then optax on the gradients.

Amplitude is flat where the block rests, so resting designs are compared by their uplift margin,
which has a slope. A start that falls into a bad region (overturning, no settled motion) goes half
way back to the best design it has seen.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, Int

from tpd.balance import uplift
from tpd.design import DesignSpace, StartStatus
from tpd.models.interface import AbstractModel
from tpd.parameters import Parameters
from tpd.status import Status, status_name
from tpd.steady import steady_state

STROKE_PENALTY = 5.0
"""Weight of the relative excess of the stroke; amplitudes over nu are of order one."""
AIM = 0.99
"""The search aims at this share of the stroke limit, so that its answer keeps within it."""


class Progress(Protocol):
    """Called after every unit of work: what is being done, how much is done, of how much."""

    def __call__(self, stage: str, done: int, total: int) -> None: ...


class Evaluation(NamedTuple):
    """A batch of designs under one model, with the slopes of the merit; leading axis the batch."""

    merit: Float[Array, "n"]
    slope: Float[Array, "n d"]
    amplitude: Float[Array, "n"]
    stroke: Float[Array, "n"]
    margin: Float[Array, "n"]
    status: Status
    usable: Array


def with_design(p: Parameters, design: Float[Array, "3"]) -> Parameters:
    """The parameters with another (mu, lam, zeta)."""
    return eqx.tree_at(lambda q: (q.mu, q.lam, q.zeta), p, (design[0], design[1], design[2]))


def evaluator(
    p: Parameters, model: AbstractModel, limit: float, searched: int
) -> Callable[[Float[Array, "n 3"]], Evaluation]:
    """A compiled function from designs (mu, lam, zeta) to their `Evaluation`.

    The merit is -margin where the block rests and amplitude/nu where it rocks: every resting
    design is better than any rocking one, and both have slopes. Slopes are in the first
    `searched` of (mu, lam, zeta).
    """

    def one(design: Float[Array, "3"]) -> Evaluation:
        def merit(x: Float[Array, "d"]) -> tuple[Array, tuple]:
            q = with_design(p, jnp.concatenate([x, design[searched:]]))
            steady, lift = steady_state(q, model=model), uplift(q)
            value = jnp.where(steady.status == Status.rest, -lift.margin, steady.amplitude / p.nu)
            excess = jax.nn.relu(steady.stroke / (AIM * limit) - 1.0)
            return value + STROKE_PENALTY * excess, (steady, lift.margin)

        x = design[:searched]
        (value, (steady, margin)), slope = jax.value_and_grad(merit, has_aux=True)(x)
        settled = (steady.status == Status.rocking) | (steady.status == Status.rest)
        usable = settled & jnp.all(jnp.isfinite(slope)) & jnp.isfinite(value)
        back = jax.grad(lambda x: -uplift(with_design(p, jnp.concatenate([x, design[searched:]]))).margin)(x)
        slope = jnp.where(usable, slope, back)
        value = jnp.where(usable, value, jnp.inf)
        return Evaluation(value, slope, steady.amplitude, steady.stroke, margin, steady.status, usable)

    return eqx.filter_jit(jax.vmap(one))


def starting_points(p: Parameters, space: DesignSpace, count: int, seed: int) -> np.ndarray:
    """`count` designs (mu, lam, zeta), seeded: half spread over the space (Latin hypercube), half
    of the same moved by the closed forms to where the settled block cannot lift, if anywhere."""
    rng = np.random.default_rng(seed)
    low, high = space.bounds
    half = (count + 1) // 2
    strata = np.stack([rng.permutation(half) for _ in low], axis=1)
    spread = (strata + rng.random(strata.shape)) / half
    target = rng.uniform(0.0, 0.2, size=half)
    still = np.asarray(_toward_rest(p, space, jnp.asarray(spread), jnp.asarray(target)))
    return space.full(low + np.concatenate([spread, still])[:count] * (high - low))


def _toward_rest(p: Parameters, space: DesignSpace, unit: Array, target: Array) -> Array:
    """Designs (as shares of the bounds) moved until their uplift margin reaches `target` and the
    resting bob keeps to the stroke limit; those already there stay."""
    low, high = (jnp.asarray(b) for b in space.bounds)
    fixed = jnp.asarray(space.full(space.bounds[0]))

    def shortfall(u: Array, goal: Array) -> Array:
        x = low + u * (high - low)
        lift = uplift(with_design(p, jnp.concatenate([x, fixed[x.size :]])))
        return jax.nn.relu(goal - lift.margin) + jax.nn.relu(lift.stroke / (AIM * space.stroke) - 1.0)

    adam = optax.adam(0.03)

    def step(_: Int[Array, ""], carry: tuple) -> tuple:
        u, state = carry
        slope = jax.vmap(jax.grad(shortfall))(u, target)
        updates, state = adam.update(slope, state)
        moved = jnp.any(slope != 0.0, axis=1, keepdims=True)
        return jnp.where(moved, jnp.clip(u + updates, 0.0, 1.0), u), state

    return jax.jit(lambda u: jax.lax.fori_loop(0, 100, step, (u, adam.init(u)))[0])(unit)


class Trace(NamedTuple):
    """What a search went through, arrays of shape (starts, steps, ...)."""

    designs: np.ndarray
    merit: np.ndarray
    amplitude: np.ndarray
    stroke: np.ndarray
    margin: np.ndarray
    status: np.ndarray
    slope: np.ndarray
    usable: np.ndarray

    def best(self, limit: float) -> np.ndarray:
        """For each start the step of its best design within the stroke limit, or -1."""
        merit = np.where(self.usable & (self.stroke <= limit), self.merit, np.inf)
        return np.where(np.isfinite(merit).any(axis=1), merit.argmin(axis=1), -1)


def descend(
    evaluate: Callable[[Float[Array, "n 3"]], Evaluation],
    space: DesignSpace,
    starts: np.ndarray,
    *,
    steps: int,
    progress: Progress | None = None,
) -> tuple[Trace, bool]:
    """Projected Adam from all `starts` (n, 3) at once, at most `steps` steps; stops early when
    none has improved for a while. Returns the trace and whether Ctrl-C cut it short."""
    low, high = (jnp.asarray(b) for b in space.bounds)
    searched = low.size
    adam = optax.adam(optax.cosine_decay_schedule(0.06, steps, alpha=0.05), b1=0.8, b2=0.95)
    u = (jnp.asarray(starts)[:, :searched] - low[None]) / (high - low)[None]
    state = adam.init(u)
    best_u, best_merit = u, jnp.full(u.shape[0], jnp.inf)
    records, stale, interrupted = [], 0, False
    try:
        for step in range(steps):
            designs = jnp.asarray(space.full(np.asarray(low[None] + u * (high - low)[None])))
            e = evaluate(designs)
            records.append((designs, e))
            better = e.merit < best_merit - 1e-4
            stale = 0 if bool(jnp.any(better)) else stale + 1
            best_u = jnp.where((e.merit < best_merit)[:, None], u, best_u)
            best_merit = jnp.minimum(e.merit, best_merit)
            updates, state = adam.update(e.slope * (high - low)[None], state)
            retreat = (~e.usable & jnp.isfinite(best_merit))[:, None]
            u = jnp.clip(jnp.where(retreat, 0.5 * (u + best_u), u + updates), 0.0, 1.0)
            if progress is not None:
                progress("searching", step + 1, steps)
            if stale >= 12:
                break
    except KeyboardInterrupt:
        interrupted = True
    return _trace(records, starts), interrupted


def _trace(records: list[tuple[Array, Evaluation]], starts: np.ndarray) -> Trace:
    n = len(starts)
    if not records:
        empty = np.zeros((n, 0))
        none = np.zeros((n, 0, 3))
        return Trace(none, empty, empty, empty, empty, empty.astype(str), none, empty.astype(bool))

    def column(get: Callable[[Evaluation], Array]) -> np.ndarray:
        return np.stack([np.asarray(get(e)) for _, e in records], axis=1)

    names = np.array([[status_name(_item(e.status, i)) for _, e in records] for i in range(n)])
    return Trace(
        np.stack([np.asarray(d) for d, _ in records], axis=1),
        column(lambda e: e.merit),
        column(lambda e: e.amplitude),
        column(lambda e: e.stroke),
        column(lambda e: e.margin),
        names,
        column(lambda e: e.slope),
        column(lambda e: e.usable),
    )


def _item(status: Status, i: int) -> Status:
    return jax.tree.map(lambda x: x[i], status)


def start_status(trace: Trace, space: DesignSpace, i: int, best: int) -> StartStatus:
    """How the search from start `i` ended, judged at its best step."""
    if best < 0:
        return StartStatus.infeasible if trace.usable[i].any() else StartStatus.lost
    if trace.status[i, best] == "rest":
        return StartStatus.rests
    if trace.stroke[i, best] > 0.95 * AIM * space.stroke:
        return StartStatus.stroke_limited
    low, high = space.bounds
    u = (trace.designs[i, best, : low.size] - low) / (high - low)
    slope = trace.slope[i, best] * (high - low)
    projected = u - np.clip(u - slope, 0.0, 1.0)
    if np.linalg.norm(projected) < 0.02:
        bound = (u <= 0.0) | (u >= 1.0)
        return StartStatus.at_bound if bound.any() else StartStatus.converged
    return StartStatus.steps_exhausted
