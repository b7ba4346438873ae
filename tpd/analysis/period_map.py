"""Periodic orbits as fixed points of a model's period map P, by Newton's method, and their derivatives.

The map runs `Settled.periods` forcing periods from tau = 0. One run in forward mode gives P and DP, hence
the Newton step, the Floquet multipliers, and with dP/dp the derivative of the orbit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from tpd.core.eigenvalues import felt_by_block, rows_of
from tpd.core.parameters import Number, Parameters, State
from tpd.core.status import Status, is_settled
from tpd.models.base import AbstractModel, Settled
from tpd.models.settling import scale_of

_NEWTON_STEPS = 8
"""Bound on the steps of Newton's method; three or four usually do."""
RESIDUAL = 1e-8
"""Largest residual of the period map, in shares of the scales, of what is called an orbit."""


class Orbit(eqx.Module):
    """A (nearly) periodic orbit with the derivatives of one run along it."""

    y: State
    residual: Number
    end: State
    sizes: Float[Array, "2"]
    """Amplitude and stroke; of a motion that did not repeat the largest met so far."""
    by_parameter: Float[Array, "6 n"]
    """d(end, sizes)/dp at a fixed start."""
    by_state: Float[Array, "6 4"]
    """d(end, sizes)/dy at fixed parameters."""
    transversality: Number
    """See `Cycle`."""
    asymmetry: Number
    """See `Cycle`."""
    closed: Bool[Array, ""]
    """See `Cycle`."""

    @property
    def error(self) -> Number:
        """The residual, raised by half of the largest allowed one if the orbit is not `closed`."""
        return self.residual + jnp.where(self.closed, 0.0, 0.5 * RESIDUAL)


class _Walk(NamedTuple):
    """Newton's method on its way to a periodic orbit; or, of a motion that did not repeat, the
    motion itself and how its neighbours part from it."""

    y: State
    memory: Any
    best: Orbit
    direction: State
    parted: Number
    steps: Int[Array, ""]
    cut: Bool[Array, ""]
    """Whether a motion that did not repeat could not be followed further."""


def refine(p: Parameters, model: AbstractModel, settled: Settled) -> tuple[Orbit, Number]:
    """The periodic orbit near where following the motion ended. For a motion that did not repeat,
    its largest Lyapunov exponent (else NaN) instead."""
    along = _linearised(p, model, settled)
    repeats = settled.status != Status.not_settled
    # There is nothing to be said of a motion that is lost.
    worthwhile = is_settled(settled.status) | ~repeats
    scale = jnp.where(jnp.isfinite(scale_of(p)), scale_of(p), 1e300)
    nothing = jax.tree.map(
        lambda s: jnp.full(s.shape, jnp.inf, s.dtype), jax.eval_shape(along, settled.y, settled.memory)[0]
    )

    def going(w: _Walk) -> Array:
        newton = (w.steps < _NEWTON_STEPS) & (w.best.error > model.round_off)
        return worthwhile & ~w.cut & jnp.where(repeats, newton, w.steps < model.lyapunov_periods)

    def step(w: _Walk) -> _Walk:
        orbit, memory = along(w.y, w.memory)
        sizes = jnp.where(repeats, orbit.sizes, jnp.maximum(orbit.sizes, w.best.sizes))
        orbit = eqx.tree_at(lambda o: o.sizes, orbit, sizes)
        # y* = P(y*): Newton's step solves (I - DP) dy = P(y) - y.
        move = jnp.linalg.solve(jnp.eye(4) - orbit.by_state[:4], orbit.end - w.y)
        better = orbit.error < w.best.error
        best = jax.tree.map(lambda a, b: jnp.where(better | ~repeats, a, b), orbit, w.best)
        newton = jnp.where(jnp.all(jnp.isfinite(move)), w.y + move, w.y)
        onward = orbit.by_state[:4] @ w.direction
        size = jnp.sqrt(jnp.sum((onward / scale) ** 2)) + 1e-300
        # By rounding a map that is integrated may miss an event that undoes itself soon: half of a step that
        # led away tries once more.
        again = repeats & ~better & (w.best.error > RESIDUAL) & jnp.isfinite(w.best.error)
        newton = jnp.where(again, 0.5 * (w.y + w.best.y), newton)
        # That one began in the mode in which the best one ended.
        memory = jax.tree.map(lambda a, b: jnp.where(again, a, b), w.memory, memory)
        count = jnp.where(better | ~repeats | again, w.steps + 1, _NEWTON_STEPS)
        # An orbit that meets an event at tau = 0, such as every conservative one, comes out on either side of
        # it by rounding. Begun before the event and ended after it, the run counts the event twice, the other
        # way round not at all: both leave the state right and its derivative wrong. A run that begins in the
        # mode in which the last one ended meets it once.
        y = jnp.where(repeats, newton, orbit.end)
        after = _Walk(y, memory, best, onward / size, w.parted + jnp.log(size), count, w.cut)
        cut = ~repeats & ~jnp.all(jnp.isfinite(orbit.end))
        return jax.tree.map(lambda a, b: jnp.where(cut, a, b), w._replace(cut=cut), after)

    sizes = jnp.stack([settled.amplitude, settled.stroke])
    none = eqx.tree_at(lambda o: (o.y, o.sizes), nothing, (settled.y, sizes))
    zero = jnp.zeros(())
    no = jnp.zeros((), bool)
    first = _Walk(settled.y, settled.memory, none, 0.5 * scale, zero, jnp.zeros((), int), no)
    walk = jax.lax.while_loop(going, step, first)
    measured = ~repeats & (walk.steps > 1)
    exponent = walk.parted / (jnp.maximum(walk.steps, 1) * p.period)
    return walk.best, jnp.where(measured, exponent, jnp.nan)


def _linearised(
    p: Parameters, model: AbstractModel, settled: Settled
) -> Callable[[State, Any], tuple[Orbit, Any]]:
    """A function that runs the motion's periods from a state, with all derivatives."""
    flat, unflatten = ravel_pytree(p)
    size, scale = flat.size, scale_of(p, bob=jnp.asarray((p.mu > 0) | (p.zeta > 0)))

    def along(y: State, memory: Any) -> tuple[Orbit, Any]:
        x = jnp.concatenate([flat, y])
        now = eqx.tree_at(lambda s: s.memory, settled, memory, is_leaf=lambda leaf: leaf is None)

        def run(x: Float[Array, "n"]) -> tuple[Float[Array, "6"], tuple]:
            cycle = model.cycle(unflatten(x[:size]), now, x[size:])
            sizes = jnp.stack([cycle.amplitude, cycle.stroke])
            met = cycle.transversality, cycle.asymmetry, cycle.closed
            return jnp.concatenate([cycle.end, sizes]), (met, cycle.memory)

        def push(direction: Float[Array, "n"]) -> tuple[Array, Array, tuple]:
            return jax.jvp(run, (x,), (direction,), has_aux=True)

        out, columns, (met, memory) = jax.vmap(push, out_axes=(None, 1, None))(jnp.eye(x.size))
        residual = jnp.max(jnp.abs(out[:4] - y) / scale)
        by_parameter, by_state = columns[:, :size], columns[:, size:]
        return Orbit(y, residual, out[:4], out[4:], by_parameter, by_state, *met), memory

    return along


def multipliers(p: Parameters, jacobian: Float[Array, "4 4"]) -> tuple[Number, Number]:
    """The largest modulus of the Floquet multipliers that the block can feel (all, unless mu = 0), and
    the least distance of one from +1."""
    felt = jnp.array(felt_by_block(p, rows_of(jacobian)))
    finite = jnp.all(jnp.isfinite(felt))
    values = jnp.linalg.eigvals(jnp.where(finite, felt, 0.0))
    return jnp.where(finite, jnp.max(jnp.abs(values)), jnp.inf), jnp.min(jnp.abs(1.0 - values))


def implicit(orbit: Orbit) -> tuple[Float[Array, "2"], Float[Array, "6 n"]]:
    """(amplitude, stroke) after one more Newton step, and the derivatives of (amplitude, stroke, state)
    with the orbit following its parameters."""
    # y*(p) = P(y*(p), p), hence dy*/dp = (I - DP)^-1 dP/dp, however long the transient was; amplitude and
    # stroke are functions of (y*, p) along the period. The residual is one more right-hand side, so that the
    # sizes gain the last Newton step for nothing. I - DP is singular at a fold: the caller refuses slopes
    # there.
    right = jnp.concatenate([(orbit.end - orbit.y)[:, None], orbit.by_parameter[:4]], axis=1)
    follow = jnp.linalg.solve(jnp.eye(4) - orbit.by_state[:4], right)
    moves = orbit.by_state[4:] @ follow
    slopes = jnp.concatenate([orbit.by_parameter[4:] + moves[:, 1:], follow[:, 1:]])
    return orbit.sizes + moves[:, 0], slopes
