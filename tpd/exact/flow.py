"""The event-driven flow: arc after arc, with no event missed and no time-step error.

Within an arc every signal g is a closed form, and so is a bound b3 on |g'''| over a window d.
Hence g >= g0 + g1 t + (g2 - b3 d/3) t^2/2 for 0 <= t <= d, and the first root of that parabola
is a step that cannot pass an event. Such steps shrink quadratically onto the first root of the
first signal, however close the next one lies. Only phi' = 0 and phi = 0 end a slip arc, and a
tilt is monotone between zeros of its rate, so nothing lies hidden between two samples.

Derivatives (forward mode) pass through an event by one Newton step on its time, which leaves the
value alone and carries the saltation matrix.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Float, Int

from tpd.exact.arcs import REST, SLIP, Arc, Mode, ends, launch
from tpd.exact.spectrum import Basis, Plant
from tpd.parameters import Number, State

_TIGHT = 2e-14
"""A step below this share of the horizon has reached the event to round-off."""
_REACHED = 1e-15
"""What is left of the horizon below this share of it is rounding."""


class Motion(eqx.Module):
    """A running motion: the arc it is on, where on it, and what it has met so far."""

    mode: Mode
    arc: Arc
    begun: Number
    """Time at which the arc began, counted from the start of the period."""
    local: Number
    """Time on the arc."""
    bob_sign: Number
    amplitude: Number
    """Largest |phi| met at a turning point."""
    stroke: Number
    """Largest |psi| met at a turning point of the bob."""
    steps: Int[Array, ""]
    lost: Bool[Array, ""]
    """Whether the tilt has grown beyond return."""


def start(plant: Plant, mode: Mode, y: State, phase: Number) -> Motion:
    """A motion at the beginning of a period, or anywhere else, from a state and its mode."""
    y = jnp.asarray(y)
    arc = launch(plant, mode, y, phase)
    zero = jnp.zeros_like(y[0])
    # From rest the bob's first and second derivatives vanish: look a little ahead instead.
    ahead = arc.rows[6] @ arc.basis(1e-3 / plant.linear.xi)
    bob_rate = jnp.where(jnp.abs(y[3]) > 1e-12, y[3], ahead)
    bob_sign = jnp.where(bob_rate < 0.0, -1.0, 1.0)
    return Motion(
        mode,
        arc,
        zero,
        zero,
        stop_gradient(bob_sign),
        jnp.abs(y[0]),
        jnp.abs(y[1]),
        jnp.zeros((), jnp.int32),
        jnp.zeros((), bool),
    )


def advance(
    plant: Plant,
    motion: Motion,
    horizon: Number,
    *,
    quiet: Number,
    max_steps: int | Int[Array, ""],
    watch_bob: bool = False,
) -> tuple[Motion, State]:
    """Run a motion up to `horizon` (same clock as `begun`): the motion there, and its state.

    The work is bounded by `max_steps` steps and events; `steps` of the result tells.
    """
    limit = stop_gradient(plant.linear.beyond_return)
    fixed_horizon = stop_gradient(horizon)

    def unfinished(m: Motion) -> Bool[Array, ""]:
        # t + (horizon - t) may round below the horizon: a difference of rounding is no distance.
        left = fixed_horizon - stop_gradient(m.begun) - m.local
        return (left > _REACHED * fixed_horizon) & (m.steps < max_steps) & ~m.lost

    def step(m: Motion) -> Motion:
        basis = m.arc.basis(m.local)
        left = fixed_horizon - stop_gradient(m.begun) - m.local
        safe = _safe_steps(m, stop_gradient(basis), left, watch_bob)
        fresh = m.local == 0.0
        shortest = jnp.min(safe)
        arrived = (shortest < _TIGHT * fixed_horizon) & ~fresh & (shortest < left)
        which = jnp.argmin(safe)
        onward = jnp.minimum(jnp.maximum(shortest, jnp.where(fresh, 1e-10 * fixed_horizon, 0.0)), left)
        moved = eqx.tree_at(lambda n: n.local, m, m.local + jnp.where(arrived, 0.0, onward))
        met = _meet(plant, m, basis, which, quiet)
        after = jax.tree.map(lambda a, b: jnp.where(arrived, a, b), met, moved)
        tilt = jnp.abs(m.arc.rows[0] @ basis)
        return eqx.tree_at(
            lambda n: (n.steps, n.lost),
            after,
            (m.steps + 1, ~(stop_gradient(tilt) < limit)),
        )

    motion = jax.lax.while_loop(unfinished, step, motion)
    y = _state_at(motion, horizon)
    largest = jnp.maximum(motion.amplitude, jnp.abs(y[0]))
    return eqx.tree_at(lambda n: n.amplitude, motion, largest), y


def _state_at(m: Motion, horizon: Number) -> State:
    """The state at the horizon, with the horizon's and the arc's start's own derivatives."""
    basis = m.arc.basis(m.local)
    late = horizon - m.begun - m.local
    rows = m.arc.rows[:4]
    # A motion stopped short of the horizon (lost, or out of steps) stays where it is.
    late = jnp.where(jnp.abs(stop_gradient(late)) < 1e-6, late, 0.0)
    y = rows @ basis + late * (m.arc.rates.differentiate(rows) @ basis)
    return y.at[2].set(jnp.where(m.mode.kind == SLIP, y[2], 0.0))


def _safe_steps(m: Motion, basis: Basis, left: Number, watch_bob: bool) -> Float[Array, "signals"]:
    """For each signal, a step within which it cannot vanish (at most `left`)."""
    rates = jax.tree.map(stop_gradient, m.arc.rates)
    rows = stop_gradient(m.arc.rows[4 : 7 if watch_bob else 6])
    if watch_bob:
        rows = rows.at[2].multiply(m.bob_sign)
    first = rates.differentiate(rows)
    second = rates.differentiate(first)
    third = rates.differentiate(second)
    fourth = rates.differentiate(third)
    fresh = m.local == 0.0
    g0, g1, g2 = jnp.maximum(rows @ basis, 0.0), first @ basis, second @ basis
    # An arc born of an event begins inside: what rounding says to the contrary is noise.
    born = fresh & (m.begun > 0.0) & (rows @ basis < 1e-12)
    g1 = jnp.where(born, jnp.maximum(g1, 0.0), g1)
    window = jnp.minimum(left, jnp.minimum(1.0 / rates.xi, 1.0 / (rates.s1 + 0.1)))
    _, e1, e2, u, v, _, _ = basis
    growth = e1 * jnp.exp(rates.s1 * window)
    pair, pair_rate = third[:, 3] * u + third[:, 4] * v, fourth[:, 3] * u + fourth[:, 4] * v
    bound = (
        jnp.abs(third[:, 1]) * growth
        + jnp.abs(third[:, 2]) * e2
        + jnp.sqrt(pair**2 + pair_rate**2 / rates.q)
        + jnp.sqrt(third[:, 5] ** 2 + third[:, 6] ** 2)
    )
    bound = bound + 1e-300
    trials = (window, window / 4.0, jnp.clip(3.0 * g2 / bound, 0.0, window))
    steps = [_first_root(g0, g1, g2 - bound * d / 3.0, d) for d in trials]
    return jnp.maximum(jnp.maximum(steps[0], steps[1]), steps[2])


def _first_root(g0: Number, g1: Number, m: Number, longest: Number) -> Number:
    """The first positive root of g0 + g1 t + m t^2/2 with g0 >= 0, at most `longest`."""
    discriminant = g1**2 - 2.0 * m * g0
    root = jnp.sqrt(jnp.maximum(discriminant, 0.0))
    falling = g1 <= 0.0
    never = ((m >= 0.0) & ~falling) | (discriminant < 0.0)
    down = 2.0 * g0 / jnp.where(root - g1 > 0.0, root - g1, 1.0)
    over = (g1 + root) / jnp.where(m < 0.0, -m, 1.0)
    still = falling & (root - g1 <= 0.0)
    found = jnp.where(falling, jnp.where(still, jnp.where(m >= 0, longest, 0.0), down), over)
    return jnp.where(never, longest, jnp.minimum(found, longest))


def _meet(plant: Plant, m: Motion, basis: Basis, which: Int[Array, ""], quiet: Number) -> Motion:
    """The motion just after the event it has arrived at."""
    rows, rates = m.arc.rows, m.arc.rates
    slopes = rates.differentiate(rows)
    signal, slope = rows[4 + which] @ basis, slopes[4 + which] @ basis
    safe_slope = jnp.where(slope == 0.0, 1.0, slope)
    late = jnp.where(slope == 0.0, 0.0, -signal / stop_gradient(safe_slope))
    y = rows[:4] @ basis + late * (slopes[:4] @ basis)
    time = m.begun + m.local + late
    phase = m.arc.phase + plant.linear.xi * (m.local + late)
    mode, after = ends(plant, m.mode, y, jnp.sin(phase), which, quiet)
    bob_turned = which == 2
    mode = jax.tree.map(lambda a, b: jnp.where(bob_turned, a, b), m.mode, mode)
    after = jnp.where(bob_turned, y, after)
    bob_sign = jnp.where(bob_turned, -m.bob_sign, jnp.where(after[3] * y[3] < 0, -m.bob_sign, m.bob_sign))
    return Motion(
        mode,
        launch(plant, mode, after, phase),
        time,
        jnp.zeros_like(m.local),
        bob_sign,
        jnp.maximum(m.amplitude, jnp.abs(y[0])),
        jnp.maximum(m.stroke, jnp.abs(y[1])),
        m.steps,
        m.lost,
    )


def settled_at_rest(plant: Plant, m: Motion) -> tuple[Bool[Array, ""], Number]:
    """Whether a resting block can never lift again, because the pendulum's decaying swing and its
    steady one together stay within what weight and friction hold; and how far they reach (rad)."""
    linear, (s, c) = plant.linear, plant.swing
    # R = -f sin - 2 mu psi + bias psi' for the steady swing, whose rate is xi (s cos - c sin).
    two_mu, bias, xi = linear.tilt - 1.0, linear.bias, linear.xi
    steady = jnp.hypot(-linear.f - two_mu * s - bias * xi * c, -two_mu * c + bias * xi * s)
    basis = m.arc.basis(m.local)
    psi, rate = (m.arc.rows[i, 3] * basis[3] + m.arc.rows[i, 4] * basis[4] for i in (1, 3))
    stiffness = plant.held.q
    swing = jnp.sqrt(psi**2 + rate**2 / stiffness)
    decaying = two_mu * swing + jnp.abs(bias) * swing * jnp.sqrt(stiffness)
    stays = (m.mode.kind == REST) & (steady + decaying <= linear.weight + linear.friction)
    return stays, jnp.hypot(s, c) + swing
