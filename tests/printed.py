"""Formulas of the paper as printed, including their misprints; notation as in `tpd.Parameters`."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number


def printed_free_amplitude(nu: Number, frequency: Number) -> Number:
    """Return the tilt (rad) of free rocking of frequency Omega_0 by (11) as printed.

    The printed formula has the inverse function of cosh. The result is NaN for Omega_0 > pi/2, where this
    function has no value. `tpd.theory.free_motion` is correct.
    """
    return nu * (1.0 - jnp.arccosh(jnp.asarray(0.5 * jnp.pi / frequency)))


class Quarter(NamedTuple):
    """Result of (19).

    The last axis has cos gamma positive and negative. NaN where |sin gamma| would exceed 1.
    """

    amplitude: Float[Array, "*batch 2"]
    """Amplitude Phi, rad."""
    gamma: Float[Array, "*batch 2"]
    """Phase of the forcing f cos(xi tau - gamma) at the turn, rad, in (-pi, pi]."""


def printed_quarter_crossing(p: Parameters, frequency: Number | None = None) -> Quarter:
    """Evaluate (19) as printed, for rocking without a pendulum at the frequency `frequency`.

    The formula assumes that the block crosses phi = 0 after a quarter of its period. The default of
    `frequency` (Omega) is xi; xi/3 is a subharmonic.
    """
    omega = p.xi if frequency is None else frequency
    return _quarter(p, omega, p.k * (1.0 + p.xi**2) * jnp.tanh(0.5 * jnp.pi / omega) / p.f)


def quarter_crossing(p: Parameters) -> Quarter:
    """Evaluate (19) at Omega = xi with the correct sine, -1/xi times the printed one, from (16) to (18).

    The result is still not an orbit. The formula assumes that the block crosses after a quarter of the
    period, but the tilt and the rate at the crossing then agree from both sides only if k = 0.
    `symmetric_orbits` returns the exact solution.
    """
    sine = -p.k * (1.0 + p.xi**2) * jnp.tanh(0.5 * jnp.pi / p.xi) / (p.xi * p.f)
    return _quarter(p, p.xi, sine)


def _quarter(p: Parameters, omega: Number, sine: Number) -> Quarter:
    """Compute Phi of (19) from (18), which has xi, with the tilt zero at pi/(2 Omega)."""
    late, g = 0.5 * jnp.pi / omega, p.f / (1.0 + p.xi**2)
    # The last axis has the two solutions for cos gamma.
    sine = jnp.asarray(sine)[..., None]
    # The result is NaN where no phase exists.
    cosine = jnp.sqrt(jnp.where(jnp.abs(sine) <= 1.0, 1.0 - sine**2, jnp.nan)) * jnp.array([1.0, -1.0])
    pull, level, c = (
        jnp.asarray(x)[..., None] for x in (1.0 - p.xi * jnp.sinh(late), p.nu - p.k, jnp.cosh(late))
    )
    g = jnp.asarray(g)[..., None]
    amplitude = level - g * cosine + (-level + g * sine * pull) / c
    return Quarter(amplitude, jnp.arctan2(jnp.broadcast_to(sine, cosine.shape), cosine))


def printed_balance_without_pendulum(p: Parameters, amplitude: Number) -> tuple[Number, Number]:
    """Evaluate (23) as printed: cos gamma and sin gamma of the block without a pendulum at the tilt Phi.

    An orbit exists where the squares add up to 1, see `tpd.theory.parametric_branches`.
    """
    cosine = (4.0 * p.nu - jnp.pi * amplitude * (1.0 + p.xi**2)) / (
        p.f * (jnp.pi + 8.0 / 3.0 * p.nu * amplitude)
    )
    sine = 4.0 * p.k / (p.f * (jnp.pi + 4.0 / 3.0 * p.nu * amplitude))
    return cosine, sine


def printed_pendulum_balance(p: Parameters) -> tuple[Float[Array, "*batch 2"], Float[Array, "*batch 2"]]:
    """Evaluate (27) as printed: (Phi, Psi) in rad, for an undamped pendulum and no friction.

    The last axis has the forcing f and -f, which are the two branches. Where the printed signs are
    meaningful, Phi is negative, and the amplitude is -Phi.
    """
    rho, signs = p.inertia_ratio, jnp.array([1.0, -1.0])
    f = jnp.asarray(p.f)[..., None] * signs
    nu, mu, lam, x2, rho = (jnp.asarray(x)[..., None] for x in (p.nu, p.mu, p.lam, p.xi**2, rho))
    # The coefficients c11 to c22 and r1, r2 are those of the printed equation, with its errors.
    c11 = 1.0 + 2.0 * mu + (1.0 + mu * rho) * x2 + 8.0 / 3.0 * nu * f * (1.0 + mu)
    c12, c21, c22 = 2.0 * lam * rho * mu * x2, -2.0 * rho * x2, 1.0 - lam * rho * x2
    r1, r2 = (1.0 + mu) * (f - 4.0 / jnp.pi * nu), -f
    determinant = c11 * c22 - c12 * c21
    # Cramer's rule.
    return (r1 * c22 - c12 * r2) / determinant, (c11 * r2 - c21 * r1) / determinant
