"""Balance of one harmonic: (23) of the paper without a pendulum and (27) with a pendulum, both corrected.

With phi = Re Phi exp(i theta), psi = Re Z exp(i theta) and the forcing Re F exp(i theta), |F| = f:

    D = 1 - lam rho xi^2 + i xi c_p,   h = kappa mu rho lam xi^2 - i xi mu lam c_p,   B = 1 + kappa mu + h/D
    A = -[1 + mu rho (kappa^2 + nu^2)] xi^2 - (1 + kappa mu) + i xi mu lam c_p
        - h (kappa rho xi^2 - i xi c_p)/D + i (64/pi^3) (1 - e)/(1 + e) (1 + mu rho nu^2) xi^2
    A Phi + B F + (4/pi) [(1 + mu) nu + i k] = 0

The last term of A is the loss at impacts. A light block falls back almost at constant acceleration, so
its tilt is a parabola in time with the peak Phi, which reaches zero with the mean rate v = (4/pi) xi Phi.
Two impacts then dissipate 4 (1 - e)/(1 + e) (1 + mu rho nu^2) v^2 in each period, because the inertia of
block and bob in an impact is 1 + mu rho nu^2. A viscous moment c phi' dissipates pi c xi Phi^2, and c xi is
the stated term.

Hence |A Phi + w|^2 = |B|^2 f^2, with w = (4/pi) [...], is a quadratic equation for Phi, with two branches and
without iteration. The branches meet in a fold where |A Phi + w| is smallest.

With the parametric term s f (1 + mu) nu phi sin(xi tau) of (12) and (27) the first row becomes

    A Phi + B F + (4/pi) [(1 + mu) nu + i k] + (4/(3 pi)) (1 + mu) nu Phi (2 Re F + i Im F) = 0

and |F| = f is a quartic equation for Phi.

Products of real and complex numbers are meant here, also if a user makes JAX strict about types.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Complex, Float

from tpd.scene.parameters import Parameters, as_arrays, check_parameters
from tpd.scene.pytrees import Number
from tpd.scene.status import Status, code_of, status_of
from tpd.theory.equations import Linear

_Amplitude = Complex[Array, "..."] | complex
"""Complex amplitude of a harmonic."""
SAFETY = 2.5
"""Factor on the first-order size of the neglected harmonics in `Neglected.bound`."""
_HARMONICS = (3, 5, 7, 9, 11)
"""Harmonics of the sign functions whose first-order effect is added. The effect decreases with the third
power of the order: the signs contribute one power and the inertia of the block two."""
_REAL = 1e-8
"""Relative size of the imaginary part up to which a root of the quartic is considered real."""


class _Balance(NamedTuple):
    """Complex coefficients of the balance at one frequency."""

    d: _Amplitude
    """D, which relates the bob angle to its excitation."""
    drive: _Amplitude
    """kappa rho xi^2 - i xi c_p, the effect of the tilt on the bob."""
    a: _Amplitude
    """A, the factor of the tilt."""
    b: _Amplitude
    """B, the factor of the forcing."""
    signs: _Amplitude
    """(4/pi) [(1 + mu) nu + i k], the first harmonic of weight and friction."""


def _balance(p: Parameters, order: int = 1) -> _Balance:
    """Compute the coefficients at the frequency `order` times xi, for an odd `order`."""
    linear, c, rho, xi, e = Linear(p), p.hinge, p.inertia_ratio, order * p.xi, p.velocity_ratio
    # D is zero at the resonance of an undamped bob. Python would raise an error for the division by it.
    d = jnp.asarray(1.0 - p.lam * rho * xi**2 + 1j * xi * c)
    h = p.kappa * p.mu * rho * p.lam * xi**2 - 1j * xi * p.mu * p.lam * c
    drive = p.kappa * rho * xi**2 - 1j * xi * c
    a = -linear.m11 * xi**2 - linear.tilt + 1j * xi * linear.c1 - h * drive / d
    if order == 1:
        # Impacts depend on the first harmonic only: the size of the motion is that of its first harmonic.
        a = a + 1j * (4.0 / jnp.pi) ** 3 * (1.0 - e) / (1.0 + e) * (1.0 + p.mu * rho * p.nu**2) * xi**2
    # sgn(cos theta) has the harmonics +1, -1/3, +1/5, ...; -sgn(sin theta) has i, i/3, i/5, ...
    weight = linear.weight if order % 4 == 1 else -linear.weight
    return _Balance(d, drive, a, linear.tilt + h / d, 4.0 / (jnp.pi * order) * (weight + 1j * p.k))


def _abs2(z: _Amplitude) -> Number:
    return jnp.real(z) ** 2 + jnp.imag(z) ** 2


def _dot(z: _Amplitude, w: _Amplitude) -> Number:
    """Return Re(z* w)."""
    return jnp.real(z) * jnp.real(w) + jnp.imag(z) * jnp.imag(w)


class HarmonicBranches(NamedTuple):
    """Roots of a one-harmonic balance. Angles are in rad.

    The last axis has the upper and the lower branch, and zeros where a branch does not exist. At the
    resonance of an undamped bob the balance is not finite, and all numbers are NaN. As a rule the upper
    branch is stable. The lower branch is the saddle between rocking and rest; it exists while
    |B| f < (4/pi) |(1 + mu) nu + i k|.
    """

    amplitude: Float[Array, "*batch 2"]
    """Amplitude of the tilt."""
    swing: Float[Array, "*batch 2"]
    """Amplitude of the bob angle."""
    phase: Float[Array, "*batch 2"]
    """Phase xi tau of the forcing f sin(xi tau) at the upper turn, in (-pi, pi]."""
    exists: Bool[Array, "*batch 2"]
    """Whether the branch exists."""


def _branches_of(
    balance: _Balance, phi: Number, forcing: _Amplitude, exists: Bool[Array, "..."]
) -> HarmonicBranches:
    """Return the branches from amplitudes phi (any positive number where none exists) and forcings F."""
    z = (forcing - balance.drive * phi) / balance.d
    phase = jnp.arctan2(jnp.real(forcing), -jnp.imag(forcing))
    # Where the balance is not finite, it is unknown whether a branch exists.
    none = 0.0 * _abs2(balance.a)
    amplitude, swing, phase = (jnp.where(exists, x, none) for x in (phi, jnp.sqrt(_abs2(z)), phase))
    return HarmonicBranches(amplitude, swing, phase, exists)


@jax.numpy_dtype_promotion("standard")
def one_harmonic_branches(p: Parameters) -> HarmonicBranches:
    """Return both roots of the corrected one-harmonic balance (27), with friction and damping.

    The parametric term is neglected. Without a loss at impacts the upper branch is as a rule 1 to 5 % above
    the exact amplitude, and the lower branch 5 to 30 %. `neglected_harmonics` estimates the error. With e of
    at least 0.8 half of 300 random scenes have an upper branch within 1.5 % of the exact one; with e = 0.5 it
    is too small by 8 % in the median.

    Args:
        p: dimensionless parameters. Fields may be arrays.

    Raises:
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.0, lam=0.5, zeta=0.0, k=0.05, f=0.1, xi=2.0)
        >>> branches = tpd.theory.one_harmonic_branches(p)
        >>> [round(float(x), 4) for x in branches.amplitude], branches.exists.tolist()
        ([0.0664, 0.0355], [True, True])
    """
    check_parameters(p)
    balance = _balance(p)
    a2, half = _abs2(balance.a), _dot(balance.a, balance.signs)
    rest = _abs2(balance.signs) - _abs2(balance.b) * p.f**2
    # This form of half^2 - a2 rest does not subtract nearly equal numbers if the friction is small.
    discriminant = a2 * _abs2(balance.b) * p.f**2 - _dot(1j * balance.a, balance.signs) ** 2
    real = discriminant > 0
    reach = -half + jnp.sqrt(jnp.where(real, discriminant, 1.0))
    has_upper = real & (reach > 0)
    reach = jnp.where(has_upper, reach, 1.0)
    # The lower root follows from the product of the roots, rest / a2, again without a difference of nearly
    # equal numbers.
    exists = jnp.stack([has_upper, has_upper & (rest > 0)], axis=-1)
    phi = jnp.where(exists, jnp.stack([reach / a2, rest / reach], axis=-1), 1.0)
    balance = _Balance(*(x[..., None] for x in jnp.broadcast_arrays(*balance)))
    return _branches_of(balance, phi, -(balance.a * phi + balance.signs) / balance.b, exists)


class Harmonic1(NamedTuple):
    """Estimate of the stable branch with one harmonic."""

    amplitude: Number
    """Amplitude of the tilt, rad; zero if the branch does not exist."""
    swing: Number
    """Amplitude of the bob angle, rad; zero if the branch does not exist."""
    exists: Number
    """Whether the branch exists."""


def one_harmonic(p: Parameters) -> Harmonic1:
    """Return the larger root of the one-harmonic balance, which is the stable branch.

    Its amplitude is 1 to 5 % above the exact one. If the balance has no root, `exists` is False and both
    amplitudes are zero.

    Args:
        p: dimensionless parameters. Fields may be arrays.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.0, lam=0.5, zeta=0.0, k=0.05, f=0.1, xi=2.0)
        >>> round(float(tpd.theory.one_harmonic(p).amplitude), 4)
        0.0664
    """
    both = one_harmonic_branches(p)
    return Harmonic1(*(x[..., 0] for x in (both.amplitude, both.swing, both.exists)))


class Fold(NamedTuple):
    """Smallest forcing that sustains symmetric rocking, where both branches of the balance meet."""

    f: Number
    """Amplitude of the base acceleration over gravity."""
    amplitude: Number
    """Amplitude of the tilt at this forcing, rad."""
    phase: Number
    """Phase xi tau of the forcing f sin(xi tau) at the upper turn, in (-pi, pi]."""
    status: Status
    """near_fold; no_orbit if the branches do not meet at a positive amplitude, and all numbers are NaN."""


@jax.numpy_dtype_promotion("standard")
def fold(p: Parameters) -> Fold:
    """Return the fold of the one-harmonic balance, without iteration.

    With w = (4/pi) [(1 + mu) nu + i k] the smallest forcing and its amplitude are

        f_fold = |Im(A w*)|/(|A| |B|),    Phi_fold = -Re(A w*)/|A|^2.

    With less forcing the balance has no orbit. The fold exists if Phi_fold is positive, and it has a forcing
    above zero only with a loss: friction, impacts, or a damped hinge. In 839 random scenes f_fold is from 5 %
    below to 4 % above the fold of the exact orbits in nine of ten cases, and 1.8 % above it in the median;
    `tpd.fold_curve` computes the exact one. Motions with other periods can exist below the fold.

    Args:
        p: dimensionless parameters. Fields may be arrays. f is not used.

    Raises:
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.0, f=0.0, xi=3.0, e=0.9)
        >>> fold = tpd.theory.fold(p)
        >>> round(float(fold.f), 6), round(float(fold.amplitude), 5)
        (0.029343, 0.02694)
    """
    check_parameters(p)
    balance = _balance(p)
    a2, along = _abs2(balance.a), _dot(balance.a, balance.signs)
    across = _dot(1j * balance.a, balance.signs)
    # The branches merge at -Re(A w*)/|A|^2, which is no amplitude if it is negative.
    exists = along < 0.0
    # At the fold A Phi + w is perpendicular to A, so F = i Im(A w*) A/(|A|^2 B); across = -Im(A w*).
    forcing = -1j * across * balance.a / (a2 * balance.b)
    size = jnp.abs(across) / jnp.sqrt(a2 * _abs2(balance.b))
    phase = jnp.arctan2(jnp.real(forcing), -jnp.imag(forcing))
    size, amplitude, phase = (jnp.where(exists, x, jnp.nan) for x in (size, -along / a2, phase))
    code = jnp.where(exists, code_of(Status.near_fold), code_of(Status.no_orbit))
    return Fold(size, amplitude, phase, status_of(code))


class Neglected(NamedTuple):
    """Error of the one-harmonic balance, relative to its amplitude.

    The last axis is that of `HarmonicBranches`. Where the branch does not exist, the correction is zero and
    the bound infinite.
    """

    correction: Float[Array, "*batch 2"]
    """First-order correction: the exact amplitude is about (1 + correction) times that of the balance."""
    bound: Float[Array, "*batch 2"]
    """Estimate of the largest error of the balance: 2.5 times the sum of the sizes of the parts of the
    correction. The bound is not proved. In 300 random scenes it was correct for all 288 upper branches, and
    for 49 of the 51 lower branches that are orbits. The other 81 lower roots belong to no orbit, and their
    bound was 0.3 or more. It does not include the error of the loss at impacts: with e of 0.8 it was correct
    for 96 % of the upper branches, with e of 0.7 for 85 %."""


@jax.numpy_dtype_promotion("standard")
def neglected_harmonics(p: Parameters) -> Neglected:
    """Estimate the effect of the harmonics that the one-harmonic balance neglects.

    The third to eleventh harmonics of the signs pass through the linear transfer function 1/A(n xi) and add
    to the tilt at the turn. They also shift the times of crossing and turn. This shift rotates the first
    harmonics of weight and friction against the forcing, and so changes the balance itself.

    Args:
        p: dimensionless parameters. Fields may be arrays.

    Raises:
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.0, lam=0.5, zeta=0.0, k=0.05, f=0.1, xi=2.0)
        >>> round(float(tpd.theory.neglected_harmonics(p).correction[0]), 3)
        -0.033
    """
    check_parameters(p)
    balance, both = _balance(p), one_harmonic_branches(p)
    balance = _Balance(*(x[..., None] for x in jnp.broadcast_arrays(*balance)))
    phi = jnp.where(both.exists, both.amplitude, 1.0)
    # The sums over the harmonics: tilt at the turn, shift of the crossing, shift of the turn.
    at_turn, crossing, turn = 0.0, 0.0, 0.0
    for order in _HARMONICS:
        higher = _balance(p, order)
        tilt = jnp.asarray(-higher.signs / higher.a)[..., None]
        at_turn = at_turn + jnp.real(tilt)
        crossing = crossing + jnp.real(tilt * 1j**order) / phi
        turn = turn - order * jnp.imag(tilt) / phi
    # The shifts rotate the first harmonics of weight and friction. The balance then gives the change of Phi.
    weight, friction = jnp.real(balance.signs), jnp.imag(balance.signs)
    rotation = friction * turn - 1j * weight * crossing
    pull = balance.a * phi + balance.signs
    shift = -_dot(pull, rotation) / _dot(pull, balance.a)
    correction, bound = (shift + at_turn) / phi, SAFETY * (jnp.abs(shift) + jnp.abs(at_turn)) / phi
    return Neglected(jnp.where(both.exists, correction, 0.0), jnp.where(both.exists, bound, jnp.inf))


@jax.numpy_dtype_promotion("standard")
def parametric_branches(p: Parameters) -> HarmonicBranches:
    """Return the roots of the one-harmonic balance with the parametric term s f (1 + mu) nu phi sin(xi tau).

    The balance is (23) without a pendulum, and the corrected (27) with a pendulum. The parametric term is of
    second order in the angles, like other terms that (25) neglects.

    Args:
        p: dimensionless parameters. Fields are single numbers; use `jax.vmap` for a batch.

    Raises:
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.0, lam=0.5, zeta=0.0, k=0.05, f=0.1, xi=2.0)
        >>> [round(float(x), 4) for x in tpd.theory.parametric_branches(p).amplitude]
        [0.0666, 0.0354]
    """
    check_parameters(p)
    p = as_arrays(p)
    balance = _balance(p)
    # The first harmonic of s phi sin(xi tau) is linear in Phi and in the real and imaginary parts of F; the
    # factor of Im F is half of that of Re F. Hence Re F and Im F solve two linear equations whose
    # coefficients are linear in Phi, and each is a quotient of two quadratic polynomials.
    pull = 4.0 / (3.0 * jnp.pi) * Linear(p).weight
    polynomials = _forcing_polynomials(balance, pull)
    square = [jnp.convolve(q, q) for q in polynomials]
    quartic = square[0] + square[1] - p.f**2 * square[2]
    exists, phi = _two_largest(quartic)
    real, imag, scale = (jnp.polyval(q, phi) for q in polynomials)
    balance = _Balance(*(jnp.asarray(x)[None] for x in balance))
    return _branches_of(balance, phi, (real + 1j * imag) / jnp.where(scale == 0, 1.0, scale), exists)


def _forcing_polynomials(balance: _Balance, pull: Number) -> tuple[Array, Array, Array]:
    """Return quadratic polynomials in Phi, highest power first, with F = (first + i second) / third."""

    def line(slope: Number, level: Number) -> Array:
        return jnp.stack([jnp.asarray(slope), jnp.asarray(level)])

    real, imag = (line(part(balance.a), part(balance.signs)) for part in (jnp.real, jnp.imag))
    cosine, sine = line(2.0 * pull, jnp.real(balance.b)), line(pull, jnp.real(balance.b))
    turn = line(jnp.zeros_like(pull), jnp.imag(balance.b))
    # Cramer's rule for the two equations, with polynomials in the place of numbers.
    first = -jnp.convolve(sine, real) - jnp.convolve(turn, imag)
    second = jnp.convolve(turn, real) - jnp.convolve(cosine, imag)
    return first, second, jnp.convolve(cosine, sine) + jnp.convolve(turn, turn)


def _two_largest(quartic: Float[Array, "5"]) -> tuple[Bool[Array, "2"], Float[Array, "2"]]:
    """Return existence and value of the two largest positive roots. The values are differentiable."""
    roots = jnp.roots(stop_gradient(quartic), strip_zeros=False)
    real, imag = jnp.real(roots), jnp.imag(roots)
    is_root = (jnp.abs(imag) <= _REAL * jnp.abs(real)) & (real > 0)
    order = jnp.argsort(-jnp.where(is_root, real, 0.0))[:2]
    is_root, root = is_root[order], jnp.where(is_root, real, 1.0)[order]
    # `jnp.roots` is not differentiated. One Newton step changes a converged root by rounding only, and has
    # the derivative of the root.
    slope = jnp.polyval(jnp.polyder(stop_gradient(quartic)), root)
    polished = root - jnp.polyval(quartic, root) / jnp.where(is_root, slope, 1.0)
    return is_root, jnp.where(is_root, polished, 1.0)
