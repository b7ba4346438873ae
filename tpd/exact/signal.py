"""Signals: quantities along a closed-form arc, and their derivatives in time.

An angle on an arc is a constant, a combination of the free motion's four exponentials, and the response to
the forcing. Its derivatives are of the same form, and so is everything linear in the two angles, such as the
moment on a held block.

Everything is written in numbers, not in small vectors and matrices: in a batch such arithmetic
fuses into few loops, and products of 4 x 4 matrices do not.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from tpd.core.parameters import Number
from tpd.exact.modes import Rates
from tpd.exact.propagator import Factor, Functional
from tpd.exact.trigonometry import Turn


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
    """A time on an arc: exp(A t) of the free motion, the forcing's phase, and t since the arc's start."""

    flow: Factor
    forcing: Turn
    time: Number = 0.0
    """Needed under growing shaking only."""


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
        """Value at an instant."""
        return self.constant + self.free.of(now.flow) + self.harmonic.at(now.forcing, now.time)

    def rate(self, rates: Rates) -> Signal:
        """Derivative in time."""
        zero = jnp.zeros_like(self.constant)
        return Signal(zero, self.free.rate(rates), self.harmonic.rate(rates.xi))

    def scaled(self, c: Number) -> Signal:
        """The product with a number."""
        return jax.tree.map(lambda x: c * x, self)

    def plus(self, other: Signal) -> Signal:
        """The sum of two signals."""
        return jax.tree.map(lambda a, b: a + b, self, other)


def constant(value: Number, growth: Growth | None = None) -> Signal:
    """A signal that does not change, among others of an arc under such shaking."""
    zero = jnp.zeros_like(value)
    gain = None if growth is None else Gain(zero, zero)
    return Signal(value, Functional(zero, zero, zero, zero), Harmonic(zero, zero, gain))
