"""Eigenvalues of real 4 x 4 matrices as roots of their characteristic quartic, fast in a batch.

`jnp.linalg.eigvals` calls LAPACK for one matrix after the other. Sums and products of a whole batch fuse into
few loops instead, so the roots of

    det(z - m) = z^4 + c1 z^3 + c2 z^2 + c3 z + c4

are found here by Aberth's iteration. It is Newton's iteration p/p' for all four roots at once, in which every
root is repelled by the others: z_i moves by p/(p' - p sum_j 1/(z_i - z_j)), so no two end at the same simple
root, and no root is divided out (which would pass the error of one on to the next). Convergence is cubic at
simple roots. At a double root, where two multipliers meet, it is linear and the roots have half the digits,
an error of about 1e-8.

Rounding of the coefficients costs roots far below the largest most of their digits. That does no harm here:
the question is which multipliers are larger than 1. Complex numbers are written as pairs of real ones.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tpd.core.orbit_terms import CONSERVED, UNDECIDED
from tpd.core.parameters import Number


def conserves(p: Any) -> Any:
    """Whether nothing takes energy from a rocking block: no friction, no impact loss, and no hinge damping
    that the block can feel. No motion attracts then. `p` has the fields of `Parameters`."""
    return (p.k == 0.0) & (p.velocity_ratio == 1.0) & ((p.mu == 0.0) | (p.zeta == 0.0))


def is_neutral(p: Any, largest: Any) -> Any:
    """Whether an orbit whose multiplier is `largest` in size neither attracts nor repels."""
    return (conserves(p) & (largest < 1.0 + CONSERVED)) | (abs(largest - 1.0) < UNDECIDED)


class _Roots(NamedTuple):
    real: tuple[Number, ...]
    imag: tuple[Number, ...]


@jax.jit
def quartic_roots(coefficients: tuple[Number, ...]) -> tuple[Float[Array, "4"], Float[Array, "4"]]:
    """Real and imaginary parts of the roots of z^4 + c1 z^3 + c2 z^2 + c3 z + c4, in no order.

    No derivatives pass: where a caller wants one, a Newton step from the converged root gives it.
    """
    c1, c2, c3, c4 = (jax.lax.stop_gradient(c) for c in coefficients)
    # All roots lie within twice max |c_k|^(1/k) (Fujiwara's bound).
    radius = jnp.maximum(
        jnp.maximum(jnp.abs(c1), jnp.sqrt(jnp.abs(c2))),
        jnp.maximum(jnp.cbrt(jnp.abs(c3)), jnp.abs(c4) ** 0.25),
    )
    radius = jnp.where(radius > 0, radius, 1.0)
    # The first guesses have no symmetry about the real axis: for a real polynomial the iteration preserves
    # such a symmetry, and guesses in conjugate pairs never become two different real roots. The radii differ
    # because multipliers often differ by orders of magnitude.
    angles = (0.4, 1.97, 3.54, 5.11)
    shares = (1.0, 0.8, 0.5, 0.25)
    first = _Roots(
        tuple(s * radius * math.cos(a) for a, s in zip(angles, shares, strict=True)),
        tuple(s * radius * math.sin(a) for a, s in zip(angles, shares, strict=True)),
    )

    def going(carry: tuple) -> Array:
        _, moved, count = carry
        # The bound is for multiple roots, whose last digits may never settle.
        return (moved > 1e-15) & (count < 60)

    def step(carry: tuple) -> tuple:
        roots, _, count = carry
        moves = [_aberth(roots, i, (c1, c2, c3, c4)) for i in range(4)]
        real = tuple(x - d[0] for x, d in zip(roots.real, moves, strict=True))
        imag = tuple(y - d[1] for y, d in zip(roots.imag, moves, strict=True))
        moved = jnp.max(jnp.stack([jnp.abs(a) + jnp.abs(b) for a, b in moves])) / radius
        return _Roots(real, imag), moved, count + 1

    start = (first, jnp.ones_like(radius), jnp.zeros((), int))
    roots = jax.lax.while_loop(going, step, start)[0]
    return jnp.stack(roots.real), jnp.stack(roots.imag)


def _aberth(roots: _Roots, i: int, c: tuple[Number, ...]) -> tuple[Number, Number]:
    """Correction p/(p' - p sum 1/(z_i - z_j)) of the i-th root, as real and imaginary part."""
    x, y = roots.real[i], roots.imag[i]
    # Horner's scheme for p and p' together.
    value, slope = (jnp.ones_like(x), jnp.zeros_like(x)), (jnp.zeros_like(x), jnp.zeros_like(x))
    for coefficient in c:
        slope = (slope[0] * x - slope[1] * y + value[0], slope[0] * y + slope[1] * x + value[1])
        value = (value[0] * x - value[1] * y + coefficient, value[0] * y + value[1] * x)
    push = (jnp.zeros_like(x), jnp.zeros_like(x))
    for j in range(4):
        if j != i:
            a, b = x - roots.real[j], y - roots.imag[j]
            # Two guesses that coincide do not repel each other: 0 instead of 0/0.
            size = jnp.maximum(a * a + b * b, 1e-300)
            push = (push[0] + a / size, push[1] - b / size)
    below = (
        slope[0] - value[0] * push[0] + value[1] * push[1],
        slope[1] - value[0] * push[1] - value[1] * push[0],
    )
    size = jnp.maximum(below[0] ** 2 + below[1] ** 2, 1e-300)
    return (
        (value[0] * below[0] + value[1] * below[1]) / size,
        (value[1] * below[0] - value[0] * below[1]) / size,
    )
