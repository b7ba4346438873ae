"""One closed-form arc: the motion between two events, and the signals that end it."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from tpd.exact.spectrum import Basis, Plant, Rates, Rows
from tpd.parameters import Number, State

SLIP, STICK, REST = 0, 1, 2


class Mode(eqx.Module):
    """The discrete state: slip, stick or rest, with the signs of the tilt and of its rate."""

    kind: Int[Array, ""]
    tilt_sign: Float[Array, ""]
    rate_sign: Float[Array, ""]


class Arc(eqx.Module):
    """Coefficients over the seven basis functions of the state and of the three signals.

    `rows[:4]` is the state (phi, psi, phi', psi'). Of the signals, positive inside the arc,
    `rows[4]` and `rows[5]` end it when they reach zero (see `ends`); `rows[6]` is the bob's
    rate, whose zeros are turning points of the bob and change nothing else.
    """

    rows: Rows
    rates: Rates
    phase: Number

    def basis(self, t: Number) -> Basis:
        """The basis functions at local time `t`."""
        return self.rates.basis(t, self.phase)


def classify(plant: Plant, y: State, sine: Number) -> Mode:
    """The mode that a state starts in, from its signs and, where they vanish, from the moment
    R on the held block: at rest while |R| <= (1 + mu) nu + k, stuck while
    |R - s (1 + mu) nu| <= k."""
    linear = plant.linear
    moment = linear.holding_moment(y, sine)
    on_base, turning = y[0] == 0.0, y[2] == 0.0
    tilt_sign = jnp.where(on_base, jnp.where(turning, jnp.sign(moment), jnp.sign(y[2])), jnp.sign(y[0]))
    excess = moment - jnp.where(on_base, 0.0, tilt_sign * linear.weight)
    hold = linear.friction + jnp.where(on_base, linear.weight, 0.0)
    held = turning & (jnp.abs(excess) <= hold)
    kind = jnp.where(held, jnp.where(on_base, REST, STICK), SLIP)
    rate_sign = jnp.where(turning, jnp.sign(excess), jnp.sign(y[2]))
    return Mode(kind, jax.lax.stop_gradient(tilt_sign), jax.lax.stop_gradient(rate_sign))


def launch(plant: Plant, mode: Mode, y: State, phase: Number) -> Arc:
    """The arc that leaves state `y` in `mode`, the forcing being sin(phase + xi t)."""
    slipping = mode.kind == SLIP
    slip, held = _slip_rows(plant, mode, y, phase), _held_rows(plant, mode, y, phase)
    state = jnp.where(slipping, slip, held)
    rates = Rates(*(jnp.where(slipping, a, b) for a, b in zip(plant.slip, plant.held, strict=True)))
    a, b = _signals(plant, mode, state)
    return Arc(jnp.concatenate([state, a[None], b[None], state[3:]]), rates, phase)


def _slip_rows(plant: Plant, mode: Mode, y: State, phase: Number) -> Rows:
    linear, zero = plant.linear, jnp.zeros_like(phase)
    load = mode.tilt_sign * linear.weight + mode.rate_sign * linear.friction
    constant = jnp.stack([load / linear.tilt, zero, zero, zero])
    sine, cosine = plant.response[:, 0], plant.response[:, 1]
    sine = jnp.concatenate([sine, -linear.xi * cosine])
    cosine = jnp.concatenate([cosine, linear.xi * sine[:2]])
    free = y - constant - sine * jnp.sin(phase) - cosine * jnp.cos(phase)
    falling = (plant.falling.left @ free) * plant.falling.shape
    rising = (plant.rising.left @ free) * plant.rising.shape
    pair = free - falling - rising
    turn = linear.rates(pair, zero, zero, zero)
    return jnp.stack([constant, falling, rising, pair, turn, sine, cosine], axis=-1)


def _held_rows(plant: Plant, mode: Mode, y: State, phase: Number) -> Rows:
    zero, xi = jnp.zeros_like(phase), plant.linear.xi
    s, c = plant.swing
    sine, cosine = jnp.stack([zero, s, zero, -xi * c]), jnp.stack([zero, c, zero, xi * s])
    free = jnp.stack([zero, y[1], zero, y[3]]) - sine * jnp.sin(phase) - cosine * jnp.cos(phase)
    turn = jnp.stack([zero, free[3], zero, -plant.held.q * free[1] - plant.held.p * free[3]])
    tilt = jnp.where(mode.kind == REST, 0.0, y[0])
    constant = jnp.stack([tilt, zero, zero, zero])
    none = jnp.zeros_like(constant)
    return jnp.stack([constant, none, none, free, turn, sine, cosine], axis=-1)


def _signals(plant: Plant, mode: Mode, state: Rows) -> tuple[Basis, Basis]:
    """The two ending signals. Slip: the rate, and the tilt if it is falling back to the base;
    moving outward, the tilt cannot return before the rate vanishes. Held: the distance of the
    moment to either limit."""
    linear = plant.linear
    one = jnp.zeros(7).at[0].set(1.0)
    sine = jnp.zeros(7).at[5].set(1.0)
    inward = mode.tilt_sign * mode.rate_sign < 0
    rate = mode.rate_sign * state[2]
    tilt = jnp.where(inward, mode.tilt_sign * state[0], one)
    moment = linear.tilt * state[0] - linear.f * sine
    moment = moment - (linear.tilt - 1.0) * state[1] + linear.bias * state[3]
    stuck = mode.kind == STICK
    excess = moment - jnp.where(stuck, mode.tilt_sign * linear.weight, 0.0) * one
    hold = (linear.friction + jnp.where(stuck, 0.0, linear.weight)) * one
    slipping = mode.kind == SLIP
    return jnp.where(slipping, rate, hold - excess), jnp.where(slipping, tilt, hold + excess)


def ends(
    plant: Plant, mode: Mode, y: State, sine: Number, which: Int[Array, ""], quiet: Number
) -> tuple[Mode, State]:
    """The mode and state after the event that ended an arc.

    `which` is 0 or 1, the signal that vanished. An impact slower than `quiet` counts as rest if
    the block can be held there: this is how rattling without end is captured.
    """
    turned, landed = _after_turn(plant, mode, y, sine, quiet), _after_landing(plant, mode, y, sine, quiet)
    freed = _after_release(mode, y, which)
    first = which == 0
    branch = jnp.where(mode.kind == SLIP, jnp.where(first, 0, 1), 2)
    return jax.tree.map(
        lambda a, b, c: jnp.where(branch == 0, a, jnp.where(branch == 1, b, c)), turned, landed, freed
    )


def _after_turn(plant: Plant, mode: Mode, y: State, sine: Number, quiet: Number) -> tuple[Mode, State]:
    on_base = jnp.abs(y[0]) <= quiet**2
    y = jnp.stack([jnp.where(on_base, 0.0, y[0]), y[1], jnp.zeros_like(y[2]), y[3]])
    after = classify(plant, y, sine)
    tilt_sign = jnp.where(on_base, after.tilt_sign, mode.tilt_sign)
    return Mode(after.kind, tilt_sign, after.rate_sign), y


def _after_landing(plant: Plant, mode: Mode, y: State, sine: Number, quiet: Number) -> tuple[Mode, State]:
    linear = plant.linear
    held = linear.holding_moment(y.at[2].set(0.0), sine)
    holds = jnp.abs(held) <= linear.weight + linear.friction
    rests = (jnp.abs(y[2]) <= quiet) & holds
    # A rattle's remaining hops take the block's rate to zero and give the bob what a perfectly
    # plastic impact would, up to the square of the rate.
    e = jnp.where(rests, 0.0, plant.restitution)
    kick = (2.0 / plant.length_ratio) * (e - 1.0) * y[2]
    y = jnp.stack([jnp.zeros_like(y[0]), y[1], e * y[2], y[3] + kick])
    return Mode(jnp.where(rests, REST, SLIP), mode.rate_sign, mode.rate_sign), y


def _after_release(mode: Mode, y: State, which: Int[Array, ""]) -> tuple[Mode, State]:
    rate_sign = jnp.where(which == 0, 1.0, -1.0)
    tilt_sign = jnp.where(mode.kind == REST, rate_sign, mode.tilt_sign)
    return Mode(jnp.full_like(mode.kind, SLIP), tilt_sign, rate_sign), y
