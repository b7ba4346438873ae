"""One closed-form arc: the motion between two events, and the signals that end it.

Everything is written in numbers, not in small vectors and matrices: in a batch such arithmetic
fuses into few loops, and products of 4 x 4 matrices do not.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from tpd.core.parameters import Number, Numbers, State
from tpd.exact.contact import REST, SLIP, STICK, Mode, captured_restitution, decide, impact_jump, released
from tpd.exact.modes import Plant, Rates
from tpd.exact.propagator import Functional, exponential
from tpd.exact.signal import Gain, Growth, Harmonic, Instant, Signal, constant
from tpd.exact.trigonometry import Turn, turn


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
    return _decided(plant, y, sine, jnp.sign(y[0]), jnp.sign(y[2]))


def _decided(plant: Plant, y: State | Numbers, sine: Number, tilt_sign: Number, rate_sign: Number) -> Mode:
    """The mode of a state with these signs of phi and phi'."""
    linear = plant.linear
    moment = linear.holding_moment(y, sine)
    on_base = tilt_sign == 0.0
    up = moment - jnp.where(on_base, 1.0, tilt_sign) * linear.weight
    down = jnp.where(on_base, moment + linear.weight, up)
    return decide(up, down, linear.friction, tilt_sign, rate_sign)


def held_on_base(plant: Plant, y: State | Numbers, sine: Number) -> Bool[Array, ""]:
    """Whether weight and friction would hold the block of state `y` at phi = 0 if it did not move."""
    zero = jnp.zeros_like(y[0])
    return _decided(plant, (zero, y[1], zero, y[3]), sine, zero, zero).kind == REST


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
    # The state less balance and response is free motion: its parts along the two real modes are projections,
    # and the rest belongs to the pair, whose `Functional` is (value, rate) at the start.
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
    # While the block moves outward phi cannot vanish before phi' does, and a tilt is monotone between zeros
    # of its rate. So phi is watched on the way back only, and a signal that begins at zero (the tilt after a
    # crossing) is never taken for an event. A held block needs both limits of friction, one for either
    # direction.
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
    plant: Plant, mode: Mode, y: Numbers, sine: Number, which: Int[Array, ""], capture_speed: Number
) -> tuple[Mode, Numbers]:
    """The mode and state after the event that ended an arc.

    `which` is 0 or 1, the signal that vanished. An impact slower than `capture_speed` counts as rest if
    the block can be held there: this is how rattling without end is captured.
    """
    turned = _after_turn(plant, mode, y, sine, capture_speed)
    landed = _after_landing(plant, mode, y, sine, capture_speed)
    first = which == 0
    freed = released(mode, jnp.where(first, 1.0, -1.0)), y
    branch = jnp.where(mode.kind == SLIP, jnp.where(first, 0, 1), 2)
    return jax.tree.map(
        lambda a, b, c: jnp.where(branch == 0, a, jnp.where(branch == 1, b, c)), turned, landed, freed
    )


def _after_turn(
    plant: Plant, mode: Mode, y: Numbers, sine: Number, capture_speed: Number
) -> tuple[Mode, Numbers]:
    # A turn this low belongs to hops slower than the capture speed, whose height is of its square.
    zero, on_base = jnp.zeros_like(y[2]), jnp.abs(y[0]) <= capture_speed**2
    y = (jnp.where(on_base, 0.0, y[0]), y[1], zero, y[3])
    return _decided(plant, y, sine, jnp.where(on_base, 0.0, mode.tilt_sign), zero), y


def _after_landing(
    plant: Plant, mode: Mode, y: Numbers, sine: Number, capture_speed: Number
) -> tuple[Mode, Numbers]:
    zero = jnp.zeros_like(y[0])
    rests = (jnp.abs(y[2]) <= capture_speed) & held_on_base(plant, y, sine)
    e = captured_restitution(plant.restitution, rests)
    y = (zero, y[1], *_impact(plant, e, y))
    # A block that an impact stops (e = 0) goes where the moment on it takes it.
    stopped = _decided(plant, y, sine, zero, zero)
    onward = Mode(jnp.where(rests, REST, SLIP), mode.rate_sign, mode.rate_sign)
    return jax.tree.map(lambda a, b: jnp.where(y[2] == 0.0, a, b), stopped, onward), y


def _impact(plant: Plant, e: Number, y: Numbers) -> tuple[Number, Number]:
    block, bob = impact_jump((e - 1.0) * y[2], plant.length_ratio)
    # e = 1 leaves the rate as it is and e = 0 makes it 0, both to the last digit.
    return y[2] + block, y[3] + bob
