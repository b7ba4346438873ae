"""Long times in whole forcing periods and a remainder.

The forcing repeats, so a motion needs its phase modulo 2 pi only. The phase xi tau itself loses a digit
with every tenfold tau, and thresholds on event signals that are exact at tau = 0 would meet that loss.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Float

from tpd.scene.parameters import Number, Parameters, State
from tpd.scene.status import Status

_ROUNDING = 1e-10
"""Share of a period by which a time may lie before the beginning of the period that it counts to, so that
a time that rounding has put just before a period's end needs no leg of its own."""

Leg = Callable[[State, Any, Number, Number], tuple[State, Any, Status]]
"""(state, memory, begin, end) to (state, memory, status) at `end`: times since the beginning of a period, at
most one period; the status is rocking if all went well."""


def split(p: Parameters, times: Float[Array, "times"]) -> tuple[Float[Array, "times"], Float[Array, "times"]]:
    """Whole forcing periods before `times`, and the times since, with all derivatives of the times and of
    the period."""
    # Reduced by an integer number of periods, a late time has the phase of an early one to the last digit of
    # the count. The integer has no derivative; times and period keep theirs through the product.
    whole = stop_gradient(jnp.floor(times / p.period + _ROUNDING))
    return whole, times - whole * p.period


def through(
    p: Parameters, y0: State, memory: Any, times: Float[Array, "times"], leg: Leg
) -> tuple[Float[Array, "times 4"], Status]:
    """States at `times`, from `y0` at `times[0]`, in legs that end at each of these and at the end of each
    forcing period. After a leg that did not go well the states are NaN, and its status is returned."""
    whole, since = split(p, times)

    def onward(carry: tuple, target: tuple[Number, Number]) -> tuple[tuple, State]:
        last, end = target

        def going(carry: tuple) -> Array:
            status, arrived = carry[-2:]
            return ~arrived & (status == Status.rocking)

        def piece(carry: tuple) -> tuple:
            count, begin, y, memory, *_ = carry
            arrives = count >= last
            y, memory, status = leg(y, memory, begin, jnp.where(arrives, end, p.period))
            begin = jnp.where(arrives, end, 0.0)
            return jnp.where(arrives, count, count + 1.0), begin, y, memory, status, arrives

        *motion, status, _ = jax.lax.while_loop(going, piece, (*carry, jnp.zeros((), bool)))
        carry = (*motion, status)
        return carry, jnp.where(status == Status.rocking, carry[2], jnp.nan)

    first = (whole[0], since[0], y0, memory, Status.rocking)
    carry, ys = jax.lax.scan(onward, first, (whole[1:], since[1:]))
    return jnp.concatenate([y0[None], ys]), carry[-1]
