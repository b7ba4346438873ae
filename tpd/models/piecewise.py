"""The exact piecewise solution of the linear equations, with true signs."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tpd import checks
from tpd.exact.arcs import Mode, classify
from tpd.exact.flow import advance, settled_at_rest, start
from tpd.exact.spectrum import Plant
from tpd.models.interface import AbstractModel, Cycle, Settled
from tpd.models.settling import Period, settle
from tpd.parameters import Number, Parameters, State
from tpd.status import Status


class Piecewise(AbstractModel):
    """Closed-form arcs joined at their events: no smoothing and no time-step error.

    Arcs slip in all four sign combinations, stick off the base, or rest on it. An impact slower
    than `rest_rate` (phi' in units of nu) that the block can be held after counts as rest, which
    ends rattling; the error is of the order of its square.
    """

    max_periods: int = eqx.field(default=500, static=True, kw_only=True)
    """Forcing periods to follow before giving up on a repetition."""
    max_events: int = eqx.field(default=2000, static=True, kw_only=True)
    """Bound on the steps and events of one forcing period."""
    tolerance: float = eqx.field(default=1e-6, static=True, kw_only=True)
    """Repetition error at which following ends and Newton's method takes over."""
    rest_rate: float = eqx.field(default=2e-7, static=True, kw_only=True)

    def __check_init__(self) -> None:
        checks.positive("max_periods", self.max_periods)
        checks.positive("max_events", self.max_events)
        checks.positive("tolerance", self.tolerance)
        checks.positive("rest_rate", self.rest_rate)

    def check(self, p: Parameters) -> None:
        """Every valid set of parameters is representable."""

    @property
    def round_off(self) -> float:
        """Residual of the period map that counts as round-off."""
        return 1e-14

    def resolution(self, p: Parameters) -> Number:
        """Rest is exact here."""
        return jnp.zeros_like(jnp.asarray(p.nu))

    def _settings(self, p: Parameters) -> dict:
        return {"quiet": self.rest_rate * p.nu, "max_steps": self.max_events}

    def settle(self, p: Parameters, y0: State) -> Settled:
        """Follow the motion from `y0` at tau = 0 until it repeats or rests for good."""
        plant = Plant(p)
        phase = jnp.zeros_like(p.xi)

        def one_period(y: State, mode: Mode) -> Period:
            begun = start(plant, mode, y, phase)
            m, y = advance(plant, begun, p.period, watch_bob=True, **self._settings(p))
            rests, reach = settled_at_rest(plant, m)
            rests = rests & jnp.all(jnp.isfinite(y))
            steady = jnp.stack([phase, plant.swing[1], phase, p.xi * plant.swing[0]])
            y = jnp.where(rests & (p.zeta > 0), steady, y)
            exhausted = m.steps >= self.max_events
            amplitude = jnp.where(rests, 0.0, m.amplitude)
            stroke = jnp.where(rests, reach, m.stroke)
            return Period(y, m.mode, amplitude, stroke, rests, m.lost, exhausted)

        mode = classify(plant, y0, phase)
        return settle(one_period, p, y0, mode, tolerance=self.tolerance, max_periods=self.max_periods)

    def cycle(self, p: Parameters, settled: Settled, y: State) -> Cycle:
        """Run the orbit's periods from `y`; derivatives pass through every event."""
        plant = Plant(p)
        phase = jnp.zeros_like(p.xi)
        zero = jnp.zeros_like(y[0])

        def one_period(_: Array, carry: tuple) -> tuple:
            y, mode, amplitude, stroke = carry
            m = start(plant, mode, y, phase)
            m, y = advance(plant, m, p.period, watch_bob=True, **self._settings(p))
            return y, m.mode, jnp.maximum(amplitude, m.amplitude), jnp.maximum(stroke, m.stroke)

        first = (y, settled.memory, zero, zero)
        y, _, amplitude, stroke = jax.lax.fori_loop(0, settled.periods, one_period, first)
        return Cycle(y, amplitude, stroke)

    def trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """The exact states at `times`, from `y0` at `times[0]`."""
        plant = Plant(p)

        def leg(carry: tuple, interval: Float[Array, "2"]) -> tuple[tuple, State]:
            y, mode, lost, exhausted = carry
            begin, end = interval
            m = start(plant, mode, y, p.xi * begin)
            bound = (self.max_events * (1.0 + (end - begin) / p.period)).astype(int)
            m, y = advance(plant, m, end - begin, quiet=self.rest_rate * p.nu, max_steps=bound)
            carry = y, m.mode, lost | m.lost, exhausted | (m.steps >= bound)
            return carry, jnp.where(carry[2] | carry[3], jnp.nan, y)

        no = jnp.zeros((), bool)
        first = (y0, classify(plant, y0, jnp.sin(p.xi * times[0])), no, no)
        intervals = jnp.stack([times[:-1], times[1:]], axis=1)
        (_, _, lost, exhausted), ys = jax.lax.scan(leg, first, intervals)
        status = Status.where(lost, Status.overturned, Status.rocking)
        status = Status.where(exhausted, Status.event_bound, status)
        return jnp.concatenate([y0[None], ys]), status
