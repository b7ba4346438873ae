"""Free rocking without damping in closed form: (11) of the paper, extended to a pendulum.

A symmetric free motion is its own mirror image half a period later. If it turns at tau = 0, it is even in
tau, so phi and psi both vanish a quarter of a period later. In between the block stands on one corner
and (25) is linear: the solution is a static part and two modes cosh(s_j tau) with det(M s_j^2 + K) = 0. One
s_j^2 is positive (the block tilts further) and one is negative (the bob swings, and cosh becomes cos). The
static tilt is divided into parts w_j of the two modes, so that

    phi(tau) = sum_j w_j [1 - cosh(s_j tau) / cosh(s_j T/4)],   T/4 = pi / (2 Omega_0)

and psi has the same form. Without a pendulum w = nu and s = 1, and phi(0) = nu [1 - 1/cosh(pi/(2 Omega_0))]
is (11) of the paper.

The module also has two results on losses: the dry friction that dissipates as much energy per cycle as
impacts with the coefficient of restitution e, and the decay of free rocking with both losses.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from tpd.core import checks
from tpd.scene.impacts import linear_ratio
from tpd.scene.parameters import Parameters, check_parameters
from tpd.scene.pytrees import Number
from tpd.theory.equations import Linear

_SAMPLES = 128
"""Number of times in the quarter period at which the sign of the tilt is checked."""


class Free(NamedTuple):
    """Symmetric free motion of a given frequency. Angles are in rad."""

    amplitude: Float[Array, "*batch"]
    """Tilt of the block at the turn, tau = 0."""
    bob: Float[Array, "*batch"]
    """Angle of the bob at the turn, positive towards the side to which the block tilts."""
    exists: Bool[Array, "*batch"]
    """Whether the tilt stays between zero and its value at the turn during the quarter period (checked at 128
    times). If not, the two angles solve the equations but belong to no motion."""


def _modes(p: Parameters) -> tuple[Number, Number, tuple[Number, Number], tuple[Number, Number]]:
    """Return the rate s of the mode in which the block tilts further, the frequency of the mode in which the
    bob swings, and the parts w_j of both in the static angles of block and bob.

    They follow from a4 x^2 + a2 x + a0 = det(M x + K) with x = s^2, by partial fractions.
    """
    linear = Linear(p)
    a4, a2, a0 = linear.determinant, linear.m11 - linear.tilt * linear.m22, -linear.tilt
    # The usual formula subtracts nearly equal numbers for one of the two roots. This root follows from the
    # other one and the product of the roots, a0/a4.
    size = 0.5 * (jnp.abs(a2) + jnp.sqrt(a2**2 - 4.0 * a4 * a0))
    up = jnp.where(a2 > 0, -a0 / size, size / a4)
    down = -jnp.where(a2 > 0, size / a4, -a0 / size)
    apart = a4 * (up - down)

    def tilt(x: Number, sign: float) -> Number:
        return sign * linear.weight * (linear.m22 * x + 1.0) / (apart * x)

    # The parts of the bob angle are equal and opposite, because its static angle is zero.
    swing = -linear.m21 * linear.weight / apart
    return jnp.sqrt(up), jnp.sqrt(-down), (tilt(up, 1.0), tilt(down, -1.0)), (swing, -swing)


def free_motion(p: Parameters) -> Free:
    """Return the symmetric free rocking of frequency `p.xi` of the undamped linear system.

    The function ignores k, zeta, f and e of `p`: the motion is that with k = zeta = f = 0 and e = 1. For
    mu = 0 it is (11), the motion of the block without a pendulum, together with the angle of a bob that is
    too light to act on the block. At every frequency of which an odd multiple is the frequency of the
    swinging mode the bob resonates, and no such motion exists.

    Args:
        p: dimensionless parameters. Fields may be arrays.

    Raises:
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.0, lam=0.5, zeta=0.0, k=0.0, f=0.0, xi=2.0)
        >>> round(float(tpd.theory.free_motion(p).amplitude), 4)
        0.049
    """
    check_parameters(p)
    falling, swinging, tilts, bobs = _modes(p)
    shares = jnp.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
    falling, swinging, late = (jnp.asarray(x)[..., None] for x in (falling, swinging, 0.5 * jnp.pi / p.xi))
    # Both modes vanish at the crossing and have no rate at the turn.
    fall = 1.0 - jnp.cosh(falling * late * shares) / jnp.cosh(falling * late)
    swing = 1.0 - jnp.cos(swinging * late * shares) / jnp.cos(swinging * late)
    # The last axis of the shape (..., times) is time within the quarter period.
    phi, psi = (
        jnp.asarray(a)[..., None] * fall + jnp.asarray(b)[..., None] * swing for a, b in (tilts, bobs)
    )
    turn = phi[..., :1]
    # The paper assumes that the block stands on one corner from the turn to the crossing. A bob that swings
    # faster than the block rocks can make the block cross earlier.
    exists = jnp.all((phi > 0) & (phi <= turn), axis=-1)
    return Free(turn[..., 0], psi[..., 0], exists)


def equivalent_friction(p: Parameters, amplitude: Any) -> Number:
    """Return the dry friction k that dissipates as much per cycle as impacts with the restitution e.

    Friction dissipates 4 k Phi per cycle of amplitude Phi, because the tilt travels four times Phi. Each of
    the two impacts dissipates (1 - e^2) phi'^2/2, where phi'^2/2 is the work of the weight on the way down
    from Phi: w Phi - K Phi^2/2 with w = (1 + mu) nu and K = 1 + kappa mu. The two losses are equal for

        k = (1 - e^2)(2 w - K Phi)/4,   without a pendulum (1 - e^2)(2 nu - Phi)/4.

    The formula assumes that all losses of a cycle are small compared with its energy. Friction `p.k` and
    impacts then do not affect each other, k is added to `p.k`, and the block passes its base as fast as in
    free rocking. The formula also assumes that a pendulum adds its weight and dissipates nothing.

    Use k for the settled motion and not for the transient: of 400 random scenes started from rest, 84 ended
    in another motion with k than with the impacts.

    Args:
        p: dimensionless parameters. Fields may be arrays. f, xi, lam, zeta and k are not used.
        amplitude: Phi in rad, a number or an array, from 0 to 2 w/K, which is twice the tilt of static
            overturning.

    Returns:
        k, to be added to `p.k` together with e = 1. It is differentiable in both arguments.

    Raises:
        ValueError: an amplitude out of range.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.0, lam=0.5, zeta=0.0, k=0.0, f=0.0, xi=2.0, e=0.9)
        >>> round(float(tpd.theory.equivalent_friction(p, 0.1)), 5)
        0.01425
    """
    check_parameters(p)
    amplitude = checks.not_negative("amplitude", amplitude, every=True)
    linear = Linear(p)
    twice, tilt = 2.0 * linear.weight, linear.tilt
    # Beyond this amplitude the weight would do negative work on the way down, and k would be negative.
    most = "twice the tilt at which the block topples of itself"
    checks.at_most("amplitude", amplitude, twice / tilt, most)
    loss = 1.0 - linear_ratio(p.velocity_ratio, p.nu, p.mu, p.lam, p.inertia_ratio, p.kappa) ** 2
    return loss * (twice - tilt * checks.namespace(amplitude).asarray(amplitude)) / 4.0


def turning_tilts(
    slenderness: float, friction: float, ratio: float, tilt: float, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the tilts at the turns of free rocking without a pendulum, and the times of the turns.

    From a turn at phi to the impact, the weight less the friction does the work G = (nu - k) phi - phi^2/2.
    After the impact the energy e^2 G remains, so the next turn is at phi' with
    (nu + k) phi' - phi'^2/2 = e^2 G (linear model). Between turn and impact the tilt is a hyperbolic
    cosine of time.

    Args:
        slenderness: nu.
        friction: k, less than nu.
        ratio: e, the coefficient of restitution of an impact.
        tilt: tilt at the release, rad, between 0 and nu - k.
        count: number of turns after the release.

    Returns:
        Tilts (rad) and times since the release (tau), each of shape (count + 1,). The release comes first.

    Raises:
        ValueError: a tilt out of range.

    Example:
        >>> import tpd
        >>> tilts, _ = tpd.theory.turning_tilts(slenderness=0.2, friction=0.0, ratio=0.9, tilt=0.1, count=2)
        >>> [round(float(x), 4) for x in tilts]
        [0.1, 0.0747, 0.0575]
    """
    checks.within("tilt", tilt, 0.0, slenderness - friction)
    down, up = slenderness - friction, slenderness + friction
    turns, times = np.zeros(count + 1), np.zeros(count + 1)
    turns[0] = tilt
    for i in range(count):
        phi = turns[i]
        # The energy after the impact. Rounding must not make it negative.
        energy = ratio**2 * max(down * phi - 0.5 * phi**2, 0.0)
        turns[i + 1] = up - np.sqrt(up**2 - 2.0 * energy)
        # Times from the turn to the impact, and from the impact to the next turn.
        falling, rising = np.arccosh(down / (down - phi)), np.arccosh(up / (up - turns[i + 1]))
        times[i + 1] = times[i] + falling + rising
    return turns, times
