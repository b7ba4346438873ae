"""Newton's method on the map of some forcing periods, for models that are programs of JAX.

The method, its bounds and what counts as an orbit are those of `tpd.exact.period_map`, where they are
explained. One run in forward mode gives the map P and DP, hence the Newton step, the Floquet multipliers, and
with dP/dp the derivative of the orbit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from tpd.exact.runs import Settled
from tpd.exact.terms import LAST_STEP, NEWTON_STEPS, RESIDUAL
from tpd.models.base import AbstractFlow
from tpd.models.settling import scale_of
from tpd.scene.parameters import Parameters
from tpd.scene.status import index_of


class Orbit(NamedTuple):
    """A (nearly) periodic orbit with the derivatives of one run along it."""

    y: Any
    residual: Any
    end: Any
    sizes: Any
    """Amplitude and stroke."""
    by_parameter: Any
    """d(end, sizes)/dp at a fixed start, shape (6, n)."""
    by_state: Any
    """d(end, sizes)/dy at fixed parameters, shape (6, 4)."""
    transversality: Any
    asymmetry: Any
    closed: Any
    """The last three as in `Cycle`."""
    step: Any = 0.0
    longest: Any = 0.0
    """Newton's step from the start, zero if there is none, and its largest share of the scales."""

    @property
    def error(self) -> Any:
        """The residual, raised by half of the largest allowed one if the orbit is not `closed`."""
        return self.residual + jnp.where(self.closed, 0.0, 0.5 * RESIDUAL)


_Along = Callable[[Any, Any], tuple[Orbit, Any]]
"""(state, memory) to the run of a motion's periods from there, and the memory at its end."""


def is_rocking(status: Any) -> Any:
    """Whether the number of a status is that of an attracting motion of the block."""
    return (status == index_of("rocking")) | (status == index_of("sticking"))


def _where(condition: Any, a: Any, b: Any) -> Any:
    """One of two trees of numbers."""
    return jax.tree.map(lambda x, y: jnp.where(condition, x, y), a, b)


class _Walk(NamedTuple):
    """Newton's method on its way to a periodic orbit."""

    y: Any
    memory: Any
    best: Orbit
    steps: Any


def refine(p: Parameters, model: AbstractFlow, begun: Settled, code: Any) -> Orbit:
    """The periodic orbit near where following the motion ended, with `code` the number of its status."""
    along = _linearised(p, model, begun)
    # There is nothing to be said of a motion that is lost, or does not repeat.
    worthwhile = is_rocking(code) | (code == index_of("rest"))

    def going(w: _Walk) -> Any:
        return worthwhile & (w.steps < NEWTON_STEPS) & (w.best.error > model.round_off)

    def step(w: _Walk) -> _Walk:
        orbit, memory = along(w.y, w.memory)
        better = orbit.error < w.best.error
        again = ~better & jnp.isfinite(w.best.error) & (w.best.longest > LAST_STEP)
        onward = jnp.where(again, 0.5 * (w.y + w.best.y), w.y + orbit.step)
        steps = jnp.where(better | again, w.steps + 1, NEWTON_STEPS)
        return _Walk(onward, _where(again, w.memory, memory), _where(better, orbit, w.best), steps)

    # Nothing has been found yet: all that a run gives is infinite.
    infinite, sizes = jnp.full((6, 9), jnp.inf), jnp.stack([begun.amplitude, begun.swing])
    rest = infinite[0, 0], infinite[0, :4], sizes, infinite, infinite[:, :4], infinite[0, 0], infinite[0, 0]
    none = Orbit(begun.y, *rest, jnp.ones((), bool), jnp.zeros(4), infinite[0, 0])
    first = _Walk(begun.y, begun.memory, none, jnp.zeros((), int))
    return jax.lax.while_loop(going, step, first).best


def _linearised(p: Parameters, model: AbstractFlow, settled: Settled) -> _Along:
    """A function that runs the motion's periods from a state, with all derivatives; traced."""
    flat, unflatten = ravel_pytree(p)
    size, scale = flat.size, scale_of(p, bob=jnp.asarray((p.mu > 0) | (p.zeta > 0)))

    def along(y: Any, memory: Any) -> tuple[Orbit, Any]:
        x = jnp.concatenate([flat, y])
        now = eqx.tree_at(lambda s: s.memory, settled, memory, is_leaf=lambda leaf: leaf is None)

        def run(x: Float[Array, "n"]) -> tuple[Float[Array, "6"], tuple]:
            cycle = model.cycle(unflatten(x[:size]), now, x[size:])
            sizes = jnp.stack([cycle.amplitude, cycle.swing])
            met = cycle.transversality, cycle.asymmetry, cycle.closed
            return jnp.concatenate([cycle.end, sizes]), (met, cycle.memory)

        def push(direction: Float[Array, "n"]) -> tuple[Array, Array, tuple]:
            return jax.jvp(run, (x,), (direction,), has_aux=True)

        out, columns, (met, memory) = jax.vmap(push, out_axes=(None, 1, None))(jnp.eye(x.size))
        residual = jnp.max(jnp.abs(out[:4] - y) / scale)
        by_parameter, by_state = columns[:, :size], columns[:, size:]
        step = jnp.linalg.solve(jnp.eye(4) - by_state[:4], out[:4] - y)
        # Of a singular I - DP there is no step, and the next one begins at the same state.
        step = jnp.where(jnp.all(jnp.isfinite(step)), step, 0.0)
        longest = jnp.max(jnp.abs(step) / scale)
        return Orbit(
            y, residual, out[:4], out[4:], by_parameter, by_state, *met, step=step, longest=longest
        ), memory

    return along


def multipliers(mu: Any, jacobian: Any) -> tuple[Any, Any]:
    """The largest modulus of the Floquet multipliers that the block can feel (all, unless mu = 0), and
    the least distance of one from +1."""
    # A bob without mass (mu = 0) does not act on the block. With its rows and columns set to zero the
    # multipliers of the block and two zeros are left.
    bob = jnp.where(mu > 0.0, 1.0, 0.0)
    feels = jnp.stack([1.0 + 0.0 * bob, bob, 1.0 + 0.0 * bob, bob])
    felt = jacobian * (feels[:, None] * feels[None])
    finite = jnp.all(jnp.isfinite(felt))
    values = jnp.linalg.eigvals(_where(finite, felt, jnp.zeros((4, 4))))
    return _where(finite, jnp.max(jnp.abs(values)), jnp.inf), jnp.min(jnp.abs(1.0 - values))


def implicit(orbit: Orbit) -> tuple[Any, Any]:
    """(amplitude, stroke) after one more Newton step, and the derivatives of (amplitude, stroke, state)
    with the orbit following its parameters, shape (6, n)."""
    # By the implicit function theorem, see `tpd.exact.steady`; at a fold the caller refuses the slopes.
    right = jnp.concatenate([(orbit.end - orbit.y)[:, None], orbit.by_parameter[:4]], axis=1)
    follow = jnp.linalg.solve(jnp.eye(4) - orbit.by_state[:4], right)
    moves = orbit.by_state[4:] @ follow
    slopes = jnp.concatenate([orbit.by_parameter[4:] + moves[:, 1:], follow[:, 1:]])
    return orbit.sizes + moves[:, 0], slopes
