"""The scalar equation of the symmetric period-one orbits.

Such an orbit turns at phi > 0 (tau = 0 here, the forcing being sin(xi tau + gamma)), falls through
phi = 0 at tau = t, and half a forcing period h = pi/xi after the turn is its own mirror image,
y(h) = -y(0). Between its turns the system is linear with constant loads, so that for a given t

    y(0) = [1 + exp(A h)]^-1 {(2k/K) e1 - exp(A (h - t)) [(2 w/K) e1 + V d]} + (w - k)/K e1 + harmonic

with K = 1 + 2 mu, w = (1 + mu) nu, e1 the tilt, and V d the jump of the rates in the impact,
d = (0, 0, 1, 2/lam), V = (e - 1) phi'(t-). Turning, phi'(0) = 0, and crossing, phi(t) = 0, are
linear in (sin gamma, cos gamma). The first leaves two values of gamma; the second is then one
equation in t for each.
Where the two values meet, and beyond, the product of both equations is analytic and is used instead.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from tpd.core.parameters import Number
from tpd.exact.contact import impact_jump
from tpd.exact.modes import Plant
from tpd.exact.propagator import Factor, Functional, components, exponential, identity
from tpd.exact.trigonometry import Turn, turn


class Half(eqx.Module):
    """Parts of the equation that depend on the parameters alone.

    As [1 + exp(A h)]^-1 is part of everything, it is part of the functionals.
    """

    plant: Plant
    span: Number
    """h, half a forcing period."""
    whole: Factor
    """exp(A h)"""
    unit: tuple[Functional, ...]
    """The components of g(A) [1 + exp(A h)]^-1 e1, a unit of tilt."""
    kick: tuple[Functional, ...]
    """The components of g(A) [1 + exp(A h)]^-1 d, a unit of impact."""

    def __init__(self, plant: Plant) -> None:
        rates = plant.slip
        self.plant = plant
        self.span = jnp.pi / plant.linear.xi
        self.whole = exponential(rates, self.span)
        closing = self.whole.plus(identity(self.span)).inverse(rates)
        zero, one = jnp.zeros_like(self.span), jnp.ones_like(self.span)
        unit = components(plant, jnp.stack([one, zero, zero, zero]))
        kick = components(plant, jnp.stack([zero, zero, *impact_jump(one, plant.length_ratio)]))
        self.unit = tuple(x.after(closing, rates) for x in unit)
        self.kick = tuple(x.after(closing, rates) for x in kick)

    @property
    def step(self) -> Number:
        """The jump of the balance tilt at the crossing, 2 w/K."""
        return 2.0 * self.plant.linear.weight / self.plant.linear.tilt

    @property
    def slack(self) -> Number:
        """The jump of the balance tilt at a turn, 2 k/K."""
        return 2.0 * self.plant.linear.friction / self.plant.linear.tilt

    def harmonic(self, forcing: Turn, row: int) -> tuple[Number, Number]:
        """The harmonic response of phi or psi (row 0 or 1) once the forcing has turned by so much,
        as factors of sin gamma and cos gamma."""
        along, across = self.plant.response[row, 0], self.plant.response[row, 1]
        cosine, sine = forcing
        return along * cosine - across * sine, along * sine + across * cosine


class Crossing(NamedTuple):
    """A crossing time, by what has happened until then and what is left."""

    flow: Factor
    """exp(A t)"""
    rest: Factor
    """exp(A (h - t))"""
    forcing: Turn
    """By xi t."""


@jax.jit
def crossing(half: Half, t: Number) -> Crossing:
    """The crossing at time `t`."""
    rates = half.plant.slip
    forcing = turn(half.plant.linear.xi * t)
    return Crossing(exponential(rates, t), exponential(rates, half.span - t), forcing)


def per_time(half: Half, at: Crossing) -> Crossing:
    """The derivative of a crossing with respect to its time."""
    rates, xi = half.plant.slip, half.plant.linear.xi
    forcing = Turn(-xi * at.forcing.sine, xi * at.forcing.cosine)
    return Crossing(at.flow.rate(rates), at.rest.rate(rates).scaled(-1.0), forcing)


class Phased(NamedTuple):
    """A quantity c + s sin gamma + u cos gamma."""

    c: Number
    s: Number
    u: Number

    def minus(self, x: Number, other: Phased) -> Phased:
        """self - x other."""
        return Phased(*(a - x * b for a, b in zip(self, other, strict=True)))

    def at(self, phase: Turn) -> Number:
        """Its value."""
        return self.c + self.s * phase.sine + self.u * phase.cosine


class Conditions(NamedTuple):
    """The two residuals of an orbit, its impact V and its height, as functions of gamma."""

    turning: Phased
    """phi'(0)"""
    crossing: Phased
    """phi(t)"""
    impact: Phased
    height: Phased
    """phi(0)"""


@jax.jit
def conditions(half: Half, at: Crossing) -> Conditions:
    """The two conditions for a crossing."""
    # V depends on phi'(t-), which depends on V again through the mirror condition. Both are linear, so that
    # the loop closes with the denominator of `per_fall`, and every condition stays linear in (sin, cos) of
    # gamma.
    lost, xi = half.plant.restitution - 1.0, half.plant.linear.xi
    s0, u0 = half.harmonic(Turn(jnp.ones_like(xi), jnp.zeros_like(xi)), 0)
    s1, u1 = half.harmonic(at.forcing, 0)
    per_fall = lost / (1.0 + lost * half.kick[2].of(half.whole))
    falls = half.slack * half.unit[2].of(at.flow) - half.step * half.unit[2].of(half.whole)
    impact = Phased(per_fall * falls, -per_fall * xi * u1, per_fall * xi * s1)
    turns = half.slack * half.unit[2].of(identity(xi)) - half.step * half.unit[2].of(at.rest)
    tilt = half.slack * half.unit[0].of(at.flow) - half.step * half.unit[0].of(half.whole)
    top = half.slack * half.unit[0].of(identity(xi)) - half.step * half.unit[0].of(at.rest)
    balance = 0.5 * (half.step - half.slack)
    return Conditions(
        Phased(turns, -xi * u0, xi * s0).minus(half.kick[2].of(at.rest), impact),
        Phased(tilt + balance, s1, u1).minus(half.kick[0].of(half.whole), impact),
        impact,
        Phased(top + balance, s0, u0).minus(half.kick[0].of(at.rest), impact),
    )


class Branches(NamedTuple):
    """phi(t) = middle +- apart sqrt(inside) on the two branches of gamma; none where inside < 0."""

    middle: Number
    apart: Number
    inside: Number
    along: Number
    way_s: Number
    way_u: Number

    def phase(self, branch: Number) -> Turn:
        """gamma on branch +1 or -1."""
        across = branch * jnp.sqrt(jnp.maximum(self.inside, 0.0))
        cosine = self.along * self.way_u + across * self.way_s
        return Turn(cosine, self.along * self.way_s - across * self.way_u)

    def on(self, branch: Number) -> Number:
        """phi(t) on branch +1 or -1; at 0 the product of both, also where neither exists."""
        root = self.apart * jnp.sqrt(jnp.maximum(self.inside, 1e-300))
        product = self.middle**2 - self.apart**2 * self.inside
        return jnp.where(branch == 0.0, product, self.middle + branch * root)


@jax.jit
def branches(c: Conditions) -> Branches:
    """The two branches: turning fixes how far (sin gamma, cos gamma) reaches along one direction."""
    # phi'(0) = 0 reads c + |(s, u)| cos(gamma - direction) = 0. A unit vector with a given component along
    # one direction has two values across it, and none if that component exceeds one: no orbit has this
    # crossing time then. Where both values meet, sqrt(inside) has an infinite slope; the product of both
    # branches has not.
    size = jnp.sqrt(c.turning.s**2 + c.turning.u**2)
    along, way_s, way_u = -c.turning.c / size, c.turning.s / size, c.turning.u / size
    middle = c.crossing.c + along * (c.crossing.s * way_s + c.crossing.u * way_u)
    apart = c.crossing.u * way_s - c.crossing.s * way_u
    return Branches(middle, apart, 1.0 - along**2, along, way_s, way_u)
