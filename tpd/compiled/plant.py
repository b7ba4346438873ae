"""The plant of the linear equations (25): all numbers that do not change from arc to arc.

The quartic det(M s^2 + C s + K) has one positive root s1, with which the block falls over, and one negative
root s2 apart from the others. The other two roots are kept together as z^2 + p z + q, whether the bob
oscillates (a complex pair) or creeps (two real roots). So p and q have derivatives even at critical damping,
where the two roots meet.

All formulas hold for real and for complex numbers. Complex numbers give derivatives: an input with the
imaginary part `STEP` gives results whose imaginary parts are `STEP` times their derivatives. The derivatives
are exact to rounding, because nothing is subtracted (W. Squire and G. Trapp, SIAM Review 40, 1998). Every
function here is analytic, and branches depend on real parts only.

Numba takes 0.3 s to load. Modules import this one only when it is needed.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numba
import numba.extending
import numpy as np

from tpd.compiled.columns import KAPPA, LAM, MU, NU, RHO, XI, ZETA, E, F, K
from tpd.core.machine_code import PIPELINE
from tpd.scene import impacts

STEP = 1e-100
"""Imaginary part of an input in whose direction a derivative is computed.

Its square vanishes next to 1, even times a derivative of 1e90 of a chaotic motion. Its third power is still a
normal number.
"""
_FIELDS = (
    "nu mu lam zeta k f xi e kappa rho pull linear quick slack up weight bias m11 m12 m21 m22 c1 c2 "
    "s1 s2 p q a0 a1 a2 a3 al0 al1 al2 al3 b0 b1 b2 b3 bl0 bl1 bl2 bl3 "
    "tilt_sin tilt_cos bob_sin bob_cos"
)
"""Fields of a plant.

- `nu` to `kappa`: parameters. `xi` is the frequency of a harmonic, or the duration of a piece of another
  forcing (`tpd.compiled.forcing.Forcing`).
- `rho`, `pull`: a parameter, and mu rho lam. `linear`: 1 for the equations (25), 0 for (4). `quick`: the
  inverse of the shortest time scale.
- `slack`: a held block is released if the moment on it exceeds the holding moment by more than this.
- `up`, `weight`, `bias`, `m11` to `c2`: coefficients of the equations, see `tpd.theory.equations.Linear`.
- `s1`, `s2`, `p`, `q`: the time scales of the slipping block. They and what follows are for symmetric orbits.
- `a0` to `a3`, `b0` to `b3`: shapes of the modes s1 and s2 over (phi, psi, phi', psi').
- `al0` to `al3`, `bl0` to `bl3`: left eigenvectors, which project a state onto these modes.
- `tilt_sin` to `bob_cos`: responses to sin(xi t) of tilt and bob, as factors of sine and cosine.
"""
PLANT = np.dtype([(name, np.float64) for name in _FIELDS.split()])
COMPLEX_PLANT = np.dtype([(name, np.complex128) for name in _FIELDS.split()])
# Plants are records, because Numba passes a record as one address, and a tuple as all of its numbers.


def places(stop: int, start: int = 0) -> tuple[Any, ...]:
    """Return integers from `start` to before `stop`, which serve as names of columns and signals."""
    # Numba treats the value of a plain integer as part of its type, and would compile a function once for
    # each value.
    return tuple(np.arange(start, stop))


NONE, ONE = places(2)
"""The numbers zero and one, of the same type for Numba as a variable."""
ONLY = NONE
"""Index of the only item of an array."""


def compiled(function: Callable[..., Any], *, inline: bool = False) -> Any:
    """Compile a function with Numba at its first call, or within its caller if `inline`."""
    # A type checker may have wrapped the function, and Numba needs the original one. Division by zero gives
    # infinity as in NumPy, and needs no check. Python and C call only the entry points: wrappers for all
    # functions would take a third of the time to compile.
    options: Any = {"nogil": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    options |= {"inline": "always"} if inline else {}
    compiler = numba.njit(error_model="numpy", **PIPELINE, **options)
    return compiler(inspect.unwrap(function))


def shared(function: Callable[..., Any], form: Callable[..., Any] | None = None) -> Any:
    """Let compiled code call a function of the package, in another form if one is passed."""
    # Python keeps the function itself, which a type checker may have wrapped. Numba gets the original one.
    plain = inspect.unwrap(function) if form is None else form
    options: Any = {"nogil": True, "error_model": "numpy", **PIPELINE}
    numba.extending.overload(function, jit_options=options, strict=False)(lambda *_: plain)
    return function


shared(impacts.select, lambda condition, of_true, of_false: of_true if condition else of_false)


def part(function: Callable[..., Any]) -> Any:
    """Compile a function as a part of its only caller. Numba then optimises it once instead of twice."""
    return compiled(function, inline=True)


@compiled
def _positive_root(a4, a3, a2, a1, a0):
    """Return the positive root of the quartic.

    The coefficients change their sign once, so that there is exactly one positive root.
    """
    # The even part of the quartic vanishes at the root without damping, and the odd part at the root with a
    # locked hinge. The root lies between the two. Above it the quartic is convex, so that Newton's method
    # from above converges without passing the root.
    free = np.sqrt(-2.0 * a0 / (a2 + np.sqrt(a2 * a2 - 4.0 * a4 * a0)))
    locked = np.sqrt(abs(a1) / a3) if a3 > 0.0 else 0.0
    s = max(free, locked)
    for _ in range(8):
        s = _newton_step(s, a4, a3, a2, a1, a0)
    return s


@compiled
def _isolated_root(b3, b2, b1, b0):
    """Return the real root of the cubic that is farthest from the mean of the roots.

    This root is apart from the other two.
    """
    # Shifted to its mean, the cubic has no quadratic term. Its roots are then a cosine, cosh or sinh of a
    # third of an angle. The isolated root lies on the side opposite to the sign of the cubic at the mean.
    mean = -b2 / (3.0 * b3)
    third = (b1 - b2 * b2 / (3.0 * b3)) / b3
    level = (((b3 * mean + b2) * mean + b1) * mean + b0) / b3
    size = np.sqrt(max(abs(third), 1e-300) / 3.0)
    ratio = abs(level) / (2.0 * size**3)
    if third > 0.0:
        factor = np.sinh(np.arcsinh(ratio) / 3.0)
    elif ratio < 1.0:
        factor = np.cos(np.arccos(ratio) / 3.0)
    else:
        factor = np.cosh(np.arccosh(ratio) / 3.0)
    return mean - np.sign(level) * 2.0 * size * factor


@compiled
def _newton_step(s, a4, a3, a2, a1, a0):
    """Return a root after one Newton step, which also gives the derivative of the root."""
    value = (((a4 * s + a3) * s + a2) * s + a1) * s + a0
    slope = ((4.0 * a4 * s + 3.0 * a3) * s + 2.0 * a2) * s + a1
    return s - value / slope


@compiled
def _roots(a4, a3, a2, a1, a0):
    """Return s1, s2 and the coefficients p and q of the pair."""
    # Only the two real roots that never meet another one are solved for. The pair follows from the remaining
    # factor. The roots are computed in real numbers. One Newton step on the complex quartic then adds the
    # derivatives (implicit function theorem), and removes the rounding error of the division by the first
    # root.
    r4, r3, r2, r1, r0 = a4.real, a3.real, a2.real, a1.real, a0.real
    first = _positive_root(r4, r3, r2, r1, r0)
    b2 = r3 + first * r4
    b1 = r2 + first * b2
    second = _isolated_root(r4, b2, b1, r1 + first * b1)
    for _ in range(2):
        second = _newton_step(second, r4, r3, r2, r1, r0)
    s1, s2 = _newton_step(first, a4, a3, a2, a1, a0), _newton_step(second, a4, a3, a2, a1, a0)
    return s1, s2, a3 / a4 + s1 + s2, a0 / (a4 * s1 * s2)


@compiled
def _mode(s, m11, m12, m21, m22, c1, c2, up):
    """Return the shape of a real mode over (phi, psi), and its left eigenvector over the whole state."""
    p11, p12, p21, p22 = s * m11 + c1, s * m12 - c1, s * m21 - c2, s * m22 + c2
    a, b, c, d = s * p11 - up, s * p12, s * p21, s * p22 + 1.0
    v0, v1 = d, -c
    # The matrix has rank one, so that either column gives the vector. For a massless bob one of the columns
    # vanishes.
    if abs(d.real) >= abs(a.real):
        u0, u1 = d, -b
    else:
        u0, u1 = -c, a
    t0 = (p11 + s * m11) * v0 + (p12 + s * m12) * v1
    t1 = (p21 + s * m21) * v0 + (p22 + s * m22) * v1
    norm = u0 * t0 + u1 * t1
    l0, l1 = (u0 * p11 + u1 * p21) / norm, (u0 * p12 + u1 * p22) / norm
    l2, l3 = (u0 * m11 + u1 * m21) / norm, (u0 * m12 + u1 * m22) / norm
    return v0, v1, l0, l1, l2, l3


@compiled
def _responses(m11, m12, m21, m22, c1, c2, up, f, xi):
    """Return the harmonic responses H(i xi) of tilt and bob.

    With P = M s^2 + C s + K and r the factors of the forcing, H = P^-1 r.
    """
    # The imaginary unit of the frequency differs from that of the derivatives. Therefore the frequency
    # response is computed with pairs of numbers: `p1` and `p2` are the imaginary parts of both rows of P.
    x2, p1, p2, r1 = xi * xi, xi * c1, xi * c2, -f * up
    a, b, c, d = -up - x2 * m11, -x2 * m12, -x2 * m21, 1.0 - x2 * m22
    # The determinant of P, and by Cramer's rule the products of it with both responses.
    real, imaginary = a * d - p1 * p2 - (b * c - p1 * p2), a * p2 + p1 * d - (-b * p2 - p1 * c)
    tilt, tilt_i, bob, bob_i = d * r1 - b * f, p2 * r1 + p1 * f, a * f - c * r1, p1 * f + p2 * r1
    size = real * real + imaginary * imaginary
    tilts = (tilt * real + tilt_i * imaginary) / size, (tilt_i * real - tilt * imaginary) / size
    return *tilts, (bob * real + bob_i * imaginary) / size, (bob_i * real - bob * imaginary) / size


@compiled
def growing_mode(m11, m12, m21, m22, c1, c2, up):
    """Return the left eigenvector over (phi, psi, phi', psi') of the growing motion of a tilted block."""
    a4, a3 = m11 * m22 - m12 * m21, m11 * c2 + m22 * c1 + m12 * c2 + m21 * c1
    a2, a1, a0 = m11 - up * m22, c1 - up * c2, -up
    s = _newton_step(_positive_root(a4.real, a3.real, a2.real, a1.real, a0.real), a4, a3, a2, a1, a0)
    _, _, l0, l1, l2, l3 = _mode(s, m11, m12, m21, m22, c1, c2, up)
    return l0, l1, l2, l3


@compiled
def coefficients(x, linear, q):
    """Write the coefficients of the equations into a plant. `linear` is 1 for (25) and 0 for (4)."""
    nu, mu, lam, zeta, k, f = x[NU], x[MU], x[LAM], x[ZETA], x[K], x[F]
    xi, rho, e, kappa = x[XI], x[RHO], x[E], x[KAPPA]
    hinge = 2.0 * zeta * np.sqrt(lam * rho)
    q.nu, q.mu, q.lam, q.zeta, q.k, q.f, q.xi = nu, mu, lam, zeta, k, f, xi
    q.e, q.kappa, q.rho, q.pull, q.slack, q.linear = e, kappa, rho, mu * rho * lam, 0.0 * k, linear
    q.up, q.weight, q.bias = 1.0 + kappa * mu, (1.0 + mu) * nu, mu * hinge * (lam - kappa)
    q.m11, q.m12 = 1.0 + mu * rho * (kappa * kappa + nu * nu), -kappa * mu * rho * lam
    q.m21, q.m22, q.c1, q.c2 = -kappa * rho, lam * rho, mu * lam * hinge, hinge
    # The largest factors of angles and of rates in the accelerations.
    by = 1.0 / abs(q.m11 * q.m22 - q.m12 * q.m21)
    of_angles = by * max(abs(q.m22 * q.up) + abs(q.m12), abs(q.m21 * q.up) + abs(q.m11))
    of_rates = by * max(abs(q.m22 * q.c1) + abs(q.m12 * q.c2), abs(q.m21 * q.c1) + abs(q.m11 * q.c2))
    q.quick = np.sqrt(max(of_angles, abs(xi * xi))) + 2.0 * of_rates


@compiled
def plant(x, q):
    """Fill a plant with the numbers that follow from a row of parameters."""
    coefficients(x, 1.0, q)
    nu, mu, lam, f, xi, rho, kappa = x[NU], x[MU], x[LAM], x[F], x[XI], x[RHO], x[KAPPA]
    m11, m12, m21, m22, c1, c2, up = q.m11, q.m12, q.m21, q.m22, q.c1, q.c2, q.up
    # Coefficients of the characteristic quartic.
    d = 1.0 + mu * rho * nu * nu
    a4, a3 = lam * rho * d, c2 * (d + mu * rho * (kappa - lam) * (kappa - lam))
    a2, a1, a0 = m11 - up * lam * rho, -c2 * (up - mu * lam), -up
    q.s1, q.s2, q.p, q.q = _roots(a4, a3, a2, a1, a0)
    q.a0, q.a1, q.al0, q.al1, q.al2, q.al3 = _mode(q.s1, m11, m12, m21, m22, c1, c2, up)
    q.b0, q.b1, q.bl0, q.bl1, q.bl2, q.bl3 = _mode(q.s2, m11, m12, m21, m22, c1, c2, up)
    q.a2, q.a3, q.b2, q.b3 = q.s1 * q.a0, q.s1 * q.a1, q.s2 * q.b0, q.s2 * q.b1
    q.tilt_sin, q.tilt_cos, q.bob_sin, q.bob_cos = _responses(m11, m12, m21, m22, c1, c2, up, f, xi)
