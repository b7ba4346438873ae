"""One-harmonic balance: the paper's (23) for the bare block and (27) with a pendulum, corrected.

With phi = Re Phi exp(i theta), psi = Re Z exp(i theta) and the forcing Re F exp(i theta), |F| = f:

    D = 1 - lam rho xi^2 + i xi c_p,   h = 2 mu rho lam xi^2 - i xi mu lam c_p,   B = 1 + 2 mu + h/D
    A = -[1 + mu rho (4 + nu^2)] xi^2 - (1 + 2 mu) + i xi mu lam c_p - h (2 rho xi^2 - i xi c_p)/D
    A Phi + B F + (4/pi) [(1 + mu) nu + i k] = 0

so that |A Phi + (4/pi)(...)|^2 = |B|^2 f^2 is a quadratic in Phi: two branches and no iteration. With the
parametric term s f (1 + mu) nu phi sin(xi tau) of (12) and (27) the row of the block becomes

    A Phi + B F + (4/pi) [(1 + mu) nu + i k] + (4/(3 pi)) (1 + mu) nu Phi (2 Re F + i Im F) = 0

and |F| = f is a quartic in Phi.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Complex, Float

from tpd.scene.parameters import Parameters, as_arrays, check_parameters
from tpd.scene.pytrees import Number
from tpd.theory.equations import Linear

_Amplitude = Complex[Array, "..."] | complex
"""Complex amplitude of a harmonic."""
SAFETY = 2.5
"""Factor on the first-order size of the neglected harmonics in `Neglected.bound`."""
_HARMONICS = (3, 5, 7, 9, 11)
"""Harmonics of the signs whose first-order effect is added up. It falls with the third power of the order:
one power from the signs, two from the inertia of the block."""
_REAL = 1e-8
"""Largest imaginary part, as a share of the size, of a root of the quartic that is taken as real."""


class _Balance(NamedTuple):
    """Complex coefficients D, 2 rho xi^2 - i xi c_p, A, B, and the harmonic (4/pi)[...] of the signs."""

    d: _Amplitude
    drive: _Amplitude
    a: _Amplitude
    b: _Amplitude
    signs: _Amplitude


def _balance(p: Parameters, order: int = 1) -> _Balance:
    """Coefficients at the frequency `order` xi, with an odd `order`."""
    linear, c, rho, xi = Linear(p), p.hinge, p.inertia_ratio, order * p.xi
    d = 1.0 - p.lam * rho * xi**2 + 1j * xi * c
    h = 2.0 * p.mu * rho * p.lam * xi**2 - 1j * xi * p.mu * p.lam * c
    drive = 2.0 * rho * xi**2 - 1j * xi * c
    a = -linear.m11 * xi**2 - linear.tilt + 1j * xi * linear.c1 - h * drive / d
    # sgn(cos theta) has the harmonics +1, -1/3, +1/5, ...; -sgn(sin theta) has i, i/3, i/5, ...
    weight = linear.weight if order % 4 == 1 else -linear.weight
    return _Balance(d, drive, a, linear.tilt + h / d, 4.0 / (jnp.pi * order) * (weight + 1j * p.k))


def _abs2(z: _Amplitude) -> Number:
    return jnp.real(z) ** 2 + jnp.imag(z) ** 2


def _dot(z: _Amplitude, w: _Amplitude) -> Number:
    """Re(z* w)."""
    return jnp.real(z) * jnp.real(w) + jnp.imag(z) * jnp.imag(w)


class HarmonicBranches(NamedTuple):
    """Roots of a one-harmonic balance: last axis the upper and the lower branch, zeros where one does not
    exist. Angles in rad. As a rule the upper branch is stable, and the lower one is the saddle between
    rocking and rest, which exists while |B| f < (4/pi) |(1 + mu) nu + i k|."""

    amplitude: Float[Array, "*batch 2"]
    """Amplitude of the tilt phi."""
    swing: Float[Array, "*batch 2"]
    """Amplitude of the bob's angle psi."""
    phase: Float[Array, "*batch 2"]
    """Phase xi tau of the forcing f sin(xi tau) at the upper turn, in (-pi, pi]."""
    exists: Bool[Array, "*batch 2"]


def _described(
    of: _Balance, phi: Number, forcing: _Amplitude, exists: Bool[Array, "..."]
) -> HarmonicBranches:
    """Branches of given amplitudes phi (any positive number where none exists) and complex forcings F."""
    z = (forcing - of.drive * phi) / of.d
    phase = jnp.arctan2(jnp.real(forcing), -jnp.imag(forcing))
    amplitude, swing, phase = (jnp.where(exists, x, 0.0) for x in (phi, jnp.sqrt(_abs2(z)), phase))
    return HarmonicBranches(amplitude, swing, phase, exists)


def one_harmonic_branches(p: Parameters) -> HarmonicBranches:
    """Both roots of the one-harmonic balance (27), corrected, with friction and damping and without the
    parametric term; fields may be arrays.

    As a rule the upper branch is 1 to 5 % above the exact amplitude and the lower one 5 to 30 %:
    `neglected_harmonics` estimates the error.

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    check_parameters(p)
    of = _balance(p)
    a2, half = _abs2(of.a), _dot(of.a, of.signs)
    rest = _abs2(of.signs) - _abs2(of.b) * p.f**2
    # half^2 - a2 rest, rearranged: without friction two nearly equal numbers would cancel.
    discriminant = a2 * _abs2(of.b) * p.f**2 - _dot(1j * of.a, of.signs) ** 2
    real = discriminant > 0
    reach = -half + jnp.sqrt(jnp.where(real, discriminant, 1.0))
    upper_there = real & (reach > 0)
    reach = jnp.where(upper_there, reach, 1.0)
    # The product of the roots is rest / a2: no difference of nearly equal numbers.
    exists = jnp.stack([upper_there, upper_there & (rest > 0)], axis=-1)
    phi = jnp.where(exists, jnp.stack([reach / a2, rest / reach], axis=-1), 1.0)
    of = _Balance(*(x[..., None] for x in jnp.broadcast_arrays(*of)))
    return _described(of, phi, -(of.a * phi + of.signs) / of.b, exists)


class Harmonic1(NamedTuple):
    """One-harmonic estimate of the stable branch: amplitudes in rad, and True where it exists."""

    amplitude: Number
    swing: Number
    exists: Number


def one_harmonic(p: Parameters) -> Harmonic1:
    """Larger root of the one-harmonic balance: the stable branch, 1 to 5 % above the exact amplitude.

    Where the balance has no root, `exists` is False and both amplitudes are zero.
    """
    both = one_harmonic_branches(p)
    return Harmonic1(both.amplitude[..., 0], both.swing[..., 0], both.exists[..., 0])


class Neglected(NamedTuple):
    """Error of the one-harmonic balance as shares of its amplitude; last axis as in `HarmonicBranches`, zero
    and infinity where the branch does not exist."""

    correction: Float[Array, "*batch 2"]
    """First-order correction: the exact amplitude is about (1 + correction) times that of the balance."""
    bound: Float[Array, "*batch 2"]
    """Estimate of the largest error of the balance: `SAFETY` times the size of the parts of the correction.
    It is not proved: of 300 random scenes it held for all 288 upper branches and for 49 of the 51 lower
    branches that are orbits. The other 81 lower roots belong to no orbit; their bound was 0.3 or more."""


def neglected_harmonics(p: Parameters) -> Neglected:
    """Size of the harmonics that the one-harmonic balance neglects; fields may be arrays.

    The third to eleventh harmonics of the signs pass through the linear transfer function 1/A(n xi). They add
    to the tilt at the turn. They also shift the crossing and the turn, which rotates the first harmonics of
    weight and friction against the forcing and moves the balance itself.

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    check_parameters(p)
    of, both = _balance(p), one_harmonic_branches(p)
    of = _Balance(*(x[..., None] for x in jnp.broadcast_arrays(*of)))
    phi = jnp.where(both.exists, both.amplitude, 1.0)
    at_turn, crossing, turn = 0.0, 0.0, 0.0
    for order in _HARMONICS:
        higher = _balance(p, order)
        tilt = jnp.asarray(-higher.signs / higher.a)[..., None]
        at_turn = at_turn + jnp.real(tilt)
        crossing = crossing + jnp.real(tilt * 1j**order) / phi
        turn = turn - order * jnp.imag(tilt) / phi
    weight, friction = jnp.real(of.signs), jnp.imag(of.signs)
    turned = friction * turn - 1j * weight * crossing
    pull = of.a * phi + of.signs
    moved = -_dot(pull, turned) / _dot(pull, of.a)
    bound = SAFETY * (jnp.abs(moved) + jnp.abs(at_turn)) / phi
    return Neglected(
        jnp.where(both.exists, (moved + at_turn) / phi, 0.0), jnp.where(both.exists, bound, jnp.inf)
    )


def parametric_branches(p: Parameters) -> HarmonicBranches:
    """Roots of the one-harmonic balance with the parametric term s f (1 + mu) nu phi sin(xi tau): (23) for
    the bare block, the corrected (27) with a pendulum. Fields are single numbers; use `jax.vmap` for a batch.

    The term is of second order in the angles, like other terms that (25) drops.

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    check_parameters(p)
    p = as_arrays(p)
    of = _balance(p)
    # The first harmonic of s phi sin(xi tau) is linear in Phi and, over the reals, in F: the factor on Im F
    # is half of that on Re F. So F solves two real linear equations with coefficients linear in Phi.
    pull = 4.0 / (3.0 * jnp.pi) * Linear(p).weight
    line = _forcing_polynomials(of, pull)
    square = [jnp.convolve(q, q) for q in line]
    quartic = square[0] + square[1] - p.f**2 * square[2]
    exists, phi = _two_largest(quartic)
    real, imag, scale = (jnp.polyval(q, phi) for q in line)
    of = _Balance(*(jnp.asarray(x)[None] for x in of))
    return _described(of, phi, (real + 1j * imag) / jnp.where(scale == 0, 1.0, scale), exists)


def _forcing_polynomials(of: _Balance, pull: Number) -> tuple[Array, Array, Array]:
    """Quadratics in Phi, highest power first, such that F = (first + i second) / third."""

    def line(slope: Number, level: Number) -> Array:
        return jnp.stack([jnp.asarray(slope), jnp.asarray(level)])

    real, imag = (line(part(of.a), part(of.signs)) for part in (jnp.real, jnp.imag))
    cosine, sine = line(2.0 * pull, jnp.real(of.b)), line(pull, jnp.real(of.b))
    turn = line(jnp.zeros_like(pull), jnp.imag(of.b))
    first = -jnp.convolve(sine, real) - jnp.convolve(turn, imag)
    second = jnp.convolve(turn, real) - jnp.convolve(cosine, imag)
    return first, second, jnp.convolve(cosine, sine) + jnp.convolve(turn, turn)


def _two_largest(quartic: Float[Array, "5"]) -> tuple[Bool[Array, "2"], Float[Array, "2"]]:
    """Existence and value of the two largest positive roots, differentiable."""
    roots = jnp.roots(stop_gradient(quartic), strip_zeros=False)
    real, imag = jnp.real(roots), jnp.imag(roots)
    there = (jnp.abs(imag) <= _REAL * jnp.abs(real)) & (real > 0)
    order = jnp.argsort(-jnp.where(there, real, 0.0))[:2]
    there, root = there[order], jnp.where(there, real, 1.0)[order]
    # One Newton step from a converged root changes its value by rounding only, and has its derivative.
    slope = jnp.polyval(jnp.polyder(stop_gradient(quartic)), root)
    polished = root - jnp.polyval(quartic, root) / jnp.where(there, slope, 1.0)
    return there, jnp.where(there, polished, 1.0)
