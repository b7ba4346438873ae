"""The law of impacts: the rates after the block comes down on its base, and nothing else decides them.

Everything that knows the law takes it from here, so that another law is an edit of `velocity_ratio`, and of
`bob_change` if the bob is to feel it otherwise: the exact engine and its orbits, the smoothed and the
nonlinear models, in JAX and in compiled code (`tpd.exact.plant.shared`). Complex numbers carry derivatives.
What they all suppose is that the changes of both rates are proportional to phi' before: a ratio that depends
on the rates themselves would need other equations of the symmetric orbits (`tpd.exact.half_period_kernel`)
and of the smoothed impact (`tpd.theory.equations`). That `e` = 1 loses nothing, and that a slow rattle ends,
is supposed as well.
"""

from __future__ import annotations

from typing import Any


def velocity_ratio(e: Any, nu: Any, mu: Any, lam: Any, rho: Any, side: Any, sine: Any, cosine: Any) -> Any:
    """Ratio r = phi' after/phi' before of an impact from the tilt of sign `side`.

    The rod pulls block and bob along itself, and the base pushes at the new corner. So the angular momentum
    of both about the new corner changes by the block's own loss alone:

        r = [A + mu rho q q'] / (1 + mu rho q^2),    q = 2 sin(psi) - s nu cos(psi),
        A = e (1 + mu rho nu^2) + mu rho nu^2,       q' = 2 sin(psi) + s nu cos(psi).

    At psi = 0 this is e, the ratio of the linear equations. Housner's e makes A = 1 - 2 rho nu^2, that of the
    bare block: then the momentum is conserved. An e nearer to 1 than (1 - mu rho nu^2)/(1 + mu rho nu^2)
    makes A > 1, with which a bob far out would give energy to the block: r is at most
    sqrt[(1 + mu rho q'^2)/(1 + mu rho q^2)], which conserves it. With e = 1 there is no jump at all.

    `sine` and `cosine` are those of psi, `side` is the sign s of the tilt before; `lam` is for other laws.
    """
    share, before, after = mu * rho, 2.0 * sine + side * nu * cosine, 2.0 * sine - side * nu * cosine
    inertia = 1.0 + share * after**2
    # r - e, in which nothing cancels: it vanishes with sin(psi).
    turned = e * ((nu**2 - 4.0) * sine + 4.0 * side * nu * cosine) + (4.0 + nu**2) * sine
    ratio = e + share * sine * turned / inertia
    most = ((1.0 + share * before**2) / inertia) ** 0.5
    # Beyond 1, where differences about it may ask, the ratio is e as well: a bound would halve them.
    return select(e.real >= 1.0, e, select(ratio.real > most.real, most, ratio))


def bob_change(
    ratio: Any, e: Any, nu: Any, mu: Any, lam: Any, rho: Any, side: Any, sine: Any, cosine: Any
) -> Any:
    """Change of psi', over phi' before, in an impact that multiplies phi' by r = `ratio`; other arguments as
    in `velocity_ratio`.

    The rod pulls along itself only, so the bob keeps its velocity across the rod. The hinge moves to the side
    at 2 phi', and upwards at s nu phi' before the impact and at -s nu phi' after it:

        lam (psi'_after - psi'_before) = 2 cos(psi) (r - 1) phi' + s nu sin(psi) (r + 1) phi'.

    The last term belongs to impacts with loss: a crossing without loss leaves both rates as they are.
    """
    upwards = select(e.real == 1.0, 0.0 * ratio, side * nu * sine * (ratio + 1.0))
    return (2.0 * cosine * (ratio - 1.0) + upwards) / lam


def linear_ratio(e: Any, nu: Any, mu: Any, lam: Any, rho: Any) -> Any:
    """`velocity_ratio` in the linear equations, for which the bob hangs below its hinge."""
    return velocity_ratio(e, nu, mu, lam, rho, 1.0, 0.0, 1.0)


def linear_bob_change(ratio: Any, e: Any, nu: Any, mu: Any, lam: Any, rho: Any) -> Any:
    """`bob_change` in the linear equations."""
    return bob_change(ratio, e, nu, mu, lam, rho, 1.0, 0.0, 1.0)


def select(condition: Any, of_true: Any, of_false: Any) -> Any:
    """One of two numbers, arrays or traced values."""
    # Compiled code has its own, and does not wait for JAX.
    from tpd.core.checks import namespace

    return namespace(condition, of_true, of_false).where(condition, of_true, of_false)


def housner(nu: Any, rho: Any, mu: Any = 0.0) -> Any:
    """Housner's velocity ratio e = [1 - rho nu^2 (2 + mu)]/(1 + mu rho nu^2) of an impact with the bob below
    its hinge (psi = 0); numbers, arrays or traced values.

    Before the impact the block turns about one corner, after it about the other. The impact acts at the new
    corner and has no moment about it, so the angular momentum of block and bob about it is conserved. Per
    unit mass that of the block is (c^2 + b^2 - a^2) phi' before, and (c^2 + b^2 + a^2) phi' after. The rod
    takes the bob along in its own direction only: at psi = 0 the bob's vertical velocity goes from s a phi'
    to -s a phi', with s the sign of the tilt before, and its moment about the corner is a times that.
    Without a bob e = 1 - 2 rho nu^2: for a uniform rectangle 1 - 1.5 sin(alpha)^2 with tan(alpha) = nu
    (G. W. Housner, The behavior of inverted pendulum structures during earthquakes, Bull. Seismol. Soc. Am.
    53, 1963).
    """
    share = rho * nu**2
    return (1.0 - (2.0 + mu) * share) / (1.0 + mu * share)


def heaviest_of_housner(nu: Any, rho: Any) -> Any:
    """mu with which Housner's ratio is zero: a heavier bob would throw the block back at an impact."""
    return 1.0 / (rho * nu**2) - 2.0
