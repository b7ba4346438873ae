"""Functions of the sliding system's state matrix, applied mode by mode.

A function g of the 4 x 4 matrix A is known by its values on the spectrum: two numbers on the real
modes and, on the pair z^2 + p z + q = 0 that stays unsplit, a + b z. Products and inverses of such
functions are products and inverses of those values, so that exp(A t), 1/(1 + exp(A h)) and what is
made of them cost a few multiplications and never a matrix.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from tpd.core.parameters import Number, State
from tpd.exact.modes import Plant, Rates
from tpd.exact.trigonometry import Turn, kept


class Factor(NamedTuple):
    """A function of the state matrix: its values at s1 and s2, and a + b z on the pair."""

    at_s1: Number
    at_s2: Number
    a: Number
    b: Number

    def scaled(self, c: Number) -> Factor:
        """c g."""
        return Factor(*(c * x for x in self))

    def plus(self, other: Factor) -> Factor:
        """g + h."""
        return Factor(*(x + y for x, y in zip(self, other, strict=True)))

    def times(self, other: Factor, rates: Rates) -> Factor:
        """g h."""
        bb = self.b * other.b
        a = self.a * other.a - rates.q * bb
        b = self.a * other.b + self.b * other.a - rates.p * bb
        return Factor(self.at_s1 * other.at_s1, self.at_s2 * other.at_s2, a, b)

    def inverse(self, rates: Rates) -> Factor:
        """1/g."""
        # (a + b z)(a - p b - b z) = a^2 - p a b + q b^2 on the pair, where z^2 = -p z - q.
        norm = self.a**2 - rates.p * self.a * self.b + rates.q * self.b**2
        return Factor(1.0 / self.at_s1, 1.0 / self.at_s2, (self.a - rates.p * self.b) / norm, -self.b / norm)

    def rate(self, rates: Rates) -> Factor:
        """A g, which is dg/dt if g is exp(A t)."""
        a, b = -rates.q * self.b, self.a - rates.p * self.b
        return Factor(rates.s1 * self.at_s1, rates.s2 * self.at_s2, a, b)


class Functional(NamedTuple):
    """A linear function of a `Factor`, such as one component of g(A) v for a fixed vector v.

    Written out: in a batch a sum of four products is fused with its neighbours, a small matrix
    product is not.
    """

    on_s1: Number
    on_s2: Number
    on_a: Number
    on_b: Number

    def of(self, g: Factor) -> Number:
        """Its value."""
        return self.on_s1 * g.at_s1 + self.on_s2 * g.at_s2 + self.on_a * g.a + self.on_b * g.b

    def minus(self, x: Number, other: Functional) -> Functional:
        """self - x other."""
        return Functional(*(a - x * b for a, b in zip(self, other, strict=True)))

    def rate(self, rates: Rates) -> Functional:
        """The functional g -> self.of(A g)."""
        on_b = -rates.q * self.on_a - rates.p * self.on_b
        return Functional(rates.s1 * self.on_s1, rates.s2 * self.on_s2, self.on_b, on_b)

    def after(self, h: Factor, rates: Rates) -> Functional:
        """The functional g -> self.of(g h)."""
        on_a = self.on_a * h.a + self.on_b * h.b
        on_b = self.on_b * (h.a - rates.p * h.b) - rates.q * self.on_a * h.b
        return Functional(self.on_s1 * h.at_s1, self.on_s2 * h.at_s2, on_a, on_b)


@jax.jit
def exponential(rates: Rates, t: Number, swing: Turn | None = None) -> Factor:
    """exp(A t); `swing` is the turn by `rates.swing_rate` times t, if known."""
    u, v = rates.pair(t, swing)
    return Factor(jnp.exp(rates.s1 * t), jnp.exp(rates.s2 * t), kept(u), kept(v))


def identity(like: Number) -> Factor:
    """1."""
    one = jnp.ones_like(like)
    return Factor(one, one, one, jnp.zeros_like(one))


def components(plant: Plant, v: State) -> tuple[Functional, ...]:
    """The four components of g(A) v as functions of g."""
    # Projections on the two real modes; what is left over belongs to the pair, on which g = a + b z acts as
    # a v + b A v, so that neither of its two roots is needed.
    first = (plant.falling.left @ v) * plant.falling.shape
    second = (plant.rising.left @ v) * plant.rising.shape
    pair = v - first - second
    zero = jnp.zeros_like(v[0])
    onward = plant.linear.rates(pair, zero, zero, zero)
    return tuple(Functional(first[i], second[i], pair[i], onward[i]) for i in range(4))
