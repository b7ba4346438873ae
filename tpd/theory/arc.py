"""Motion of the linear equations (25) between two events, in closed form: (16) to (18) with a pendulum.

Between two events the signs s of the tilt and sigma of its rate are constant. (25) then is a linear equation
M q'' + C q' + K q = m + Im(n exp(i xi tau)) for q = (phi, psi), whose motion is the sum of three parts:

    q(tau) = K^-1 m + Im(Z exp(i xi tau)) + free motion,   (K + i xi C - xi^2 M) Z = n
    y(tau) - y_p(tau) = exp(A (tau - tau0)) (y(tau0) - y_p(tau0)),   A = [0 1; -M^-1 K  -M^-1 C]

y = (q, q') is the state, and y_p is the state of the first two parts, static and forced. The eigenvalues of A
are the modes of (25): a pair in which the block tilts further or returns, and a pair in which the bob swings.
The models solve the same equations with a general method for all events. The tests compare both.
"""

from __future__ import annotations

import jax.numpy as jnp
from jax.scipy.linalg import expm

from tpd.core import checks
from tpd.scene.impacts import linear_bob_change, linear_ratio
from tpd.scene.parameters import Parameters, check_parameters
from tpd.scene.pytrees import Number, State
from tpd.theory.equations import Linear


def arc(p: Parameters, y0: checks.Vector, tau0: Number, tau: Number, *, side: int, direction: int) -> State:
    """Return the state at `tau` of a motion of (25) without an event after `tau0`.

    A held block (`direction` 0) keeps its tilt, and its bob is an oscillator: lam rho psi'' + c_p psi' + psi
    = f sin(xi tau). `impact` and `holding_moment` are the rules at the events between two such motions.

    Args:
        p: dimensionless parameters.
        y0: state (phi, psi, phi', psi') at `tau0`, in rad and rad per unit tau.
        tau0, tau: dimensionless times. `jax.vmap` takes many of them.
        side: sign s of phi, 1 or -1: the corner about which the block rotates.
        direction: sign sigma of phi', 1 or -1; 0 for a block that is held.

    Returns:
        State (phi, psi, phi', psi'), shape (4,), with all derivatives of JAX. It is not finite if an undamped
        bob is excited at its natural frequency.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        Follow a block until its third impact, and compare its state with `tpd.simulate`.

        >>> import jax, numpy as np, scipy.optimize, tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.02, f=0.1, xi=3.0, e=0.9)
        >>> y, tau, side, direction, impacts = np.array([0.1, 0.0, 0.0, 0.0]), 0.0, 1, -1, []
        >>> while len(impacts) < 3:
        ...     at = lambda t: tpd.theory.arc(p, y, tau, t, side=side, direction=direction)
        ...     event = 0 if side * direction < 0 else 2  # an impact, or a turning point
        ...     times = tau + np.linspace(0.01, 5.0, 200)
        ...     sign = np.sign(jax.vmap(at)(times)[:, event])
        ...     i = np.flatnonzero(sign != sign[0])[0]
        ...     end = scipy.optimize.brentq(lambda t: at(t)[event], times[i - 1], times[i], xtol=1e-15)
        ...     y, tau = at(end), end
        ...     if event == 0:
        ...         y, side = tpd.theory.impact(p, y), -side
        ...         impacts.append(tau)
        ...     else:
        ...         direction = -direction
        >>> [round(t, 4) for t in impacts]
        [1.1312, 2.4811, 3.1014]
        >>> exact = tpd.simulate(p, [0.1, 0.0, 0.0, 0.0], [0.0, tau + 0.1]).ys[-1]
        >>> bool(np.abs(at(tau + 0.1) - exact).max() < 1e-12)
        True
    """
    check_parameters(p)
    for name, value, allowed in (("side", side, (-1, 1)), ("direction", direction, (-1, 0, 1))):
        if value not in allowed:
            expected = " or ".join(map(str, allowed))
            raise ValueError(f"`{name}` must be {expected}, but is {checks.quote(value)}")
    linear, y0 = Linear(p), jnp.asarray(checks.state(y0))
    mass = jnp.array([[linear.m11, linear.m12], [linear.m21, linear.m22]])
    damping = jnp.array([[linear.c1, -linear.c1], [-linear.c2, linear.c2]])
    stiffness = jnp.array([[-linear.tilt, 0.0], [0.0, 1.0]])
    static = jnp.array([-side * linear.weight - direction * linear.friction, 0.0])
    forced = jnp.array([-linear.tilt, 1.0]) * linear.f
    if direction == 0:
        # Row 1 becomes phi'' + phi = phi(tau0): with phi' = 0 the block keeps its tilt.
        mass, damping = mass.at[0].set(jnp.array([1.0, 0.0])), damping.at[0].set(0.0)
        stiffness = jnp.eye(2)
        static, forced = jnp.array([y0[0], 0.0]), forced.at[0].set(0.0)
    # The two parts of the motion that do not depend on the initial state.
    rest = jnp.linalg.solve(stiffness, static)
    z = jnp.linalg.solve(stiffness + 1j * p.xi * damping - p.xi**2 * mass, forced + 0j)

    def particular(time: Number) -> State:
        turned = z * jnp.exp(1j * p.xi * time)
        return jnp.concatenate([rest + turned.imag, (1j * p.xi * turned).imag])

    # The state of the free motion, in which the initial state enters, changes with these rates.
    pull = -jnp.linalg.solve(mass, jnp.hstack([stiffness, damping]))
    rates = jnp.vstack([jnp.eye(2, 4, 2), pull])
    return particular(tau) + expm(rates * (tau - tau0)) @ (y0 - particular(tau0))


def impact(p: Parameters, y0: checks.Vector) -> State:
    """Return the state after an impact of the linear model at phi = 0.

    The tilt then changes its sign, and phi' becomes e phi'. The rod transmits no transverse force, hence
    psi' becomes psi' + (kappa/lam) (e - 1) phi'. See `tpd.scene.impacts`.

    Args:
        p: dimensionless parameters.
        y0: state (phi, psi, phi', psi') before the impact, in rad and rad per unit tau.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0, e=0.9)
        >>> [round(float(x), 6) for x in tpd.theory.impact(p, [0.0, 0.1, -0.2, 0.3])]
        [0.0, 0.1, -0.18, 0.35]
    """
    check_parameters(p)
    phi, psi, dphi, dpsi = checks.state(y0)
    law = p.velocity_ratio, p.nu, p.mu, p.lam, p.inertia_ratio, p.kappa
    # The bob hangs below its hinge in the linear model, and the ratio is then e.
    ratio = linear_ratio(*law)
    return jnp.stack([phi, psi, ratio * dphi, dpsi + linear_bob_change(ratio, *law) * dphi])


def holding_moment(p: Parameters, y0: checks.Vector, tau: Number) -> Number:
    """Return the moment R on a block with phi' = 0 that friction and weight must balance to hold it.

    R = (1 + kappa mu) phi - f sin(xi tau) - kappa mu psi + mu c_p (lam - kappa) psi', divided by M g b. A
    block on its base (phi = 0) is held while |R| <= (1 + mu) nu + k, and a tilted block while |R - s (1 + mu)
    nu| <= k. It leaves in the direction of the excess.

    Args:
        p: dimensionless parameters.
        y0: state (phi, psi, 0, psi'), in rad and rad per unit tau.
        tau: dimensionless time.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0)
        >>> round(float(tpd.theory.holding_moment(p, [0.0, 0.0, 0.0, 0.0], 0.5)), 4)
        -0.2992
    """
    check_parameters(p)
    phi, psi, _, dpsi = checks.state(y0)
    linear = Linear(p)
    bob = linear.bias * dpsi - (linear.tilt - 1.0) * psi
    return linear.tilt * phi + bob - linear.f * jnp.sin(p.xi * tau)
