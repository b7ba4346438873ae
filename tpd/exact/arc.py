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


class Growth(NamedTuple):
    """Shaking that grows linearly: f (share + rate t) sin(...), t from the arc's start."""

    share: Number
    """Share of its full size at the arc's start."""
    rate: Number
    """Increase of the share per unit tau; 0 once the shaking is steady."""

    def after(self, t: Number) -> Growth:
        """The growth counted from a later time."""
        return Growth(self.share + self.rate * t, self.rate)


class Instant(NamedTuple):
    """A time on an arc: what the free motion has become since its start, the forcing's phase, and the
    time since the start."""

    flow: Factor
    forcing: Turn
    time: Number


class Gain(NamedTuple):
    """Increase of a harmonic's two amplitudes per unit tau."""

    along: Number
    across: Number


class Harmonic(NamedTuple):
    """along sin + across cos of the forcing's phase; under growing shaking both change linearly in time."""

    along: Number
    across: Number
    gain: Gain | None = None
    """None under steady shaking, where it costs nothing."""

    def amplitudes(self, time: Number) -> tuple[Number, Number]:
        """The factors of sin and cos at a time on the arc."""
        if self.gain is None:
            return self.along, self.across
        return self.along + self.gain.along * time, self.across + self.gain.across * time

    def at(self, forcing: Turn, time: Number) -> Number:
        """Value at a phase and a time on the arc."""
        along, across = self.amplitudes(time)
        return along * forcing.sine + across * forcing.cosine

    def rate(self, xi: Number) -> Harmonic:
        """Derivative in time."""
        along, across = -xi * self.across, xi * self.along
        if self.gain is None:
            return Harmonic(along, across)
        a, c = self.gain
        return Harmonic(along + a, across + c, Gain(-xi * c, xi * a))

    def bound(self, time: Number, window: Number) -> Number:
        """Largest value from `time` until `window` later: the amplitude is a convex function of time, so
        that it is largest at an end."""
        along, across = self.amplitudes(time)
        now = jnp.sqrt(along**2 + across**2)
        if self.gain is None:
            return now
        along, across = self.amplitudes(time + window)
        return jnp.maximum(now, jnp.sqrt(along**2 + across**2))


class Signal(NamedTuple):
    """A quantity along an arc: a constant, a function of the free motion, and one harmonic."""

    constant: Number
    free: Functional
    harmonic: Harmonic

    def at(self, now: Instant) -> Number:
        """Its value."""
        return self.constant + self.free.of(now.flow) + self.harmonic.at(now.forcing, now.time)

    def rate(self, rates: Rates) -> Signal:
        """Its derivative in time."""
        zero = jnp.zeros_like(self.constant)
        return Signal(zero, self.free.rate(rates), self.harmonic.rate(rates.xi))

    def scaled(self, c: Number) -> Signal:
        """c times it."""
        return jax.tree.map(lambda x: c * x, self)

    def plus(self, other: Signal) -> Signal:
        """The sum of two."""
        return jax.tree.map(lambda a, b: a + b, self, other)


def constant(value: Number, growth: Growth | None = None) -> Signal:
    """A signal that does not change, among others of an arc under such shaking."""
    zero = jnp.zeros_like(value)
    gain = None if growth is None else Gain(zero, zero)
    return Signal(value, Functional(zero, zero, zero, zero), Harmonic(zero, zero, gain))


class Arc(eqx.Module):
    """The two angles from the arc's start on, its time scales, and the forcing's phase there."""

    tilt: Signal
    bob: Signal
    rates: Rates
    phase: Number
    growth: Growth | None = None
    """None under steady shaking."""

    def at(self, t: Number) -> Instant:
        """The instant at local time `t`."""
        return Instant(exponential(self.rates, t), turn(self.phase + self.rates.xi * t), t)

    def shaken(self, sine: Number, t: Number) -> Number:
        """The forcing at local time `t`, over its full size, where its sine is known."""
        return sine if self.growth is None else sine * self.growth.after(t).share

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
    |R - s (1 + mu) nu| <= k. `sine` is the forcing over its full size."""
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


def launch(plant: Plant, mode: Mode, y: State | Numbers, phase: Number, growth: Growth | None = None) -> Arc:
    """The arc that leaves state `y` in `mode`, the forcing being sin(phase + xi t) or, where it grows,
    (share + rate t) times that."""
    slipping, forcing = mode.kind == SLIP, turn(phase)
    slip, held = _slip(plant, mode, y, forcing, growth), _held(plant, mode, y, forcing, growth)
    tilt, bob = jax.tree.map(lambda a, b: jnp.where(slipping, a, b), slip, held)
    rates = Rates(*(jnp.where(slipping, a, b) for a, b in zip(plant.slip, plant.held, strict=True)))
    return Arc(tilt, bob, rates, phase, growth)


def _forced(response: Array, lag: Array, growth: Growth | None) -> Harmonic:
    """The response to the forcing: H(i xi) is `response` and dH/ds there is `lag`, and the response to
    (share + rate t) exp(s t) is ((share + rate t) H + rate dH/ds) exp(s t)."""
    (s, c), (ls, lc) = response, lag
    if growth is None:
        return Harmonic(s, c)
    share, rate = growth
    return Harmonic(share * s + rate * ls, share * c + rate * lc, Gain(rate * s, rate * c))


def _slip(
    plant: Plant, mode: Mode, y: State | Numbers, forcing: Turn, growth: Growth | None
) -> tuple[Signal, Signal]:
    linear, zero = plant.linear, jnp.zeros_like(y[0])
    load = mode.tilt_sign * linear.weight + mode.rate_sign * linear.friction
    balance = load / linear.tilt
    tilt, bob = (_forced(plant.response[i], plant.response_lag[i], growth) for i in range(2))
    free = (
        y[0] - balance - tilt.at(forcing, zero),
        y[1] - bob.at(forcing, zero),
        y[2] - tilt.rate(linear.xi).at(forcing, zero),
        y[3] - bob.rate(linear.xi).at(forcing, zero),
    )
    first = sum(plant.falling.left[i] * free[i] for i in range(4))
    second = sum(plant.rising.left[i] * free[i] for i in range(4))
    a, b = plant.falling.shape, plant.rising.shape
    pair = [free[i] - first * a[i] - second * b[i] for i in range(4)]
    return (
        Signal(balance, Functional(first * a[0], second * b[0], pair[0], pair[2]), tilt),
        Signal(zero, Functional(first * a[1], second * b[1], pair[1], pair[3]), bob),
    )


def _held(
    plant: Plant, mode: Mode, y: State | Numbers, forcing: Turn, growth: Growth | None
) -> tuple[Signal, Signal]:
    zero = jnp.zeros_like(y[0])
    bob = _forced(plant.swing, plant.swing_lag, growth)
    free = y[1] - bob.at(forcing, zero)
    rate = y[3] - bob.rate(plant.linear.xi).at(forcing, zero)
    tilt = constant(jnp.where(mode.kind == REST, 0.0, y[0]), growth)
    return tilt, Signal(zero, Functional(zero, zero, free, rate), bob)


def ending(plant: Plant, mode: Mode, arc: Arc) -> tuple[Signal, Signal]:
    """The two signals, positive inside the arc, that end it when they reach zero. Slip: the rate, and
    the tilt if it is falling back to the base; moving outward, the tilt cannot return before the
    rate vanishes. Held: the distance of the moment to either limit."""
    linear = plant.linear
    one, growth = jnp.ones_like(arc.phase), arc.growth
    inward = mode.tilt_sign * mode.rate_sign < 0
    rate = arc.tilt.rate(arc.rates).scaled(mode.rate_sign)
    falling = arc.tilt.scaled(mode.tilt_sign)
    tilt = jax.tree.map(lambda a, b: jnp.where(inward, a, b), falling, constant(one, growth))
    stuck = mode.kind == STICK
    moment = arc.bob.scaled(1.0 - linear.tilt).plus(arc.bob.rate(arc.rates).scaled(linear.bias))
    # The forcing itself: -f sin, or -f (share + rate t) sin.
    forcing, zero = Harmonic(-linear.f, jnp.zeros_like(one)), jnp.zeros_like(one)
    if growth is not None:
        forcing = Harmonic(-linear.f * growth.share, zero, Gain(-linear.f * growth.rate, zero))
    moment = moment._replace(harmonic=jax.tree.map(lambda a, b: a + b, moment.harmonic, forcing))
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
