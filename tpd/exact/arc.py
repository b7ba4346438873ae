"""One closed-form arc: the motion between two events, and the signals that end it.

Everything is written in numbers, not in small vectors and matrices: in a batch such arithmetic
fuses into few loops, and products of 4 x 4 matrices do not.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from tpd.core.parameters import Number, Numbers, State
from tpd.exact.modes import Plant, Rates
from tpd.exact.propagator import Factor, Functional, exponential
from tpd.exact.trigonometry import Turn, turn

SLIP, STICK, REST = 0, 1, 2


class Mode(eqx.Module):
    """The discrete state: slip, stick or rest, with the signs of the tilt and of its rate."""

    kind: Int[Array, ""]
    tilt_sign: Float[Array, ""]
    rate_sign: Float[Array, ""]


class Instant(NamedTuple):
    """A time on an arc: what the free motion has become since its start, and the forcing's phase."""

    flow: Factor
    forcing: Turn


class Signal(NamedTuple):
    """A quantity along an arc: a constant, a function of the free motion, and one harmonic."""

    constant: Number
    free: Functional
    along: Number
    across: Number

    def at(self, now: Instant) -> Number:
        """Its value."""
        harmonic = self.along * now.forcing.sine + self.across * now.forcing.cosine
        return self.constant + self.free.of(now.flow) + harmonic

    def rate(self, rates: Rates) -> Signal:
        """Its derivative in time."""
        xi, zero = rates.xi, jnp.zeros_like(self.constant)
        return Signal(zero, self.free.rate(rates), -xi * self.across, xi * self.along)

    def scaled(self, c: Number) -> Signal:
        """c times it."""
        return jax.tree.map(lambda x: c * x, self)

    def plus(self, other: Signal) -> Signal:
        """The sum of two."""
        return jax.tree.map(lambda a, b: a + b, self, other)


def constant(value: Number) -> Signal:
    """A signal that does not change."""
    zero = jnp.zeros_like(value)
    return Signal(value, Functional(zero, zero, zero, zero), zero, zero)


class Arc(eqx.Module):
    """The two angles from the arc's start on, its time scales, and the forcing's phase there."""

    tilt: Signal
    bob: Signal
    rates: Rates
    phase: Number

    def at(self, t: Number) -> Instant:
        """The instant at local time `t`."""
        return Instant(exponential(self.rates, t), turn(self.phase + self.rates.xi * t))

    def state(self, now: Instant, late: Number) -> Numbers:
        """(phi, psi, phi', psi') so little after an instant that two terms of the series will do."""
        signals = [self.tilt, self.bob]
        for _ in range(4):
            signals.append(signals[-2].rate(self.rates))
        at = [s.at(now) for s in signals]
        return at[0] + late * at[2], at[1] + late * at[3], at[2] + late * at[4], at[3] + late * at[5]


def classify(plant: Plant, y: State | Numbers, sine: Number) -> Mode:
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


def launch(plant: Plant, mode: Mode, y: State | Numbers, phase: Number) -> Arc:
    """The arc that leaves state `y` in `mode`, the forcing being sin(phase + xi t)."""
    slipping, forcing = mode.kind == SLIP, turn(phase)
    slip, held = _slip(plant, mode, y, forcing), _held(plant, mode, y, forcing)
    tilt, bob = jax.tree.map(lambda a, b: jnp.where(slipping, a, b), slip, held)
    rates = Rates(*(jnp.where(slipping, a, b) for a, b in zip(plant.slip, plant.held, strict=True)))
    return Arc(tilt, bob, rates, phase)


def _slip(plant: Plant, mode: Mode, y: State | Numbers, forcing: Turn) -> tuple[Signal, Signal]:
    linear, zero = plant.linear, jnp.zeros_like(y[0])
    load = mode.tilt_sign * linear.weight + mode.rate_sign * linear.friction
    balance = load / linear.tilt
    (s0, c0), (s1, c1) = (plant.response[i] for i in range(2))
    sine, cosine, xi = forcing.sine, forcing.cosine, linear.xi
    free = (
        y[0] - balance - s0 * sine - c0 * cosine,
        y[1] - s1 * sine - c1 * cosine,
        y[2] - xi * (s0 * cosine - c0 * sine),
        y[3] - xi * (s1 * cosine - c1 * sine),
    )
    first = sum(plant.falling.left[i] * free[i] for i in range(4))
    second = sum(plant.rising.left[i] * free[i] for i in range(4))
    a, b = plant.falling.shape, plant.rising.shape
    pair = [free[i] - first * a[i] - second * b[i] for i in range(4)]
    return (
        Signal(balance, Functional(first * a[0], second * b[0], pair[0], pair[2]), s0, c0),
        Signal(zero, Functional(first * a[1], second * b[1], pair[1], pair[3]), s1, c1),
    )


def _held(plant: Plant, mode: Mode, y: State | Numbers, forcing: Turn) -> tuple[Signal, Signal]:
    zero, xi = jnp.zeros_like(y[0]), plant.linear.xi
    s, c = plant.swing[0], plant.swing[1]
    free = y[1] - s * forcing.sine - c * forcing.cosine
    rate = y[3] - xi * (s * forcing.cosine - c * forcing.sine)
    tilt = constant(jnp.where(mode.kind == REST, 0.0, y[0]))
    return tilt, Signal(zero, Functional(zero, zero, free, rate), s, c)


def ending(plant: Plant, mode: Mode, arc: Arc) -> tuple[Signal, Signal]:
    """The two signals, positive inside the arc, that end it when they reach zero. Slip: the rate, and
    the tilt if it is falling back to the base; moving outward, the tilt cannot return before the
    rate vanishes. Held: the distance of the moment to either limit."""
    linear = plant.linear
    one = jnp.ones_like(arc.phase)
    inward = mode.tilt_sign * mode.rate_sign < 0
    rate = arc.tilt.rate(arc.rates).scaled(mode.rate_sign)
    falling = arc.tilt.scaled(mode.tilt_sign)
    tilt = jax.tree.map(lambda a, b: jnp.where(inward, a, b), falling, constant(one))
    stuck = mode.kind == STICK
    moment = arc.bob.scaled(1.0 - linear.tilt).plus(arc.bob.rate(arc.rates).scaled(linear.bias))
    moment = moment._replace(along=moment.along - linear.f)
    level = linear.tilt * arc.tilt.constant - jnp.where(stuck, mode.tilt_sign * linear.weight, 0.0)
    hold = linear.friction + jnp.where(stuck, 0.0, linear.weight)
    below = moment.scaled(-1.0)._replace(constant=hold - level)
    above = moment._replace(constant=hold + level)
    slipping = mode.kind == SLIP
    return jax.tree.map(lambda a, b: jnp.where(slipping, a, b), (rate, tilt), (below, above))


def ends(
    plant: Plant, mode: Mode, y: Numbers, sine: Number, which: Int[Array, ""], quiet: Number
) -> tuple[Mode, Numbers]:
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


def _after_turn(plant: Plant, mode: Mode, y: Numbers, sine: Number, quiet: Number) -> tuple[Mode, Numbers]:
    on_base = jnp.abs(y[0]) <= quiet**2
    y = (jnp.where(on_base, 0.0, y[0]), y[1], jnp.zeros_like(y[2]), y[3])
    after = classify(plant, y, sine)
    tilt_sign = jnp.where(on_base, after.tilt_sign, mode.tilt_sign)
    return Mode(after.kind, tilt_sign, after.rate_sign), y


def _after_landing(plant: Plant, mode: Mode, y: Numbers, sine: Number, quiet: Number) -> tuple[Mode, Numbers]:
    linear = plant.linear
    still = (y[0], y[1], jnp.zeros_like(y[2]), y[3])
    held = linear.holding_moment(still, sine)
    holds = jnp.abs(held) <= linear.weight + linear.friction
    rests = (jnp.abs(y[2]) <= quiet) & holds
    # A rattle's remaining hops take the block's rate to zero and give the bob what a perfectly
    # plastic impact would, up to the square of the rate.
    e = jnp.where(rests, 0.0, plant.restitution)
    kick = (2.0 / plant.length_ratio) * (e - 1.0) * y[2]
    y = (jnp.zeros_like(y[0]), y[1], e * y[2], y[3] + kick)
    # A block that an impact stops (e = 0) goes where the moment on it takes it.
    stopped = classify(plant, y, sine)
    onward = Mode(jnp.where(rests, REST, SLIP), mode.rate_sign, mode.rate_sign)
    return jax.tree.map(lambda a, b: jnp.where(y[2] == 0.0, a, b), stopped, onward), y


def _after_release(mode: Mode, y: Numbers, which: Int[Array, ""]) -> tuple[Mode, Numbers]:
    rate_sign = jnp.where(which == 0, 1.0, -1.0)
    tilt_sign = jnp.where(mode.kind == REST, rate_sign, mode.tilt_sign)
    return Mode(jnp.full_like(mode.kind, SLIP), tilt_sign, rate_sign), y
