"""Screening: designs solved before the searches, and the choice of those from which a search begins.

Half of the designs are spread over the space. The other half is moved by closed forms to where a resting
block stays at rest: the amplitude is flat there, so that a search would hardly find the way by itself."""

from __future__ import annotations

from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Int

from tpd.design.criteria import DesignSpace, stroke_limit
from tpd.design.objective import Orbits, margins
from tpd.scene.conditions import latin_hypercube
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.quantities import with_design
from tpd.theory import uplift

_CLOSED = 4096
"""Designs screened by the closed form of the uplift margin."""
_AIM = 0.99
"""Share of the stroke limit at which a resting bob aims."""
_APART = (0.1, 0.03, 0.0)
"""Distances, in shares of the bounds, that chosen designs keep from each other as long as there are
enough."""


def screened_designs(objective: Orbits, count: int, seed: int) -> np.ndarray:
    """Seeded designs (mu, lam, zeta), shape (count, 3): three quarters by `starting_designs`, one quarter of
    the largest uplift margin under all conditions."""
    space = objective.space
    rng = np.random.default_rng([seed, 2])
    # The margin costs next to nothing, so that thousands of designs can be asked.
    wide = space.unscaled(latin_hypercube(rng, _CLOSED, space.bounds.shape[1]))
    still = np.argsort(-margins(objective, wide).min(axis=1), kind="stable")[: count // 4]
    # Without a stroke limit a right angle stands for it: a resting bob cannot swing further.
    limit = min(stroke_limit(objective.limits), 0.5 * np.pi)
    spread = starting_designs(objective.p, space, limit, count - len(still), seed)
    return np.concatenate([spread, wide[still]])


def starting_designs(p: Parameters, space: DesignSpace, stroke: float, count: int, seed: int) -> np.ndarray:
    """`count` seeded designs (mu, lam, zeta): half spread over the space (Latin hypercube), and the same ones
    moved by the closed forms to where a resting block stays at rest, if anywhere."""
    rng = np.random.default_rng(seed)
    low, high = space.bounds
    half = (count + 1) // 2
    spread = latin_hypercube(rng, half, low.size)
    # Targets differ: with one margin for all, the designs would crowd on one curve.
    target = rng.uniform(0.0, 0.2, size=half)
    fixed = space.full(low)[low.size :]
    given: Any = low, high, fixed, np.asarray(_AIM * stroke), spread, target
    still = _moved(as_arrays(p), *given)
    return space.full(low + np.concatenate([spread, np.asarray(still)])[:count] * (high - low))


@jax.jit
def _moved(
    p: Parameters, low: Array, high: Array, fixed: Array, stroke: Array, unit: Array, target: Array
) -> Array:
    """Designs (shares of the bounds) moved until their uplift margin reaches `target` and the resting bob
    keeps to the stroke; those already there stay."""

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


def best_apart(units: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Indices of the best designs that lie apart from each other, shape (count,) or fewer."""
    chosen: list[int] = []
    order = np.argsort(values, kind="stable")
    nearest = np.full(len(units), np.inf)
    # First designs of different valleys; neighbours fill up what is left.
    for apart in _APART:
        for i in map(int, order):
            if len(chosen) < count and nearest[i] > apart and i not in chosen:
                chosen.append(i)
                nearest = np.minimum(nearest, _distances(units, i))
    return np.array(chosen, dtype=int)


def first_apart(
    units: np.ndarray, order: np.ndarray, most: int, apart: float = 0.02, fixed: int = 0
) -> list[int]:
    """The first of an ordered list of designs that are no neighbours: at least `apart` from each other, in
    shares of the bounds. The first `fixed` are taken in any case."""
    taken = [int(i) for i in order[:fixed]]
    nearest = np.min([np.full(len(units), np.inf), *(_distances(units, i) for i in taken)], axis=0)
    for i in map(int, order[fixed:]):
        if len(taken) < most and nearest[i] > apart:
            taken.append(i)
            nearest = np.minimum(nearest, _distances(units, i))
    return taken


def _distances(units: np.ndarray, i: int) -> np.ndarray:
    """Distances of all designs from design i."""
    return np.linalg.norm(units - units[i], axis=1)
