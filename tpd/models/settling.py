"""Decide, forcing period after forcing period, whether a motion repeats, rests, overturns or goes on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from tpd.compiled.columns import SWING, TILT
from tpd.compiled.simulate import Run
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State
from tpd.scene.status import Status

LONGEST = 8
"""Longest period, in forcing periods, that is recognised as a repetition."""
_EXACT = 1e-3
"""Largest change in a period for which its decay does not matter, as a share of the tolerance."""


class Period(NamedTuple):
    """Summary of one forcing period of a motion."""

    y: State
    """State at the end of the period."""
    memory: Any
    """Discrete state at the end of the period, see `Run.memory`."""
    amplitude: Number
    """Largest |phi|, rad."""
    swing: Number
    """Largest |psi|, rad."""
    rests: Bool[Array, ""]
    """Whether the block has stopped moving for good: on its base, or tilted, where friction holds it."""
    overturned: Bool[Array, ""]
    """Whether the block has overturned."""
    exhausted: Bool[Array, ""]
    """Whether the limit on events or solver steps ended the period early."""
    sticks: Bool[Array, ""]
    """Whether friction or the base held the block during a part of the period."""
    peak: Number
    """Largest |phi|, rad; equal to `amplitude` unless the block came to rest."""
    peak_swing: Number
    """Largest |psi|, rad, see `peak`."""


class Record(NamedTuple):
    """The periods of a motion so far."""

    past: Period
    """The last `LONGEST` periods, the newest first along the first axis of each field. Where there are fewer
    periods, the states are infinite."""
    repeats: Int[Array, ""]
    """Number of periods after which the motion repeats; 0 if it does not repeat."""
    elapsed: Int[Array, ""]
    """Number of periods so far."""
    peak: Number
    """Largest |phi| so far, rad."""
    peak_swing: Number
    """Largest |psi| so far, rad."""

    @property
    def newest(self) -> Period:
        """The last period."""
        return jax.tree.map(lambda x: x[0], self.past)

    @property
    def done(self) -> Bool[Array, ""]:
        """Whether the outcome of the motion is known, so no further period is necessary."""
        last = self.newest
        return (self.repeats > 0) | last.rests | last.overturned | last.exhausted

    def add(self, period: Period, scale: Float[Array, "4"], tolerance: float) -> Record:
        """Return the record with one more period."""
        # The new state is compared with the states after the last few periods: a motion of period n repeats
        # the n-th of them. States are compared, and not amplitudes, because two different motions may have
        # the same amplitude.
        distances = lambda y, states: jnp.max(jnp.abs(y[None] - states) / scale[None], axis=1)  # noqa: E731
        errors, before = distances(period.y, self.past.y), distances(self.newest.y, self.past.y[1:])
        # The sum of all further changes must be small as well, see `tpd.compiled.repetition`.
        falls = jnp.append(jnp.where(jnp.isfinite(before), before, 0.0), 0.0) - errors
        close = (errors < tolerance) & ((errors < _EXACT * tolerance) | (errors**2 < tolerance * falls))
        # A transient that alternates and converges to a motion of period one repeats after two periods sooner
        # than after one. Once one error is below the tolerance, the shortest period with a similarly small
        # error is therefore selected.
        repeats = jnp.where(jnp.any(close), jnp.argmax(errors < 100.0 * tolerance) + 1, 0)
        push = lambda new, old: jnp.concatenate([jnp.asarray(new)[None], old[:-1]])  # noqa: E731
        past = jax.tree.map(push, period, self.past)
        # After an early end the state may be unchanged, which is not a repetition.
        repeats = jnp.where(period.exhausted, 0, repeats)
        peak, swing = jnp.maximum(self.peak, period.peak), jnp.maximum(self.peak_swing, period.peak_swing)
        return Record(past, repeats, self.elapsed + 1, peak, swing)

    def settled(self) -> Run:
        """Return the settled motion with its status."""
        periods, past, last = jnp.maximum(self.repeats, 1), self.past, self.newest
        # Only the periods of the repeating motion itself count. Earlier periods belong to the transient.
        own = (jnp.arange(LONGEST) < periods) | (self.repeats == 0)
        swing, amplitude = (jnp.max(jnp.where(own, x, 0.0)) for x in (past.swing, past.amplitude))
        sticks = jnp.any(past.sticks & (jnp.arange(LONGEST) < periods))
        # Later lines overrule earlier ones.
        status = Status.where(sticks, Status.sticking, Status.rocking)
        status = Status.where(self.repeats > 0, status, Status.not_settled)
        status = Status.where(last.exhausted, Status.event_bound, status)
        resting = Status.where(last.y[TILT] != 0.0, Status.held, Status.rest)
        status = Status.where(last.rests, resting, status)
        # If the block never moves, the motion of the bob may repeat before its remaining decay is proved to
        # be too small to lift the block.
        still = (self.repeats > 0) & (amplitude == 0.0)
        status = Status.where(still, Status.rest, status)
        status = Status.where(last.overturned, Status.overturned, status)
        status = Status.where(jnp.all(jnp.isfinite(last.y)), status, Status.failed)
        swing = jnp.where(last.rests, last.swing, swing)
        amplitude = jnp.where(last.rests, jnp.abs(last.y[TILT]), amplitude)
        sizes = self.peak, amplitude, self.peak_swing, swing
        tilt, settled_tilt, swing, settled_swing = (jnp.where(last.overturned, jnp.inf, x) for x in sizes)
        # The sum of tilt and swing is an upper bound of the rod angle.
        bounds = tilt + swing, settled_tilt + settled_swing
        ends = last.y, status, periods, self.elapsed, last.memory
        return Run(tilt, settled_tilt, swing, settled_swing, *bounds, *ends)


def blank(y0: State, memory: Any) -> Record:
    """Return the record of a motion before its first period."""
    no, none, count = jnp.zeros(LONGEST, bool), jnp.zeros(LONGEST), jnp.zeros((), int)
    memories = jax.tree.map(lambda x: jnp.stack([x] * LONGEST), memory)
    states = jnp.full((LONGEST, 4), jnp.inf).at[0].set(y0)
    past = Period(states, memories, none, none, no, no, no, no, none, none)
    return Record(past, count, count, jnp.abs(y0[TILT]), jnp.abs(y0[SWING]))


def scale_of(p: Any, *, bob: Any = None) -> Float[Array, "4"]:
    """Return the scales of (phi, psi, phi', psi') to which a repetition error is compared.

    A bob without mass (mu = 0) cannot move the block. The scales of its angle and rate are then infinite, so
    its state is ignored, unless `bob` is true.
    """
    rate = jnp.maximum(p.xi, 1.0)
    swing = jnp.where(jnp.asarray(p.mu) > 0 if bob is None else bob, p.nu + p.f, jnp.inf)
    # Errors of rates are divided by the forcing frequency or, at low frequencies, by the rate of the block.
    return jnp.stack([p.nu * jnp.ones(()), swing, p.nu * rate, swing * rate])


def settle(
    one_period: Callable[[State, Any], Period],
    p: Parameters,
    y0: State,
    memory: Any,
    *,
    tolerance: float,
    max_periods: int,
) -> Run:
    """Run `one_period` repeatedly, as a traced loop, until the outcome of the motion is known.

    The loop ends if the state repeats after 1 to `LONGEST` periods within `tolerance` times its scale, if the
    block rests for good or overturns, or after `max_periods` periods.
    """
    scale = scale_of(p)

    def goes_on(r: Record) -> Bool[Array, ""]:
        return ~r.done & (r.elapsed < max_periods)

    def step(r: Record) -> Record:
        return r.add(one_period(r.newest.y, r.newest.memory), scale, tolerance)

    return jax.lax.while_loop(goes_on, step, blank(y0, memory)).settled()
