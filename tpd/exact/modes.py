"""The modes of the sliding and of the held system, in closed form and in real arithmetic.

The characteristic quartic of (25) has one positive root s1 (the block falling over), one
isolated negative root s2, and two more roots that stay together as z^2 + p z + q, whether the
bob swings (a complex pair) or creeps (two real roots). Keeping that pair unsplit needs no
complex numbers and nothing goes wrong at critical damping.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Float

from tpd.core.equations import Linear
from tpd.core.parameters import Number, Parameters, State
from tpd.exact.trigonometry import Turn, turn


class Rates(NamedTuple):
    """Time scales of one arc: exp(s1 t), exp(s2 t), the pair z^2 + p z + q, forcing xi."""

    s1: Number
    s2: Number
    p: Number
    q: Number
    xi: Number

    @property
    def swing_rate(self) -> Number:
        """sqrt |q - p^2/4|, the rate of the pair's `swing` in `pair`."""
        return _swing_rate(self.p, self.q)

    def pair(self, t: Number, swing: Turn | None = None) -> tuple[Number, Number]:
        """The pair's solutions u, v with (u, u') = (1, 0) and (v, v') = (0, 1) at t = 0; `swing` is
        the turn by `swing_rate` times t, if known."""
        cosine, v = _pair(self.p, self.q, t, swing)
        return cosine + 0.5 * self.p * v, v


_SERIES = 1e-3
"""|w t|^2 below which the pair's solutions are summed as power series."""


def _swing_rate(p: Number, q: Number) -> Number:
    """sqrt |q - p^2/4|, away from zero: beyond its use `_pair` sums a series instead."""
    size = jnp.abs(q - 0.25 * p**2)
    return jnp.sqrt(jnp.where(size > 1e-16, size, 1e-16))


def _pair(p: Number, q: Number, t: Number, swing: Turn | None = None) -> tuple[Number, Number]:
    """exp(-pt/2) times (cos wt, sin(wt)/w), w^2 = q - p^2/4, through w^2 = 0 and below it.

    `swing` is the turn by `_swing_rate` times t, if known."""
    # cos and sin turn into cosh and sinh where w^2 changes its sign. Close to zero both formulas divide by a
    # small w and their derivatives by its square: there the power series in w^2 takes over, which is one
    # analytic function on both sides. All three are computed and selected, because a batch has no branches.
    w2 = q - 0.25 * p**2
    x2 = w2 * t**2
    near, below = jnp.abs(x2) < _SERIES, w2 < 0
    w = _swing_rate(p, q)
    cosine, sine = turn(w * t) if swing is None else swing
    decay = jnp.exp(-0.5 * p * t)
    cosine, sine = decay * cosine, decay * sine / w
    w_real = jnp.where(below & ~near, w, 0.0)
    slow, fast = jnp.exp((w_real - 0.5 * p) * t), jnp.exp((-w_real - 0.5 * p) * t)
    cosh, sinh = 0.5 * (slow + fast), 0.5 * (slow - fast) / w
    series_c = 1.0 - x2 / 2.0 * (1.0 - x2 / 12.0 * (1.0 - x2 / 30.0 * (1.0 - x2 / 56.0)))
    series_s = 1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0 * (1.0 - x2 / 72.0)))
    cosine = jnp.where(near, decay * series_c, jnp.where(below, cosh, cosine))
    sine = jnp.where(near, decay * t * series_s, jnp.where(below, sinh, sine))
    return cosine, sine


def quartic(p: Parameters) -> tuple[Number, Number, Number, Number, Number]:
    """Coefficients (a4, a3, a2, a1, a0) of det(M s^2 + C s + K) for (25)."""
    rho, c = p.inertia_ratio, p.hinge
    d = 1.0 + p.mu * rho * p.nu**2
    a4 = p.lam * rho * d
    a3 = c * (d + p.mu * rho * (2.0 - p.lam) ** 2)
    a2 = 1.0 + p.mu * rho * (4.0 + p.nu**2) - (1.0 + 2.0 * p.mu) * p.lam * rho
    a1 = -c * (1.0 + 2.0 * p.mu - p.mu * p.lam)
    a0 = -(1.0 + 2.0 * p.mu)
    return a4, a3, a2, a1, a0


def _positive_root(a4: Number, a3: Number, a2: Number, a1: Number, a0: Number) -> Number:
    """The one positive root: Newton's method from above, where the quartic is convex.

    The even part vanishes at the undamped root and the odd part at that of a locked hinge; the
    root lies between the two, so the larger is an upper bound.
    """
    free = jnp.sqrt(-2.0 * a0 / (a2 + jnp.sqrt(a2**2 - 4.0 * a4 * a0)))
    locked = jnp.sqrt(jnp.where(a3 > 0, jnp.abs(a1) / jnp.where(a3 > 0, a3, 1.0), 0.0))
    s = jnp.maximum(free, locked)
    for _ in range(8):
        value = (((a4 * s + a3) * s + a2) * s + a1) * s + a0
        slope = ((4.0 * a4 * s + 3.0 * a3) * s + 2.0 * a2) * s + a1
        s = s - value / slope
    return s


def _isolated_root(b3: Number, b2: Number, b1: Number, b0: Number) -> Number:
    """The real root of the cubic farthest from its mean, hence away from the other two."""
    # The cubic without its square term, t^3 + third t + level: three real roots (a cosine of a third of an
    # angle) or one (cosh, sinh). The root taken lies on the side opposite to the sign of the cubic at the
    # mean.
    mean = -b2 / (3.0 * b3)
    third = (b1 - b2**2 / (3.0 * b3)) / b3
    level = (((b3 * mean + b2) * mean + b1) * mean + b0) / b3
    size = jnp.sqrt(jnp.maximum(jnp.abs(third), 1e-300) / 3.0)
    ratio = jnp.abs(level) / (2.0 * size**3)
    inside = jnp.cos(jnp.arccos(jnp.minimum(ratio, 1.0)) / 3.0)
    outside = jnp.cosh(jnp.arccosh(jnp.maximum(ratio, 1.0)) / 3.0)
    rising = jnp.sinh(jnp.arcsinh(ratio) / 3.0)
    factor = jnp.where(third > 0, rising, jnp.where(ratio < 1.0, inside, outside))
    return mean - jnp.sign(level) * 2.0 * size * factor


def roots(p: Parameters) -> tuple[Number, Number, Number, Number]:
    """(s1, s2, p, q) of the sliding system, each differentiable by one Newton step; of single numbers, and
    under `vmap` of a batch."""
    # A general eigensolver would take about half of the time of a batch, and has no derivative where two
    # eigenvalues meet, as at critical damping of the bob. Here only the two real roots that never meet others
    # are solved for: s1 > 0 (one sign change of the coefficients, hence one positive root) and the real root
    # of the cubic left over that is farthest from its mean. Deflation leaves the pair as z^2 + p z + q. The
    # root-finders run without derivatives; one Newton step on the full quartic puts them back (implicit
    # function theorem) and removes the rounding that deflation has brought in.
    a4, a3, a2, a1, a0 = quartic(p)
    s1 = stop_gradient(_positive_root(*(stop_gradient(jnp.asarray(a)) for a in (a4, a3, a2, a1, a0))))
    b2 = a3 + s1 * a4
    b1 = a2 + s1 * b2
    b0 = a1 + s1 * b1
    s2 = stop_gradient(_isolated_root(*(stop_gradient(b) for b in (a4, b2, b1, b0))))

    def polish(s: Number) -> Number:
        value = (((a4 * s + a3) * s + a2) * s + a1) * s + a0
        slope = ((4.0 * a4 * s + 3.0 * a3) * s + 2.0 * a2) * s + a1
        return s - value / stop_gradient(slope)

    s1, s2 = polish(s1), polish(stop_gradient(polish(stop_gradient(polish(s2)))))
    return s1, s2, a3 / a4 + s1 + s2, a0 / (a4 * s1 * s2)


class Eigenmode(NamedTuple):
    """One real mode: its shape over (phi, psi, phi', psi') and its left (projecting) vector."""

    shape: State
    left: State


def _mode(linear: Linear, s: Number) -> Eigenmode:
    pencil = s * linear.mass + linear.damping
    (a, b), (c, d) = s * pencil + linear.stiffness
    # The pencil has rank one, so the left null vector can be read off either column; for the
    # massless bob (mu = 0) the one or the other column vanishes.
    v = jnp.stack([d, -c])
    u = jnp.where(jnp.abs(d) >= jnp.abs(a), jnp.stack([d, -b]), jnp.stack([-c, a]))
    norm = u @ ((pencil + s * linear.mass) @ v)
    left = jnp.concatenate([u @ pencil, u @ linear.mass]) / norm
    return Eigenmode(jnp.concatenate([v, s * v]), left)


def _parts(z: Array) -> Array:
    """Real and imaginary part, along a last axis: the factors of sin and cos in Im(z exp(i xi t))."""
    return jnp.stack([jnp.real(z), jnp.imag(z)], axis=-1)


class Plant(eqx.Module):
    """Everything about the linear system that does not change from arc to arc."""

    linear: Linear
    slip: Rates
    held: Rates
    falling: Eigenmode
    rising: Eigenmode
    response: Float[Array, "2 2"]
    """Harmonic response of (phi, psi) while sliding: columns for sin and cos."""
    swing: Float[Array, "2"]
    """Harmonic response of psi under a held block: for sin and cos."""
    response_lag: Float[Array, "2 2"]
    """dH/ds of the transfer function H at s = i xi, of which `response` is H: the response to t sin(xi t)
    is t times `response` plus this."""
    swing_lag: Float[Array, "2"]
    """dH/ds of the transfer function of which `swing` is H(i xi)."""
    restitution: Number
    length_ratio: Number

    def __init__(self, p: Parameters) -> None:
        self.linear = linear = Linear(p)
        xi = jnp.asarray(p.xi)
        self.slip = Rates(*roots(p), xi)
        zero, stiffness = jnp.zeros_like(xi), 1.0 / linear.m22
        self.held = Rates(zero, zero, linear.c2 * stiffness, stiffness, xi)
        self.falling, self.rising = _mode(linear, self.slip.s1), _mode(linear, self.slip.s2)
        matrix = linear.stiffness - xi**2 * linear.mass + 1j * xi * linear.damping
        (a, b), (c, d) = matrix
        determinant = a * d - b * c
        r1, r2 = -linear.f * linear.tilt, linear.f
        y = jnp.stack([(d * r1 - b * r2) / determinant, (a * r2 - c * r1) / determinant])
        self.response = _parts(y)
        # H = P^-1 r with P = M s^2 + C s + K, hence dH/ds = -P^-1 dP/ds H.
        pencil = 2j * xi * linear.mass + linear.damping
        l1, l2 = (-(row[0] * y[0] + row[1] * y[1]) for row in pencil)
        self.response_lag = _parts(
            jnp.stack([(d * l1 - b * l2) / determinant, (a * l2 - c * l1) / determinant])
        )
        z = linear.f / d
        self.swing, self.swing_lag = _parts(z), _parts(-pencil[1, 1] / d * z)
        self.restitution = jnp.asarray(p.velocity_ratio)
        self.length_ratio = jnp.asarray(p.lam)
