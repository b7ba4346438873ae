"""Searching a design space: closed forms first, an exact screening, then optax on the gradients.

Amplitude is flat where the block rests, so resting designs are compared by their uplift margin,
which has a slope. A start that falls into a bad region (overturning, no settled motion) goes half
way back to the best design it has seen.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Int

from tpd.analysis.steady_state import Steady, steady_state
from tpd.closed_form.no_uplift import uplift
from tpd.core.parameters import Number, Parameters
from tpd.core.progress import Progress
from tpd.core.sampling import latin_hypercube
from tpd.core.status import Status, is_settled, status_name
from tpd.design.result import DesignSpace, StartStatus
from tpd.models.base import AbstractModel

STROKE_PENALTY = 5.0
"""Weight of the relative excess of the stroke; amplitudes over nu are of order one."""
AIM = 0.99
"""The search aims at this share of the stroke limit, so that its answer keeps within it."""


class Evaluation(NamedTuple):
    """A batch of designs under one model; leading axis the batch, slopes along (d,)."""

    merit: Float[Array, "n"]
    """-margin where the block rests, amplitude/nu where it rocks: lower is better, every resting
    design is better than any rocking one, and both have slopes. Infinite where not `usable`."""
    slope: Float[Array, "n d"]
    """Of the merit; where a design is not usable, of -margin."""
    amplitude: Float[Array, "n"]
    stroke: Float[Array, "n"]
    stroke_slope: Float[Array, "n d"]
    margin: Float[Array, "n"]
    status: Status
    usable: Bool[Array, "n"]
    """Whether the motion settled and has derivatives."""


def with_design(p: Parameters, design: Float[Array, "3"]) -> Parameters:
    """The parameters with another (mu, lam, zeta)."""
    return eqx.tree_at(lambda q: (q.mu, q.lam, q.zeta), p, (design[0], design[1], design[2]))


def evaluator(
    p: Parameters, model: AbstractModel, searched: int
) -> Callable[[Float[Array, "n 3"]], Evaluation]:
    """A compiled function from designs (mu, lam, zeta) to their `Evaluation`, with slopes in the
    first `searched` of (mu, lam, zeta)."""

    def one(design: Float[Array, "3"]) -> Evaluation:
        def sizes(x: Float[Array, "d"]) -> tuple[Array, tuple[Steady, Number]]:
            q = with_design(p, jnp.concatenate([x, design[searched:]]))
            steady, lift = steady_state(q, model=model), uplift(q)
            merit = jnp.where(steady.status == Status.rest, -lift.margin, steady.amplitude / p.nu)
            return jnp.stack([merit, steady.stroke, -lift.margin]), (steady, lift.margin)

        x = design[:searched]
        # Forward mode keeps a missing slope of one output out of the others.
        slopes, (steady, margin) = jax.jacfwd(sizes, has_aux=True)(x)
        settled = is_settled(steady.status)
        usable = settled & jnp.all(jnp.isfinite(slopes))
        value = jnp.where(steady.status == Status.rest, -margin, steady.amplitude / p.nu)
        return Evaluation(
            jnp.where(usable, value, jnp.inf),
            jnp.where(usable, slopes[0], slopes[2]),
            steady.amplitude,
            steady.stroke,
            jnp.where(usable, slopes[1], 0.0),
            margin,
            steady.status,
            usable,
        )

    return eqx.filter_jit(jax.vmap(one))


def starting_points(p: Parameters, space: DesignSpace, count: int, seed: int) -> np.ndarray:
    """`count` designs (mu, lam, zeta), seeded: half spread over the space (Latin hypercube), half
    of the same moved by the closed forms to where a resting block stays at rest, if anywhere."""
    rng = np.random.default_rng(seed)
    low, high = space.bounds
    half = (count + 1) // 2
    spread = latin_hypercube(rng, half, low.size)
    target = rng.uniform(0.0, 0.2, size=half)
    still = np.asarray(_toward_rest(p, space, jnp.asarray(spread), jnp.asarray(target)))
    return space.full(low + np.concatenate([spread, still])[:count] * (high - low))


def _toward_rest(p: Parameters, space: DesignSpace, unit: Array, target: Array) -> Array:
    """Designs (as shares of the bounds) moved until their uplift margin reaches `target` and the
    resting bob keeps to the stroke limit; those already there stay."""
    low, high = (jnp.asarray(b) for b in space.bounds)
    fixed = jnp.asarray(space.full(space.bounds[0]))[low.size :]
    return _moved(p, low, high, fixed, jnp.asarray(AIM * space.stroke), unit, target)


@eqx.filter_jit
def _moved(
    p: Parameters, low: Array, high: Array, fixed: Array, stroke: Array, unit: Array, target: Array
) -> Array:
    def shortfall(u: Array, goal: Array) -> Array:
        x = low + u * (high - low)
        lift = uplift(with_design(p, jnp.concatenate([x, fixed])))
        return jax.nn.relu(goal - lift.margin) + jax.nn.relu(lift.stroke / stroke - 1.0)

    adam = optax.adam(0.03)

    def step(_: Int[Array, ""], carry: tuple) -> tuple:
        u, state = carry
        slope = jax.vmap(jax.grad(shortfall))(u, target)
        updates, state = adam.update(slope, state)
        moved = jnp.any(slope != 0.0, axis=1, keepdims=True)
        onward = cast(Array, optax.apply_updates(u, updates))
        return jnp.where(moved, jnp.clip(onward, 0.0, 1.0), u), state

    return jax.lax.fori_loop(0, 100, step, (unit, adam.init(unit)))[0]


class Trace(NamedTuple):
    """What a search went through, arrays of shape (starts, steps, ...); see `Evaluation`."""

    designs: np.ndarray
    merit: np.ndarray
    amplitude: np.ndarray
    stroke: np.ndarray
    margin: np.ndarray
    status: np.ndarray
    slope: np.ndarray
    stroke_slope: np.ndarray
    usable: np.ndarray

    def then(self, later: Trace) -> Trace:
        """This trace with a later one appended."""
        if later.merit.shape[1] == 0:
            return self
        return Trace(*(np.concatenate(pair, axis=1) for pair in zip(self, later, strict=True)))

    def best(self, limit: float) -> np.ndarray:
        """For each start the step of its best design within the stroke limit, or -1."""
        merit = np.where(self.usable & (self.stroke <= limit), self.merit, np.inf)
        if merit.shape[1] == 0:
            return np.full(len(merit), -1)
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
    adam = optax.adam(optax.cosine_decay_schedule(0.06, max(steps, 1), alpha=0.05), b1=0.8, b2=0.95)
    u = (jnp.asarray(starts)[:, :searched] - low[None]) / (high - low)[None]
    state = adam.init(u)
    best_u, best_merit = u, jnp.full(u.shape[0], jnp.inf)
    records: list[tuple[Array, Evaluation]] = []
    stale, interrupted = 0, False
    try:
        for step in range(steps):
            designs = jnp.asarray(space.full(np.asarray(low[None] + u * (high - low)[None])))
            e = evaluate(designs)
            records.append((designs, e))
            excess = jax.nn.relu(e.stroke / space.stroke - 1.0)
            merit = e.merit + jnp.where(e.usable, STROKE_PENALTY * excess, 0.0)
            stale = 0 if bool(jnp.any(merit < best_merit - 1e-4)) else stale + 1
            best_u = jnp.where((merit < best_merit)[:, None], u, best_u)
            best_merit = jnp.minimum(merit, best_merit)
            beyond = (e.usable & (e.stroke > AIM * space.stroke))[:, None]
            slope = e.slope + jnp.where(beyond, STROKE_PENALTY / space.stroke * e.stroke_slope, 0.0)
            updates, state = adam.update(slope * (high - low)[None], state)
            onward = cast(Array, optax.apply_updates(u, updates))
            retreat = (~e.usable & jnp.isfinite(best_merit))[:, None]
            u = jnp.clip(jnp.where(retreat, 0.5 * (u + best_u), onward), 0.0, 1.0)
            if progress is not None:
                progress("searching", step + 1, steps)
            if stale >= 12:
                break
    except KeyboardInterrupt:
        interrupted = True
    return trace(records, len(starts)), interrupted


def trace(records: list[tuple[Array, Evaluation]], n: int) -> Trace:
    """The trace of `n` starts, from the designs and evaluations of every step."""
    if not records:
        empty, none = np.zeros((n, 0)), np.zeros((n, 0, 3))
        return Trace(none, empty, empty, empty, empty, empty.astype(str), none, none, empty.astype(bool))

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
        column(lambda e: e.stroke_slope),
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
    low, high = space.bounds
    u = (trace.designs[i, best, : low.size] - low) / (high - low)
    slope = trace.slope[i, best] * (high - low)
    inside = (u > 1e-6) & (u < 1.0 - 1e-6) | (np.where(u > 0.5, slope, -slope) > 0)
    if trace.stroke[i, best] > 0.98 * space.stroke:
        return StartStatus.stroke_limited
    if np.linalg.norm(slope[inside]) < 0.02:
        return StartStatus.converged if inside.all() else StartStatus.at_bound
    return StartStatus.steps_exhausted
