"""Newton's method on the map of some forcing periods, for models that are JAX programs.

`tpd.compiled.period_map` explains the method, its limits and its criterion for an orbit. One run in forward
mode gives the map P and its derivative DP, hence the Newton step and the Floquet multipliers, and together
with dP/dp the derivative of the orbit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from tpd.compiled.columns import AT_REST, LAST_STEP, NEWTON_STEPS, RESIDUAL, ROCKING, STICKING, WIDTH
from tpd.compiled.simulate import Run
from tpd.models.settling import scale_of
from tpd.scene.parameters import Parameters


class Orbit(NamedTuple):
    """Approximation of a periodic orbit, with the derivatives of one run along it."""

    y: Any
    """State at the beginning."""
    residual: Any
    """Largest difference between end and beginning, relative to the scale of the state."""
    end: Any
    """State at the end."""
    sizes: Any
    """Amplitude and swing, rad."""
    by_parameter: Any
    """Derivative d(end, sizes)/dp at a fixed initial state, shape (6, n)."""
    by_state: Any
    """Derivative d(end, sizes)/dy at fixed parameters, shape (6, 4)."""
    transversality: Any
    """See `Cycle.transversality`."""
    asymmetry: Any
    """See `Cycle.asymmetry`."""
    closed: Any
    """See `Cycle.closed`."""
    step: Any = 0.0
    """Newton step from the beginning; zero if it does not exist."""
    longest: Any = 0.0
    """Largest component of the Newton step, relative to the scale of the state."""

    @property
    def error(self) -> Any:
        """Residual, increased by half of the largest allowed residual if the orbit is not `closed`."""
        return self.residual + jnp.where(self.closed, 0.0, 0.5 * RESIDUAL)


_Along = Callable[[Any, Any], tuple[Orbit, Any]]
"""Function of (state, memory). It runs the periods of a motion and returns the run and the final memory."""


def is_rocking(status: Any) -> Any:
    """Whether the number of a status belongs to a block that moves on an attracting orbit."""
    return (status == ROCKING) | (status == STICKING)


def _where(condition: Any, a: Any, b: Any) -> Any:
    """Select one of two pytrees of numbers."""
    return jax.tree.map(lambda x, y: jnp.where(condition, x, y), a, b)


class _Iteration(NamedTuple):
    """Iteration of Newton's method."""

    y: Any
    """State at which the next run begins."""
    memory: Any
    """Discrete state at which the next run begins."""
    best: Orbit
    """Run with the smallest error so far."""
    steps: Any
    """Number of steps so far."""


def refine(p: Parameters, model: Any, reached: Run, code: Any) -> Orbit:
    """Solve for the periodic orbit near the motion that following has reached.

    Args:
        p: dimensionless parameters.
        model: model of the motion.
        reached: motion that following has reached.
        code: number of its status.
    """
    run = _linearised(p, model, reached)
    # A motion that overturns or does not repeat has no orbit to solve for.
    has_orbit = is_rocking(code) | (code == AT_REST)

    def goes_on(w: _Iteration) -> Any:
        return has_orbit & (w.steps < NEWTON_STEPS) & (w.best.error > model.round_off)

    def step(w: _Iteration) -> _Iteration:
        orbit, memory = run(w.y, w.memory)
        better = orbit.error < w.best.error
        # A step that increases the error is halved, unless it was tiny. Then the iteration ends.
        again = ~better & jnp.isfinite(w.best.error) & (w.best.longest > LAST_STEP)
        onward = jnp.where(again, 0.5 * (w.y + w.best.y), w.y + orbit.step)
        steps = jnp.where(better | again, w.steps + 1, NEWTON_STEPS)
        return _Iteration(onward, _where(again, w.memory, memory), _where(better, orbit, w.best), steps)

    # Before the first run the error is infinite, so every run is better.
    infinite, sizes = jnp.full((), jnp.inf), jnp.stack([reached.settled_tilt, reached.settled_swing])
    ends = jnp.full(4, jnp.inf), sizes, jnp.full((6, WIDTH), jnp.inf), jnp.full((6, 4), jnp.inf)
    rest = infinite, *ends, infinite, infinite
    none = Orbit(reached.state, *rest, jnp.ones((), bool), jnp.zeros(4), infinite)
    first = _Iteration(reached.state, reached.memory, none, jnp.zeros((), int))
    return jax.lax.while_loop(goes_on, step, first).best


def _linearised(p: Parameters, model: Any, settled: Run) -> _Along:
    """Return a function that runs the periods of a motion from a state, with all derivatives (traced)."""
    flat, unflatten = ravel_pytree(p)
    # The angle and the rate of the bob count for the residual if the block feels them, or if they decay.
    size, scale = flat.size, scale_of(p, bob=jnp.asarray((p.mu > 0) | (p.zeta > 0)))

    def along(y: Any, memory: Any) -> tuple[Orbit, Any]:
        x = jnp.concatenate([flat, y])
        # The run continues from another state and another discrete state than `settled`.
        now = settled._replace(memory=memory)

        def run(x: Float[Array, "n"]) -> tuple[Float[Array, "6"], tuple]:
            cycle = model.cycle(unflatten(x[:size]), now, x[size:])
            sizes = jnp.stack([cycle.amplitude, cycle.swing])
            events = cycle.transversality, cycle.asymmetry, cycle.closed
            return jnp.concatenate([cycle.end, sizes]), (events, cycle.memory)

        def push(direction: Float[Array, "n"]) -> tuple[Array, Array, tuple]:
            return jax.jvp(run, (x,), (direction,), has_aux=True)

        # One forward pass for each parameter and each component of the state, all in one batch.
        out, columns, (events, memory) = jax.vmap(push, out_axes=(None, 1, None))(jnp.eye(x.size))
        residual = jnp.max(jnp.abs(out[:4] - y) / scale)
        by_parameter, by_state = columns[:, :size], columns[:, size:]
        step = jnp.linalg.solve(jnp.eye(4) - by_state[:4], out[:4] - y)
        # If I - DP is singular, there is no step, and the next run begins at the same state.
        step = jnp.where(jnp.all(jnp.isfinite(step)), step, 0.0)
        longest = jnp.max(jnp.abs(step) / scale)
        return Orbit(
            y, residual, out[:4], out[4:], by_parameter, by_state, *events, step=step, longest=longest
        ), memory

    return along


def multipliers(mu: Any, jacobian: Any) -> tuple[Any, Any]:
    """Return the largest modulus of the Floquet multipliers, and the smallest distance of one from +1.

    For mu = 0 only the multipliers of the block count.
    """
    # A bob without mass (mu = 0) does not act on the block. If its rows and columns are zero, the eigenvalues
    # are the multipliers of the block and two zeros.
    bob = jnp.where(mu > 0.0, 1.0, 0.0)
    feels = jnp.stack([1.0 + 0.0 * bob, bob, 1.0 + 0.0 * bob, bob])
    felt = jacobian * (feels[:, None] * feels[None])
    # `eigvals` must not receive infinite numbers. The modulus is then infinite.
    finite = jnp.all(jnp.isfinite(felt))
    values = jnp.linalg.eigvals(_where(finite, felt, jnp.zeros((4, 4))))
    return _where(finite, jnp.max(jnp.abs(values)), jnp.inf), jnp.min(jnp.abs(1.0 - values))


def implicit(orbit: Orbit) -> tuple[Any, Any]:
    """Return (amplitude, swing) after one more Newton step, and the derivatives of the orbit.

    The derivatives are those of (amplitude, swing, state) with respect to the parameters, shape (6, n).
    """
    # The implicit function theorem, see `tpd.compiled.steady`. At a fold the caller replaces the slopes by
    # NaN.
    right = jnp.concatenate([(orbit.end - orbit.y)[:, None], orbit.by_parameter[:4]], axis=1)
    follow = jnp.linalg.solve(jnp.eye(4) - orbit.by_state[:4], right)
    moves = orbit.by_state[4:] @ follow
    slopes = jnp.concatenate([orbit.by_parameter[4:] + moves[:, 1:], follow[:, 1:]])
    return orbit.sizes + moves[:, 0], slopes
