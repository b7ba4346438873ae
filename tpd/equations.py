"""The linear equations of block and pendulum, the paper's (25) with its misprints corrected.

With s the sign of the tilt phi, sigma that of its rate, and primes d/dtau:

    [1 + mu rho (4 + nu^2)] phi'' - 2 mu rho lam psi'' - (1 + 2 mu) phi + mu lam c_p (phi' - psi')
        = -s (1 + mu) nu - sigma k - f (1 + 2 mu) sin(xi tau)
    -2 rho phi'' + lam rho psi'' + psi + c_p (psi' - phi') = f sin(xi tau)

Everything else in the package is built from `Linear` and never writes a coefficient again.
"""

from __future__ import annotations

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from tpd.parameters import Number, Numbers, Parameters, State


class Linear(eqx.Module):
    """Coefficients of the linear equations (25): M q'' + C q' + K q = moments, q = (phi, psi)."""

    m11: Number
    m12: Number
    m21: Number
    m22: Number
    determinant: Number
    c1: Number
    c2: Number
    tilt: Number
    weight: Number
    friction: Number
    f: Number
    xi: Number
    bias: Number

    def __init__(self, p: Parameters) -> None:
        rho, c = p.inertia_ratio, p.hinge
        self.m11 = 1.0 + p.mu * rho * (4.0 + p.nu**2)
        self.m12 = -2.0 * p.mu * rho * p.lam
        self.m21 = -2.0 * rho
        self.m22 = p.lam * rho
        self.determinant = self.m22 * (1.0 + p.mu * rho * p.nu**2)
        self.c1 = p.mu * p.lam * c
        self.c2 = c
        self.tilt = 1.0 + 2.0 * p.mu
        self.weight = (1.0 + p.mu) * p.nu
        self.friction = p.k
        self.f = p.f
        self.xi = p.xi
        self.bias = p.mu * c * (p.lam - 2.0)

    @property
    def mass(self) -> Float[Array, "2 2"]:
        """The mass matrix M."""
        return jnp.array([[self.m11, self.m12], [self.m21, self.m22]])

    @property
    def damping(self) -> Float[Array, "2 2"]:
        """The damping matrix C of the hinge."""
        return jnp.array([[self.c1, -self.c1], [-self.c2, self.c2]])

    @property
    def stiffness(self) -> Float[Array, "2 2"]:
        """The stiffness matrix K: the inverted block, and the bob's weight."""
        return jnp.array([[-self.tilt, 0.0], [0.0, 1.0]])

    def rates(self, y: State, step: Number, drag: Number, sine: Number) -> State:
        """d/dtau of the state (phi, psi, phi', psi').

        `step` stands for sgn(phi), `drag` for sgn(phi'), `sine` for sin(xi tau); each may be
        smoothed, zero (the free system), or a constant sign.
        """
        phi, psi, dphi, dpsi = y
        slip = dphi - dpsi
        r1 = -step * self.weight - drag * self.friction - self.f * self.tilt * sine
        r1 = r1 + self.tilt * phi - self.c1 * slip
        r2 = self.f * sine - psi + self.c2 * slip
        ddphi = (self.m22 * r1 - self.m12 * r2) / self.determinant
        ddpsi = (self.m11 * r2 - self.m21 * r1) / self.determinant
        return jnp.stack([dphi, dpsi, ddphi, ddpsi])

    def holding_moment(self, y: State | Numbers, sine: Number) -> Number:
        """R, the moment on a block held still (phi' = 0); it stays held while friction and
        weight can balance it."""
        phi, psi, _, dpsi = y
        return self.tilt * phi - self.f * sine - (self.tilt - 1.0) * psi + self.bias * dpsi

    @property
    def beyond_return(self) -> Number:
        """A tilt from which neither friction, forcing nor bob brings the linear block back: ten
        times that at which weight, friction and forcing balance."""
        return 10.0 * (self.weight + self.friction + self.f * self.tilt) / self.tilt

    def energy(self, y: State, mass_ratio: Number, length_ratio: Number) -> Number:
        """The energy of the linear model without forcing, conserved when k = zeta = f = 0, e = 1."""
        phi, psi, dphi, dpsi = y
        bob = mass_ratio * length_ratio
        kinetic = self.m11 * dphi**2 + 2.0 * self.m12 * dphi * dpsi + bob * self.m22 * dpsi**2
        potential = -self.tilt * phi**2 + bob * psi**2
        return 0.5 * (kinetic + potential) + self.weight * jnp.abs(phi)


def smoothed_rates(
    p: Parameters, tilt_width: Number, rate_width: Number
) -> Callable[[Number, State, None], State]:
    """The vector field of (25) with sgn(x) smoothed to tanh(x/width), for an ODE solver."""
    linear = Linear(p)

    def field(tau: Number, y: State, args: None) -> State:
        del args
        step, drag = jnp.tanh(y[0] / tilt_width), jnp.tanh(y[2] / rate_width)
        return linear.rates(y, step, drag, jnp.sin(p.xi * tau))

    return field
