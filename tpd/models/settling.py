"""Recognising, period after period, that a motion repeats itself, rests or is lost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from tpd.exact.runs import Settled
from tpd.exact.terms import SWING, TILT
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State
from tpd.scene.status import Status

LONGEST = 8
"""Longest motion recognised as periodic, in forcing periods."""


class Period(NamedTuple):
    """Summary of one forcing period."""

    y: State
    memory: Any
    amplitude: Number
    swing: Number
    rests: Bool[Array, ""]
    """Whether the block does not move any more: on its base, or where friction holds it leaning."""
    lost: Bool[Array, ""]
    exhausted: Bool[Array, ""]
    held: Bool[Array, ""]
    """Whether the block was held by friction, or on its base, for a part of it."""
    peak: Number
    """Largest |phi|; `amplitude` as well unless the block came to rest."""
    peak_swing: Number


class Record(NamedTuple):
    """The last `LONGEST` periods of a motion, newest first."""

    y: State
    memory: Any
    past: Float[Array, "longest 4"]
    amplitudes: Float[Array, "longest"]
    swings: Float[Array, "longest"]
    held: Bool[Array, "longest"]
    repeats: Int[Array, ""]
    """Periods after which the motion repeats itself; 0 if it does not."""
    rests: Bool[Array, ""]
    lost: Bool[Array, ""]
    exhausted: Bool[Array, ""]
    elapsed: Int[Array, ""]
    peak: Number
    """Largest |phi| so far."""
    peak_swing: Number

    @property
    def done(self) -> Bool[Array, ""]:
        """Whether nothing new can follow."""
        return (self.repeats > 0) | self.rests | self.lost | self.exhausted

    def add(self, period: Period, scale: Float[Array, "4"], tolerance: float) -> Record:
        """With one more period."""
        # One period is compared with each of the last few: a motion of period n repeats the n-th of them.
        # Comparing states rather than sizes of swings cannot mistake one motion for another of the same size.
        errors = jnp.max(jnp.abs(period.y[None] - self.past) / scale[None], axis=1)
        # A motion alternating on its way to period one repeats sooner after two periods than
        # after one: take the shortest period that is close as well.
        repeats = jnp.where(jnp.any(errors < tolerance), jnp.argmax(errors < 100.0 * tolerance) + 1, 0)

        def push(new: Array | float, old: Array) -> Array:
            return jnp.concatenate([jnp.asarray(new)[None], old[:-1]])

        return Record(
            period.y,
            period.memory,
            push(period.y, self.past),
            push(period.amplitude, self.amplitudes),
            push(period.swing, self.swings),
            push(period.held, self.held),
            # A motion that was cut short stands where it stood, which is no repetition.
            jnp.where(period.exhausted, 0, repeats),
            period.rests,
            period.lost,
            period.exhausted,
            self.elapsed + 1,
            jnp.maximum(self.peak, period.peak),
            jnp.maximum(self.peak_swing, period.peak_swing),
        )

    def settled(self) -> Settled:
        """Where the motion has settled, with its status."""
        periods = jnp.maximum(self.repeats, 1)
        # Of a motion that repeats itself, what its own periods reached: those before belong to the way there.
        own = (jnp.arange(LONGEST) < periods) | (self.repeats == 0)
        swing, amplitude = (jnp.max(jnp.where(own, x, 0.0)) for x in (self.swings, self.amplitudes))
        held = jnp.any(self.held & (jnp.arange(LONGEST) < periods))
        status = Status.where(held, Status.sticking, Status.rocking)
        status = Status.where(self.repeats > 0, status, Status.not_settled)
        status = Status.where(self.exhausted, Status.event_bound, status)
        leans = self.rests & (self.y[TILT] != 0.0)
        status = Status.where(self.rests, Status.where(leans, Status.held, Status.rest), status)
        # The bob of a block that never moved may repeat itself before its decay is proved to be harmless.
        still = (self.repeats > 0) & (amplitude == 0.0)
        status = Status.where(still, Status.rest, status)
        status = Status.where(self.lost, Status.overturned, status)
        status = Status.where(jnp.all(jnp.isfinite(self.y)), status, Status.failed)
        swing = jnp.where(self.rests, self.swings[0], swing)
        amplitude = jnp.where(self.rests, jnp.abs(self.y[TILT]), amplitude)
        peaks = (jnp.where(self.lost, jnp.inf, x) for x in (self.peak, self.peak_swing))
        return Settled(self.y, self.memory, periods, amplitude, swing, status, self.elapsed, *peaks)


def blank(y0: State, memory: Any) -> Record:
    """The record of a motion that is about to begin."""
    no, count, none = jnp.zeros((), bool), jnp.zeros((), int), jnp.zeros(LONGEST)
    past = jnp.full((LONGEST, 4), jnp.inf).at[0].set(y0)
    peaks = jnp.abs(y0[TILT]), jnp.abs(y0[SWING])
    return Record(y0, memory, past, none, none, jnp.zeros(LONGEST, bool), count, no, no, no, count, *peaks)


def scale_of(p: Any, *, bob: Any = None) -> Float[Array, "4"]:
    """Sizes of (phi, psi, phi', psi') against which a repetition is judged. A bob without mass
    cannot move the block, so that its state is left out unless `bob` asks for it."""
    rate = jnp.maximum(p.xi, 1.0)
    swing = jnp.where(jnp.asarray(p.mu) > 0 if bob is None else bob, p.nu + p.f, jnp.inf)
    # Errors of rates count over the forcing's rate, but at slow forcing over that of the block itself.
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

    def going(r: Record) -> Bool[Array, ""]:
        return ~r.done & (r.elapsed < max_periods)

    def step(r: Record) -> Record:
        return r.add(one_period(r.y, r.memory), scale, tolerance)

    return jax.lax.while_loop(going, step, blank(y0, memory)).settled()
