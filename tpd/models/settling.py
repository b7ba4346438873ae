"""Following a motion period by period until it repeats itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from tpd.models.interface import Settled
from tpd.parameters import Number, Parameters, State
from tpd.status import Status

LONGEST = 8
"""Longest motion recognised as periodic, in forcing periods."""


class Period(NamedTuple):
    """What one forcing period did."""

    y: State
    memory: Any
    amplitude: Number
    stroke: Number
    rests: Bool[Array, ""]
    lost: Bool[Array, ""]
    exhausted: Bool[Array, ""]


class _Progress(NamedTuple):
    y: State
    memory: Any
    past: Float[Array, "longest 4"]
    amplitudes: Float[Array, "longest"]
    strokes: Float[Array, "longest"]
    repeats: Int[Array, ""]
    period: Period
    elapsed: Int[Array, ""]


def scale_of(p: Parameters) -> Float[Array, "4"]:
    """Sizes of (phi, psi, phi', psi') against which a repetition is judged. A bob without mass
    cannot move the block, so its state is left out of the judgement."""
    rate = jnp.maximum(p.xi, 1.0)
    swing = jnp.where(jnp.asarray(p.mu) > 0, p.nu + p.f, jnp.inf)
    return jnp.stack([p.nu * jnp.ones(()), swing, p.nu * rate, swing * rate])


def settle(
    one_period: Callable[[State, Any], Period],
    p: Parameters,
    y0: State,
    memory: Any,
    *,
    tolerance: float,
    max_periods: int,
) -> Settled:
    """Run `one_period` until the state repeats after 1 to `LONGEST` periods, within `tolerance`
    of its scale, or until the block rests for good, is lost, or the bound is reached."""
    scale = scale_of(p)

    def going(s: _Progress) -> Bool[Array, ""]:
        done = (s.repeats > 0) | s.period.rests | s.period.lost | s.period.exhausted
        return ~done & (s.elapsed < max_periods)

    def step(s: _Progress) -> _Progress:
        period = one_period(s.y, s.memory)
        errors = jnp.max(jnp.abs(period.y[None] - s.past) / scale[None], axis=1)
        # A motion alternating on its way to period one repeats sooner after two periods than
        # after one: take the shortest period that is close as well.
        repeats = jnp.where(jnp.any(errors < tolerance), jnp.argmax(errors < 100.0 * tolerance) + 1, 0)
        return _Progress(
            period.y,
            period.memory,
            jnp.concatenate([period.y[None], s.past[:-1]]),
            jnp.concatenate([jnp.asarray(period.amplitude)[None], s.amplitudes[:-1]]),
            jnp.concatenate([jnp.asarray(period.stroke)[None], s.strokes[:-1]]),
            repeats,
            period,
            s.elapsed + 1,
        )

    no, zero = jnp.zeros((), bool), jnp.zeros(())
    past = jnp.full((LONGEST, 4), jnp.inf).at[0].set(y0)
    none = jnp.zeros(LONGEST)
    count = jnp.zeros((), int)
    idle = Period(y0, memory, zero, zero, no, no, no)
    first = _Progress(y0, memory, past, none, none, count, idle, count)
    s: _Progress = jax.lax.while_loop(going, step, first)
    status = Status.where(s.repeats > 0, Status.rocking, Status.not_settled)
    status = Status.where(s.period.exhausted, Status.event_bound, status)
    status = Status.where(s.period.rests, Status.rest, status)
    status = Status.where(s.period.lost, Status.overturned, status)
    status = Status.where(jnp.all(jnp.isfinite(s.y)), status, Status.failed)
    return Settled(
        s.y,
        s.memory,
        jnp.maximum(s.repeats, 1),
        jnp.max(s.amplitudes),
        jnp.where(s.period.rests, s.period.stroke, jnp.max(s.strokes)),
        status,
        s.elapsed,
    )
