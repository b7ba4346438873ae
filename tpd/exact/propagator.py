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

from tpd.core.parameters import Number
from tpd.exact.modes import Rates
from tpd.exact.trigonometry import Turn, kept


class Factor(NamedTuple):
    """A function of the state matrix: its values at s1 and s2, and a + b z on the pair."""

    at_s1: Number
    at_s2: Number
    a: Number
    b: Number


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
