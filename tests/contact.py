"""The decision between slip, stick and rest, and how events are met, in JAX: for the second opinion of
`tests.segmented`. The package has these rules in `tpd.exact.contact_kernel`."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Float, Int

from tpd.exact.terms import REST, SLIP, STICK
from tpd.scene.pytrees import Number, State
from tpd.theory.equations import Equations, Linear, Terms


def matrices(linear: Linear) -> tuple[np.ndarray, ...]:
    """Mass, damping and stiffness matrices of (25)."""
    mass = [[linear.m11, linear.m12], [linear.m21, linear.m22]]
    damping = [[linear.c1, -linear.c1], [-linear.c2, linear.c2]]
    return tuple(np.array(x, dtype=float) for x in (mass, damping, [[-linear.tilt, 0.0], [0.0, 1.0]]))


def held_rates(of: Equations, y: State, sine: Number) -> State:
    """Derivative d/dtau of the state of a block that is held: only the bob moves."""
    psi, linear = y[1], of.linear
    whole = of.terms is Terms.nonlinear
    pull = linear.f * jnp.cos(psi) * sine - jnp.sin(psi) if whole else linear.f * sine - psi
    pull = (pull - linear.c2 * y[3]) / linear.m22
    return jnp.stack([jnp.zeros_like(pull), y[3], jnp.zeros_like(pull), pull])


def excess(of: Equations, y: State, step: Number, sine: Number) -> Number:
    """Moment on a held block minus the moment of its weight. It stays held while this is within the
    friction. At phi = 0 weight acts against lifting to either side: `step` is the side."""
    linear, pull, bob, lean = of.linear, held_rates(of, y, sine)[3], of.p.mu * of.rho * of.p.lam, y[0] - y[1]
    if of.terms is Terms.nonlinear:
        sin, cos = jnp.sin(y[0]), jnp.cos(y[0])
        big_s = step * of.p.nu * jnp.sin(lean) + 2.0 * jnp.cos(lean)
        big_c = step * of.p.nu * jnp.cos(lean) - 2.0 * jnp.sin(lean)
        shaken = linear.f * sine * (step * linear.weight * sin + linear.tilt * cos)
        weight = linear.tilt * sin - step * linear.weight * cos
        return weight - shaken - bob * big_c * y[3] ** 2 + linear.c1 * y[3] + bob * big_s * pull
    moment = linear.tilt * y[0] - linear.f * linear.tilt * sine - linear.m12 * pull + linear.c1 * y[3]
    if of.terms is Terms.parametric:
        moment = moment - step * linear.f * linear.weight * y[0] * sine
    return moment - step * linear.weight


class Mode(eqx.Module):
    """The discrete state: slip, stick or rest, with the signs of the tilt and of its rate."""

    kind: Int[Array, ""]
    tilt_sign: Float[Array, ""]
    """Sign of phi; without meaning at rest."""
    rate_sign: Float[Array, ""]
    """Sign of phi'; without meaning on a held block."""

    def equals(self, other: Mode) -> Bool[Array, ""]:
        """Whether both are the same, signs without meaning left aside."""
        tilts = (self.kind == REST) | (self.tilt_sign == other.tilt_sign)
        turns = (self.kind != SLIP) | (self.rate_sign == other.rate_sign)
        return (self.kind == other.kind) & tilts & turns


def decide(up: Number, down: Number, friction: Number, tilt_sign: Number, rate_sign: Number) -> Mode:
    """The mode of a state.

    Args:
        up: moment on the held block less what its weight balances against a move to positive tilt.
        down: the same against a move to negative tilt; off the base both are equal.
        friction: largest moment of friction.
        tilt_sign: sign of phi, 0 on the base.
        rate_sign: sign of phi', 0 at a turn.
    """
    # A block that does not move stays where it is as long as friction balances the excess. On its base it has
    # an excess for either direction, because weight resists both: it rests while -k <= down and up <= k,
    # which in the linear equations is |R| <= (1 + mu) nu + k.
    lifts = jnp.where(up > friction, 1.0, jnp.where(down < -friction, -1.0, 0.0))
    goes = jnp.where(rate_sign != 0, rate_sign, lifts)
    kind = jnp.where(goes != 0, SLIP, jnp.where(tilt_sign != 0, STICK, REST))
    # From the base the block tilts to the side to which it goes.
    return Mode(kind, stop_gradient(jnp.where(tilt_sign != 0, tilt_sign, goes)), stop_gradient(goes))


def released(before: Mode, side: Number) -> Mode:
    """The mode after friction at its limit lets a held block go to `side`, which is +1 or -1."""
    # The moment is at the limit up to rounding, so that `decide` could hold the block once more. The signal
    # that vanished says which limit it is.
    tilt_sign = jnp.where(before.kind == REST, side, before.tilt_sign)
    return Mode(jnp.full_like(before.kind, SLIP), tilt_sign, jnp.asarray(side))


def transversality_of(
    before: Mode,
    after: Mode,
    turn: Number,
    crossing: Number,
    free: Bool[Array, ""],
    usual: tuple[Number, Number],
) -> Number:
    """How transversally a slipping block meets an event, over what is usual; infinite for other events.

    Args:
        before, after: modes before and after the event.
        turn: phi'' at a turn, infinite at another event.
        crossing: phi' at a crossing of phi = 0, infinite at another event.
        free: whether the moment at the crossing would lift a block at rest.
        usual: sizes of phi'' and of phi'.
    """
    # The derivative of an event's time has this rate as its denominator: where it vanishes the motion grazes.
    # A crossing after which the block could be held is one of the hops of a rattle. These are as slow as one
    # likes on every orbit that comes to rest, and say nothing about grazing.
    pull, rate = usual
    met = jnp.minimum(jnp.abs(turn) / pull, jnp.where(free, jnp.abs(crossing) / rate, jnp.inf))
    return stop_gradient(jnp.where((before.kind == SLIP) & (after.kind == SLIP), met, jnp.inf))
