"""Equations of motion of block and pendulum: the paper's (25) with its misprints corrected, and its (4).

With s the sign of the tilt phi, sigma that of its rate, and primes d/dtau:

    [1 + mu rho (4 + nu^2)] phi'' - 2 mu rho lam psi'' - (1 + 2 mu) phi + mu lam c_p (phi' - psi')
        = -s (1 + mu) nu - sigma k - f (1 + 2 mu) sin(xi tau)
    -2 rho phi'' + lam rho psi'' + psi + c_p (psi' - phi') = f sin(xi tau)

`Linear` holds these coefficients; every solver of (25) is built on it. `Equations` is the vector field of
(25) with or without its parametric term, or of (4), from which (25) follows for small angles. With
S = s nu sin(phi - psi) + 2 cos(phi - psi) and C = s nu cos(phi - psi) - 2 sin(phi - psi), (4) reads

    [1 + mu rho (4 + nu^2)] phi'' - mu rho lam S psi'' + mu rho lam C psi'^2
        + f [s (1 + mu) nu sin phi + (1 + 2 mu) cos phi] sin(xi tau) + s (1 + mu) nu cos phi
        - (1 + 2 mu) sin phi + sigma k + mu lam c_p (phi' - psi') = 0
    -rho S phi'' + lam rho psi'' - rho C phi'^2 - f cos psi sin(xi tau) + sin psi + c_p (psi' - phi') = 0
"""

from __future__ import annotations

import enum
from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jax.tree_util import Partial

from tpd.core import checks
from tpd.scene.impacts import linear_bob_change, linear_ratio
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State


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
    bias: Number

    def __init__(self, p: Parameters) -> None:
        rho, c = p.inertia_ratio, p.hinge
        self.m11 = 1.0 + p.mu * rho * (4.0 + p.nu**2)
        self.m12 = -2.0 * p.mu * rho * p.lam
        self.m21 = -2.0 * rho
        self.m22 = p.lam * rho
        # m11 m22 - m12 m21, written so that nothing cancels where mu is large or nu small.
        self.determinant = self.m22 * (1.0 + p.mu * rho * p.nu**2)
        self.c1 = p.mu * p.lam * c
        self.c2 = c
        self.tilt = 1.0 + 2.0 * p.mu
        self.weight = (1.0 + p.mu) * p.nu
        self.friction = p.k
        self.f = p.f
        # Factor of psi' in the moment on a held block: see `tpd.exact.contact_kernel.moment`.
        self.bias = p.mu * c * (p.lam - 2.0)

    def rates(self, y: State, step: Number, drag: Number, sine: Number) -> State:
        """Derivative d/dtau of the state (phi, psi, phi', psi').

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


class Terms(enum.StrEnum):
    """Terms of the equations of motion (4) that a model keeps."""

    linear = "linear"
    """(25) without its parametric term, which has an exact solution between events."""
    parametric = "parametric"
    """(25) with s f (1 + mu) nu phi sin(xi tau) on the left, of second order in the angles."""
    nonlinear = "nonlinear"
    """(4) with all terms."""

    @classmethod
    def _missing_(cls, value: object) -> None:
        """Raise `ValueError` for a word that is none of the terms."""
        checks.one_of("terms", value, tuple(cls))


class Equations(eqx.Module):
    """Vector field of (25) or (4), for models that integrate it numerically."""

    linear: Linear
    p: Parameters
    rho: Number
    terms: Terms = eqx.field(static=True)

    def __init__(self, p: Parameters, terms: Terms) -> None:
        self.linear, self.p, self.rho, self.terms = Linear(p), p, p.inertia_ratio, terms

    def rates(self, y: State, step: Number, drag: Number, sine: Number) -> State:
        """Derivative d/dtau of the state; arguments as in `Linear.rates`."""
        phi, psi, dphi, dpsi = y
        p, linear, rho, slip = self.p, self.linear, self.rho, dphi - dpsi
        if self.terms is not Terms.nonlinear:
            rates = linear.rates(y, step, drag, sine)
            if self.terms is Terms.linear:
                return rates
            # The parametric term is one more moment on the block, so it moves both angles through the mass
            # matrix.
            moment = -step * linear.f * linear.weight * phi * sine
            by_moment = jnp.stack([linear.m22, -linear.m21]) / linear.determinant
            return rates + jnp.concatenate([jnp.zeros(2), by_moment * moment])
        sin, cos, lean_sin, lean_cos = jnp.sin(phi), jnp.cos(phi), jnp.sin(phi - psi), jnp.cos(phi - psi)
        big_s, big_c = step * p.nu * lean_sin + 2.0 * lean_cos, step * p.nu * lean_cos - 2.0 * lean_sin
        # Moments on the block: weight and base motion, the centripetal force on the bob, friction and hinge.
        r1 = linear.tilt * sin - step * linear.weight * cos
        r1 = r1 - linear.f * sine * (step * linear.weight * sin + linear.tilt * cos)
        r1 = r1 - p.mu * rho * p.lam * big_c * dpsi**2 - drag * linear.friction - linear.c1 * slip
        r2 = linear.f * jnp.cos(psi) * sine - jnp.sin(psi) + rho * big_c * dphi**2 + linear.c2 * slip
        coupling = p.mu * rho * p.lam * big_s
        determinant = linear.m11 * linear.m22 - coupling * rho * big_s
        ddphi = (linear.m22 * r1 + coupling * r2) / determinant
        ddpsi = (linear.m11 * r2 + rho * big_s * r1) / determinant
        return jnp.stack([dphi, dpsi, ddphi, ddpsi])

    @property
    def beyond_return(self) -> Number:
        """Tilt (rad) from which the block does not return: a right angle, or of the linear equations ten
        times the tilt at which weight, friction and forcing balance."""
        if self.terms is Terms.nonlinear:
            return 0.5 * jnp.pi
        # Beyond the balance (25) grows like exp(tau), so a factor of ten costs little time, and it leaves
        # room for the pull of the bob.
        linear = self.linear
        return 10.0 * (linear.weight + linear.friction + linear.f * linear.tilt) / linear.tilt


def smoothed_rates(
    p: Parameters, tilt_width: Number, rate_width: Number, terms: Terms = Terms.linear
) -> Callable[[Number, State, None], State]:
    """Return the vector field with sgn(x) smoothed to tanh(x/width), for an ODE solver.

    An impact at zero tilt multiplies phi' by r and adds d phi' to psi' (`tpd.scene.impacts`). That is the
    flow of the constant field (phi', psi')' = ln(r) (phi', d/(r - 1) phi') over a unit of time. With half of
    what tanh(phi/w) runs through in a crossing, -1 to 1, for that time,

        loss = ln(r) phi' |phi'| (1 - tanh(phi/w)^2) / (2 w)

    goes on phi'', and d/(r - 1) loss on psi'': the smoothed counterpart of an impact, exact for w -> 0, where
    nothing is lost without a crossing. With (4) the law of impacts depends on psi: this form does not hold.
    """
    equations = Linear(p) if terms is Terms.linear else Equations(p, terms)
    law = p.velocity_ratio, p.nu, p.mu, p.lam, p.inertia_ratio
    ratio = linear_ratio(*law)
    # Without loss the limit of ln(r)/(r - 1), with its slope.
    lost = jnp.where(ratio == 1.0, 1.0, 1.0 - ratio)
    share = jnp.where(ratio == 1.0, 1.5 - 0.5 * ratio, -jnp.log1p(-lost) / lost) / (2.0 * tilt_width)
    decay = share * jnp.stack([ratio - 1.0, linear_bob_change(ratio, *law)])
    if terms is Terms.nonlinear:
        # The law of impacts of (4) is another one: `Smoothed.check` refuses them, but for a traced ratio.
        decay = jnp.where(p.velocity_ratio == 1.0, jnp.zeros(2), jnp.nan)

    # A pytree of its coefficients: their derivatives are those of the field.
    return Partial(_smoothed_rates, equations, p, decay, tilt_width, rate_width)


def _smoothed_rates(
    of: Linear | Equations,
    p: Parameters,
    decay: Number,
    tilt_width: Number,
    rate_width: Number,
    tau: Number,
    y: State,
    args: None,
) -> State:
    del args
    step, drag = jnp.tanh(y[0] / tilt_width), jnp.tanh(y[2] / rate_width)
    # The loss is an impulse: it does not pass through the mass matrix, which has acted already.
    loss = decay * (y[2] * jnp.abs(y[2]) * (1.0 - step**2))
    return of.rates(y, step, drag, jnp.sin(p.xi * tau)) + jnp.concatenate([jnp.zeros_like(loss), loss])
