"""Equations of motion of block and pendulum: (25) of the paper with its misprints corrected, and (4).

Let s be the sign of the tilt phi, sigma the sign of its rate, and let primes denote d/dtau:

    [1 + mu rho (kappa^2 + nu^2)] phi'' - kappa mu rho lam psi'' - (1 + kappa mu) phi
        + mu lam c_p (phi' - psi') = -s (1 + mu) nu - sigma k - f (1 + kappa mu) sin(xi tau)
    -kappa rho phi'' + lam rho psi'' + psi + c_p (psi' - phi') = f sin(xi tau)

`Linear` holds these coefficients, and every solver of (25) uses it. `Equations` is the vector field of (25),
with or without its parametric term, or of (4). For small angles (4) reduces to (25). With
S = s nu sin(phi - psi) + kappa cos(phi - psi) and C = s nu cos(phi - psi) - kappa sin(phi - psi), (4) reads

    [1 + mu rho (kappa^2 + nu^2)] phi'' - mu rho lam S psi'' + mu rho lam C psi'^2
        + f [s (1 + mu) nu sin phi + (1 + kappa mu) cos phi] sin(xi tau) + s (1 + mu) nu cos phi
        - (1 + kappa mu) sin phi + sigma k + mu lam c_p (phi' - psi') = 0
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
    """Coefficients of the linear equations (25) in the form M q'' + C q' + K q = moments, q = (phi, psi)."""

    m11: Number
    """Mass matrix, row 1 (block), column 1 (tilt)."""
    m12: Number
    """Mass matrix, row 1, column 2 (bob angle)."""
    m21: Number
    """Mass matrix, row 2 (pendulum), column 1."""
    m22: Number
    """Mass matrix, row 2, column 2."""
    determinant: Number
    """Determinant of the mass matrix."""
    c1: Number
    """Factor of phi' - psi' in row 1, from the damper of the hinge."""
    c2: Number
    """Factor of psi' - phi' in row 2."""
    tilt: Number
    """1 + kappa mu: factor of phi and of the forcing in row 1."""
    weight: Number
    """(1 + mu) nu: moment of the weight about the corner."""
    friction: Number
    """k: moment of the dry friction of rocking."""
    f: Number
    """Amplitude of the base acceleration over gravity."""
    bias: Number
    """Factor of psi' in the moment on a block at rest, see `tpd.theory.holding_moment`."""

    def __init__(self, p: Parameters) -> None:
        rho, c = p.inertia_ratio, p.hinge
        self.m11 = 1.0 + p.mu * rho * (p.kappa**2 + p.nu**2)
        self.m12 = -p.kappa * p.mu * rho * p.lam
        self.m21 = -p.kappa * rho
        self.m22 = p.lam * rho
        # This form of m11 m22 - m12 m21 does not subtract nearly equal numbers if mu is large or nu small.
        self.determinant = self.m22 * (1.0 + p.mu * rho * p.nu**2)
        self.c1 = p.mu * p.lam * c
        self.c2 = c
        self.tilt = 1.0 + p.kappa * p.mu
        self.weight = (1.0 + p.mu) * p.nu
        self.friction = p.k
        self.f = p.f
        # This moment is needed where the block is at rest, see `tpd.theory.holding_moment`.
        self.bias = p.mu * c * (p.lam - p.kappa)

    def rates(self, y: State, step: Number, drag: Number, sine: Number) -> State:
        """Return the derivative d/dtau of the state (phi, psi, phi', psi').

        `step` is the value of sgn(phi), `drag` that of sgn(phi'), and `sine` that of sin(xi tau). Each may be
        smoothed, zero (the free system), or a constant sign.
        """
        phi, psi, dphi, dpsi = y
        slip = dphi - dpsi
        # The moments of both rows without the inertia terms. The inverse of the 2 by 2 mass matrix then gives
        # the accelerations.
        r1 = -step * self.weight - drag * self.friction - self.f * self.tilt * sine
        r1 = r1 + self.tilt * phi - self.c1 * slip
        r2 = self.f * sine - psi + self.c2 * slip
        ddphi = (self.m22 * r1 - self.m12 * r2) / self.determinant
        ddpsi = (self.m11 * r2 - self.m21 * r1) / self.determinant
        return jnp.stack([dphi, dpsi, ddphi, ddpsi])


class Terms(enum.StrEnum):
    """Terms of the equations of motion (4) that a model keeps.

    The members are `linear`, which is (25) without its parametric term; `parametric`, which is (25) with it;
    and `nonlinear`, which is (4). A member can be given by its name.

    Example:
        >>> import tpd
        >>> tpd.Terms("nonlinear") is tpd.Terms.nonlinear
        True
        >>> tpd.Smoothed(terms=tpd.Terms.parametric).terms.value
        'parametric'
    """

    linear = "linear"
    """(25) without its parametric term. These equations have an exact solution between events."""
    parametric = "parametric"
    """(25) with the term s f (1 + mu) nu phi sin(xi tau) on the left, which is of second order in the
    angles."""
    nonlinear = "nonlinear"
    """(4) with all its terms."""

    @classmethod
    def _missing_(cls, value: object) -> None:
        """Raise `ValueError` for a word that names no member."""
        checks.one_of("terms", value, tuple(cls))


class Equations(eqx.Module):
    """Vector field of (25) or (4), for models that integrate the equations numerically."""

    linear: Linear
    """Coefficients of (25), which (4) contains as well."""
    p: Parameters
    """Dimensionless parameters."""
    rho: Number
    """Inertia ratio."""
    terms: Terms = eqx.field(static=True)
    """Terms of the equations."""

    def __init__(self, p: Parameters, terms: Terms) -> None:
        self.linear, self.p, self.rho, self.terms = Linear(p), p, p.inertia_ratio, terms

    def rates(self, y: State, step: Number, drag: Number, sine: Number) -> State:
        """Return the derivative d/dtau of the state. The arguments are those of `Linear.rates`."""
        phi, psi, dphi, dpsi = y
        p, linear, rho, slip = self.p, self.linear, self.rho, dphi - dpsi
        if self.terms is not Terms.nonlinear:
            rates = linear.rates(y, step, drag, sine)
            if self.terms is Terms.linear:
                return rates
            # The parametric term is an additional moment on the block. The mass matrix couples both angles,
            # so this moment accelerates both.
            moment = -step * linear.f * linear.weight * phi * sine
            by_moment = jnp.stack([linear.m22, -linear.m21]) / linear.determinant
            return rates + jnp.concatenate([jnp.zeros(2), by_moment * moment])
        sin, cos, sin_apart, cos_apart = jnp.sin(phi), jnp.cos(phi), jnp.sin(phi - psi), jnp.cos(phi - psi)
        side, high = step * p.nu, p.kappa
        big_s, big_c = side * sin_apart + high * cos_apart, side * cos_apart - high * sin_apart
        # Moments on the block: weight and excitation, centripetal force of the bob, friction and hinge.
        r1 = linear.tilt * sin - step * linear.weight * cos
        r1 = r1 - linear.f * sine * (step * linear.weight * sin + linear.tilt * cos)
        r1 = r1 - p.mu * rho * p.lam * big_c * dpsi**2 - drag * linear.friction - linear.c1 * slip
        r2 = linear.f * jnp.cos(psi) * sine - jnp.sin(psi) + rho * big_c * dphi**2 + linear.c2 * slip
        coupling = p.mu * rho * p.lam * big_s
        # The mass matrix of (4) depends on the angles through S. Its inverse gives the accelerations.
        determinant = linear.m11 * linear.m22 - coupling * rho * big_s
        ddphi = (linear.m22 * r1 + coupling * r2) / determinant
        ddpsi = (linear.m11 * r2 + rho * big_s * r1) / determinant
        return jnp.stack([dphi, dpsi, ddphi, ddpsi])

    @property
    def beyond_return(self) -> Number:
        """Tilt (rad) from which the block does not return.

        With (4) it is a right angle. With the linear model it is ten times the tilt at which weight,
        friction and forcing are in balance.
        """
        if self.terms is Terms.nonlinear:
            return 0.5 * jnp.pi
        # Beyond the balance a solution of (25) grows like exp(tau), so a factor of ten costs little
        # time. The factor allows for the moment that the bob exerts on the block.
        linear = self.linear
        return 10.0 * (linear.weight + linear.friction + linear.f * linear.tilt) / linear.tilt


def smoothed_rates(
    p: Parameters, tilt_width: Number, rate_width: Number, terms: Terms = Terms.linear
) -> Callable[[Number, State, None], State]:
    """Return the vector field with sgn(x) smoothed to tanh(x/width), for an ODE solver.

    An impact at zero tilt multiplies phi' by r and adds d phi' to psi' (see `tpd.scene.impacts`). The flow of
    the constant field (phi', psi')' = ln(r) (phi', d/(r - 1) phi') over a unit of time has the same effect.
    During a crossing tanh(phi/w) increases from -1 to 1, or decreases from 1 to -1. Half of this change takes
    the place of the unit of time, so that

        loss = ln(r) phi' |phi'| (1 - tanh(phi/w)^2) / (2 w)

    is added to phi'', and d/(r - 1) loss to psi''. For w -> 0 this is exactly the law of impacts, and without
    a crossing nothing is lost. The form is not valid for (4), where the law of impacts depends on psi.

    Args:
        p: dimensionless parameters.
        tilt_width: smoothing width of the tilt, rad.
        rate_width: smoothing width of the rate of the tilt, rad per unit tau.
        terms: terms of the equations.
    """
    equations = Linear(p) if terms is Terms.linear else Equations(p, terms)
    law = p.velocity_ratio, p.nu, p.mu, p.lam, p.inertia_ratio, p.kappa
    ratio = linear_ratio(*law)
    # For r = 1 the quotient ln(r)/(r - 1) is replaced by its limit, in a form with the correct derivative.
    loss = jnp.where(ratio == 1.0, 1.0, 1.0 - ratio)
    share = jnp.where(ratio == 1.0, 1.5 - 0.5 * ratio, -jnp.log1p(-loss) / loss) / (2.0 * tilt_width)
    decay = share * jnp.stack([ratio - 1.0, linear_bob_change(ratio, *law)])
    if terms is Terms.nonlinear:
        # (4) has another law of impacts, so e must be 1. `Smoothed.check` cannot reject a traced e; then
        # all rates are NaN.
        decay = jnp.where(p.velocity_ratio == 1.0, jnp.zeros(2), jnp.nan)

    # `Partial` makes the field a pytree of its coefficients, so that JAX can differentiate with respect to
    # them.
    return Partial(_smoothed_rates, equations, p, decay, tilt_width, rate_width)


def _smoothed_rates(
    field: Linear | Equations,
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
    # The loss is an impulse on the rates. It is added after the mass matrix has been inverted.
    loss = decay * (y[2] * jnp.abs(y[2]) * (1.0 - step**2))
    return field.rates(y, step, drag, jnp.sin(p.xi * tau)) + jnp.concatenate([jnp.zeros_like(loss), loss])
