"""Law of impacts: the rates of block and bob after an impact of the block on its base.

All models take the law from this module: the exact engine and its orbits, the smoothed and the nonlinear
models, in JAX and in compiled code (`tpd.compiled.plant.shared`). To change the law, edit `velocity_ratio`,
and `bob_change` if the bob reacts differently. Complex numbers carry derivatives.

All models assume that the changes of both rates are proportional to phi' before the impact. A ratio that
depends on the rates themselves would require other equations of the symmetric orbits
(`tpd.compiled.half_period_kernel`) and of the smoothed impact (`tpd.theory.equations`). The models also
assume that `e` = 1 loses no energy, and that a slow rattle ends.
"""

from __future__ import annotations

from typing import Any


def velocity_ratio(
    e: Any, nu: Any, mu: Any, lam: Any, rho: Any, kappa: Any, side: Any, sine: Any, cosine: Any
) -> Any:
    """Return the ratio r = phi' after/phi' before of an impact from the tilt of sign `side`.

    The rod exerts a force only along itself on block and bob, and the base pushes at the new corner. The
    angular momentum of both about the new corner therefore changes only by the loss of the block:

        r = [A + mu rho q q'] / (1 + mu rho q^2),    q = kappa sin(psi) - s nu cos(psi),
        A = e (1 + mu rho nu^2) + mu rho nu^2,       q' = kappa sin(psi) + s nu cos(psi).

    At psi = 0 this is e, the coefficient of the linear model. With Housner's e the constant is A = 1 - 2 rho
    nu^2, as without a pendulum, and the momentum is conserved. If e is larger than (1 - mu rho nu^2)/(1 + mu
    rho nu^2), A exceeds 1, and a bob at a large angle would give energy to the block. Therefore r is at most
    sqrt[(1 + mu rho q'^2)/(1 + mu rho q^2)], which conserves the energy. With e = 1 there is no jump.

    `sine` and `cosine` are those of psi, `side` is the sign s of the tilt before the impact, and `lam` is an
    argument for other laws.
    """
    share, high, wide = mu * rho, kappa * sine, side * nu * cosine
    before, after = high + wide, high - wide
    inertia = 1.0 + share * after**2
    # Compute r - e, which is proportional to sin(psi), to avoid cancellation.
    square, twice = kappa * kappa, 2.0 * kappa
    turned = e * ((nu**2 - square) * sine + twice * side * nu * cosine) + (square + nu**2) * sine
    ratio = e + share * sine * turned / inertia
    most = ((1.0 + share * before**2) / inertia) ** 0.5
    # For e above 1, which finite differences at 1 evaluate, the ratio is also e: with the bound the
    # differences would be half as large.
    return select(e.real >= 1.0, e, select(ratio.real > most.real, most, ratio))


def bob_change(ratio: Any, e: Any, nu: Any, lam: Any, kappa: Any, side: Any, sine: Any, cosine: Any) -> Any:
    """Return the change of psi' over phi' before, for an impact that multiplies phi' by r = `ratio`.

    The other arguments are those of `velocity_ratio`. The rod exerts a force only along itself, so the
    bob keeps its velocity across the rod. The hinge moves sideways at kappa phi', and upwards at s nu phi'
    before the impact and at -s nu phi' after it:

        lam (psi'_after - psi'_before) = kappa cos(psi) (r - 1) phi' + s nu sin(psi) (r + 1) phi'.

    The last term applies only to impacts with a loss. A crossing without loss changes neither rate.
    """
    upwards = select(e.real == 1.0, 0.0 * ratio, side * nu * sine * (ratio + 1.0))
    return (kappa * cosine * (ratio - 1.0) + upwards) / lam


def linear_ratio(e: Any, nu: Any, mu: Any, lam: Any, rho: Any, kappa: Any) -> Any:
    """Return `velocity_ratio` in the linear model, in which the bob hangs vertically below its hinge."""
    return velocity_ratio(e, nu, mu, lam, rho, kappa, 1.0, 0.0, 1.0)


def linear_bob_change(ratio: Any, e: Any, nu: Any, mu: Any, lam: Any, rho: Any, kappa: Any) -> Any:
    """Return `bob_change` in the linear model."""
    return bob_change(ratio, e, nu, lam, kappa, 1.0, 0.0, 1.0)


def select(condition: Any, of_true: Any, of_false: Any) -> Any:
    """Return one of two numbers, arrays or traced values."""
    # Compiled code replaces this function. The import is local so that compiled code does not import JAX.
    from tpd.core.checks import namespace

    return namespace(condition, of_true, of_false).where(condition, of_true, of_false)


def housner(nu: Any, rho: Any, mu: Any = 0.0) -> Any:
    """Return Housner's coefficient of restitution at psi = 0, [1 - rho nu^2 (2 + mu)]/(1 + mu rho nu^2).

    Arguments are numbers, arrays or traced values. Before the impact the block rotates about one corner, and
    after the impact about the other. The impact force acts at the new corner and has no moment about it, so
    the angular momentum of block and bob about this corner is conserved. The height of the hinge does
    not matter.

    Per unit mass the angular momentum of the block is (c^2 + b^2 - a^2) phi' before and (c^2 + b^2 + a^2)
    phi' after the impact. The rod moves the bob only in its own direction: at psi = 0 the vertical velocity
    of the bob changes from s a phi' to -s a phi', with the sign s of the tilt before, and its moment arm
    about the corner is a. Without a bob e = 1 - 2 rho nu^2. For a uniform rectangle this is 1 - 1.5
    sin(alpha)^2 with tan(alpha) = nu (G. W. Housner, The behavior of inverted pendulum structures during
    earthquakes, Bull. Seismol. Soc. Am. 53, 1963).
    """
    share = rho * nu**2
    return (1.0 - (2.0 + mu) * share) / (1.0 + mu * share)


def heaviest_of_housner(nu: Any, rho: Any) -> Any:
    """Return the mu for which Housner's ratio is zero. A heavier bob would throw the block back at an
    impact."""
    return 1.0 / (rho * nu**2) - 2.0
