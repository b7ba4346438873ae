"""Cosine and sine together, in polynomials that a batch computes several at a time.

XLA calls the C library for sines, one number after the other; in a batch that call costs more than
everything else. The reduction to a quarter turn carries pi/2 in three parts, good to the last digit
up to a million rad, and the Taylor polynomials leave less than 1e-19 there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp

from tpd.core.parameters import Number

_HALF_PI = tuple(float.fromhex(x) for x in ("0x1.921fb544p+0", "0x1.0b4611a6p-34", "0x1.3198a2e037073p-69"))
_SINE = tuple((-1) ** i / math.factorial(2 * i + 1) for i in range(9))
_COSINE = tuple((-1) ** i / math.factorial(2 * i) for i in range(9))


class Turn(NamedTuple):
    """Cosine and sine of an angle."""

    cosine: Number
    sine: Number


@jax.custom_jvp
def kept(x: Number) -> Number:
    """`x`, computed once.

    XLA recomputes what it holds to be cheap, such as sums, products and sines, for everyone who
    needs it, and for those who need that, and so on; a division it does not repeat. x/1 is x.
    """
    return x / _one(x)


@kept.defjvp
def _kept_jvp(primals: tuple[Number], tangents: tuple[Number]) -> tuple[Number, Number]:
    # Linear in the tangent, so that it can be transposed.
    return kept(primals[0]), tangents[0] / _one(primals[0])


def _one(x: Number) -> Number:
    """1 in a way that no compiler sees through."""
    return jnp.where(x == x, 1.0, 2.0)


@jax.jit
def turn(angle: Number) -> Turn:
    """Cosine and sine of `angle` (rad), to the last digit while |angle| < 1e6."""
    # JAX traces this once for a program, and not for each of some hundred angles. Other functions of the
    # orbits have `jax.jit` for the same reason.
    return _turn(angle)


@jax.custom_jvp
def _turn(angle: Number) -> Turn:
    """Cosine and sine as `turn` gives them, with their derivatives."""
    # angle - quarters pi/2 cancels nearly all digits. The first two parts of pi/2 have trailing zeros, so
    # that their products with `quarters` are exact, and only the third, about 2e-21, is rounded.
    quarters = jnp.round(angle * (2.0 / math.pi))
    rest = ((angle - quarters * _HALF_PI[0]) - quarters * _HALF_PI[1]) - quarters * _HALF_PI[2]
    square = rest * rest
    sine = rest + rest * square * _horner(_SINE[1:], square)
    cosine = 1.0 - 0.5 * square + square * square * _horner(_COSINE[2:], square)
    quadrant = quarters.astype(jnp.int32)
    swapped = (quadrant & 1) == 1
    sine, cosine = jnp.where(swapped, cosine, sine), jnp.where(swapped, sine, cosine)
    sine = jnp.where((quadrant & 2) == 2, -sine, sine)
    cosine = jnp.where(((quadrant + 1) & 2) == 2, -cosine, cosine)
    return Turn(kept(cosine), kept(sine))


@_turn.defjvp
def _turn_jvp(primals: tuple[Number], tangents: tuple[Number]) -> tuple[Turn, Turn]:
    here, rate = _turn(*primals), tangents[0]
    return here, Turn(-here.sine * rate, here.cosine * rate)


def _horner(coefficients: tuple[float, ...], x: Number) -> Number:
    value = coefficients[-1] * jnp.ones_like(x)
    for c in coefficients[-2::-1]:
        value = value * x + c
    return value
