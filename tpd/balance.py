"""Closed forms: the uplift margin and the one-harmonic balance (27), corrected.

With phi = Re Phi exp(i theta), psi = Re Z exp(i theta) and the forcing Re F exp(i theta), |F| = f:

    D = 1 - lam rho xi^2 + i xi c_p,   h = 2 mu rho lam xi^2 - i xi mu lam c_p,   B = 1 + 2 mu + h/D
    A = -[1 + mu rho (4 + nu^2)] xi^2 - (1 + 2 mu) + i xi mu lam c_p - h (2 rho xi^2 - i xi c_p)/D
    A Phi + B F + (4/pi) [(1 + mu) nu + i k] = 0

so that |A Phi + (4/pi)(...)|^2 = |B|^2 f^2 is a quadratic in Phi: two branches and no iteration.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp

from tpd.equations import Linear
from tpd.parameters import Number, Parameters


class Uplift(NamedTuple):
    """Whether a block at rest under the settled pendulum can lift. It may rock all the same: from
    another start, or because the sudden start lifts it first.

    `margin` is 1 - |B| f / ((1 + mu) nu + k): positive, and the resting block never lifts;
    `stroke` is the bob's settled angle (rad) under the resting block. They speak of the settled
    pendulum: a start from rest may lift the block once before that.
    """

    margin: Number
    stroke: Number


def _transfer(p: Parameters) -> tuple[Number, Number, Number]:
    """(|D|^2, B as real and imaginary parts) of the pendulum under a still block."""
    rho, c = p.inertia_ratio, p.hinge
    real, imaginary = 1.0 - p.lam * rho * p.xi**2, p.xi * c
    size2 = real**2 + imaginary**2
    h_real, h_imag = 2.0 * p.mu * rho * p.lam * p.xi**2, -p.xi * p.mu * p.lam * c
    b_real = 1.0 + 2.0 * p.mu + (h_real * real + h_imag * imaginary) / size2
    b_imag = (h_imag * real - h_real * imaginary) / size2
    return size2, b_real, b_imag


def uplift(p: Parameters) -> Uplift:
    """The no-uplift criterion |B| f <= (1 + mu) nu + k, in closed form and differentiable."""
    size2, b_real, b_imag = _transfer(p)
    demand = p.f * jnp.sqrt(b_real**2 + b_imag**2)
    capacity = (1.0 + p.mu) * p.nu + p.k
    return Uplift(1.0 - demand / capacity, p.f / jnp.sqrt(size2))


class Harmonic1(NamedTuple):
    """The one-harmonic estimate of the stable branch: amplitudes in rad, and whether it exists."""

    amplitude: Number
    stroke: Number
    exists: Number


def one_harmonic(p: Parameters) -> Harmonic1:
    """The larger root of the one-harmonic balance, the stable branch (1 to 5 % above the exact).

    Where there is no such orbit, `exists` is False and both amplitudes are zero.
    """
    linear, c, rho = Linear(p), p.hinge, p.inertia_ratio
    d = 1.0 - p.lam * rho * p.xi**2 + 1j * p.xi * c
    h = 2.0 * p.mu * rho * p.lam * p.xi**2 - 1j * p.xi * p.mu * p.lam * c
    drive = 2.0 * rho * p.xi**2 - 1j * p.xi * c
    a = -linear.m11 * p.xi**2 - linear.tilt + 1j * p.xi * linear.c1 - h * drive / d
    b = linear.tilt + h / d
    g = (4.0 / jnp.pi) * (linear.weight + 1j * p.k)
    a2, b2, g2 = (jnp.real(x) ** 2 + jnp.imag(x) ** 2 for x in (a, b, g))
    half = jnp.real(a) * jnp.real(g) + jnp.imag(a) * jnp.imag(g)
    discriminant = half**2 - a2 * (g2 - b2 * p.f**2)
    real = discriminant > 0
    root = (-half + jnp.sqrt(jnp.where(real, discriminant, 1.0))) / a2
    exists = real & (root > 0)
    phi = jnp.where(exists, root, 1.0)
    forcing = -(a * phi + g) / b
    z = (forcing - drive * phi) / d
    bob = jnp.sqrt(jnp.real(z) ** 2 + jnp.imag(z) ** 2)
    return Harmonic1(jnp.where(exists, phi, 0.0), jnp.where(exists, bob, 0.0), exists)
