"""Free rocking of the undamped system in closed form: the paper's (11), extended to a pendulum.

A free motion that is symmetric (its own mirror image half a period later) and turns at tau = 0 is even in
tau, so phi and psi both vanish a quarter of a period later. Between the two moments the block stands on one
corner and (25) is linear: a static part and two modes cosh(s_j tau), det(M s_j^2 + K) = 0, of which one s_j^2
is positive (the block falling) and one negative (the bob swinging, cosh becomes cos). With the static tilt
split into its modes,

    phi(tau) = sum_j w_j [1 - cosh(s_j tau) / cosh(s_j T/4)],   T/4 = pi / (2 Omega_0)

and psi alike. Of the bare block w = nu, s = 1: phi(0) = nu [1 - 1/cosh(pi/(2 Omega_0))], the paper's (11).

Losses: the dry friction that takes as much energy from a cycle as impacts of ratio e, and the decay of a free
bare block with both.
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
"""Times in the quarter period at which the sign of the tilt is checked."""


class Free(NamedTuple):
    """A free symmetric motion of a given frequency; angles in rad."""

    amplitude: Float[Array, "*batch"]
    """Tilt of the block at the turn, tau = 0."""
    bob: Float[Array, "*batch"]
    """Angle of the bob at the turn: positive to the side that the block leans to."""
    exists: Bool[Array, "*batch"]
    """True if the block stays on its corner, below the turn, for the whole quarter period (checked at 128
    times). Otherwise the two angles solve the equations but belong to no motion."""


class _Modes(NamedTuple):
    """Rates of the falling and of the swinging mode, and their shares w_j in the static angles."""

    falling: Number
    swinging: Number
    tilts: tuple[Number, Number]
    bobs: tuple[Number, Number]


def _modes(p: Parameters) -> _Modes:
    """Modes from a4 x^2 + a2 x + a0 = det(M x + K), x = s^2, by partial fractions."""
    linear = Linear(p)
    a4, a2, a0 = linear.determinant, linear.m11 - linear.tilt * linear.m22, -linear.tilt
    # The usual formula for one of the two roots subtracts nearly equal numbers; the product of the roots,
    # a0/a4, gives that one from the other.
    size = 0.5 * (jnp.abs(a2) + jnp.sqrt(a2**2 - 4.0 * a4 * a0))
    up = jnp.where(a2 > 0, -a0 / size, size / a4)
    down = -jnp.where(a2 > 0, size / a4, -a0 / size)
    apart = a4 * (up - down)

    def tilt(x: Number, sign: float) -> Number:
        return sign * linear.weight * (linear.m22 * x + 1.0) / (apart * x)

    swing = -linear.m21 * linear.weight / apart
    return _Modes(jnp.sqrt(up), jnp.sqrt(-down), (tilt(up, 1.0), tilt(down, -1.0)), (swing, -swing))


def free_motion(p: Parameters) -> Free:
    """The free symmetric rocking of frequency `p.xi` of the undamped linear system; fields may be arrays.

    k, zeta, f and e of `p` are not used: the motion is that at k = zeta = f = 0, e = 1. At mu = 0 it is (11),
    the bare block's, with a bob too light to act on it. The bob resonates, and there is no such motion, at
    every frequency of which an odd multiple is the frequency of the swinging mode.

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    check_parameters(p)
    modes = _modes(p)
    quarter = 0.5 * jnp.pi / p.xi
    shares = jnp.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
    falling, swinging, late = (jnp.asarray(x)[..., None] for x in (modes.falling, modes.swinging, quarter))
    fall = 1.0 - jnp.cosh(falling * late * shares) / jnp.cosh(falling * late)
    swing = 1.0 - jnp.cos(swinging * late * shares) / jnp.cos(swinging * late)
    # Shape (..., times): the last axis is time within the quarter period.
    phi, psi = (
        jnp.asarray(a)[..., None] * fall + jnp.asarray(b)[..., None] * swing
        for a, b in (modes.tilts, modes.bobs)
    )
    turn = phi[..., :1]
    # The paper supposes that the block stands on one corner from the turn to the crossing. A bob that swings
    # faster than the block rocks can lift it across earlier.
    exists = jnp.all((phi > 0) & (phi <= turn), axis=-1)
    return Free(turn[..., 0], psi[..., 0], exists)


def equivalent_friction(p: Parameters, amplitude: Any) -> Number:
    """Dry friction k that loses as much per cycle of amplitude Phi as impacts of ratio e.

    Friction takes 4 k Phi from a cycle, in which the tilt travels four times Phi. Each of the two impacts
    takes (1 - e^2) phi'^2/2, where phi'^2/2 is the work of the weight on the way down from Phi:
    w Phi - K Phi^2/2, with w = (1 + mu) nu and K = 1 + 2 mu. Both losses are equal for

        k = (1 - e^2)(2 w - K Phi)/4,   of the bare block (1 - e^2)(2 nu - Phi)/4.

    The formula assumes that all losses of a cycle are small against its energy: then the friction `p.k` and
    the impacts do not affect each other, k adds to `p.k`, and the block passes its base as fast as in free
    rocking. It assumes as well that a pendulum adds its weight and takes no energy on the way.

    So k serves for the settled motion, and not for the way to it: of 400 random scenes from rest 84 ended
    otherwise with k than with the impacts.

    Args:
        p: dimensionless parameters; fields may be arrays. f, xi, lam, zeta and k are not used.
        amplitude: Phi in rad, a number or an array, from 0 to 2 w/K: twice the tilt of static overturning.

    Returns:
        k, to be added to `p.k` with e = 1; differentiable in both arguments.

    Raises:
        ValueError: an amplitude out of range.
        RuntimeError: JAX is in 32-bit mode.
    """
    check_parameters(p)
    amplitude = checks.not_negative("amplitude", amplitude, every=True)
    linear = Linear(p)
    twice, tilt = 2.0 * linear.weight, linear.tilt
    # Beyond this the weight would have done negative work, and k would be negative.
    if all(map(checks.is_concrete, (amplitude, twice, tilt))):
        phi, most = np.broadcast_arrays(amplitude, np.asarray(twice) / np.asarray(tilt))
        i = np.unravel_index(np.argmax(phi - most), phi.shape)
        if phi[i] > most[i]:
            why = "twice the tilt at which the block topples of itself"
            raise ValueError(f"`amplitude` must be at most {most[i]:g}, {why}, but is {phi[i]:g}")
    lost = 1.0 - linear_ratio(p.velocity_ratio, p.nu, p.mu, p.lam, p.inertia_ratio) ** 2
    return lost * (twice - tilt * checks.namespace(amplitude).asarray(amplitude)) / 4.0


def turning_tilts(
    slenderness: float, friction: float, ratio: float, tilt: float, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Tilts at the turns of a free bare block, and the times from the release to them.

    From a turn at phi the weight less friction does the work G = (nu - k) phi - phi^2/2 on the way down, the
    impact leaves e^2 G, and the next turn has (nu + k) phi' - phi'^2/2 = e^2 G (linear equations). Between
    them the tilt is a hyperbolic cosine.

    Args:
        slenderness: nu.
        friction: k, less than nu.
        ratio: e, the velocity ratio of an impact.
        tilt: of the release, rad, between 0 and nu - k.
        count: of the turns after the release.

    Returns:
        Tilts (rad) and times (tau), shape (count + 1,), the release first.

    Raises:
        ValueError: a tilt out of range.
    """
    checks.within("tilt", tilt, 0.0, slenderness - friction)
    down, up = slenderness - friction, slenderness + friction
    turns, times = np.zeros(count + 1), np.zeros(count + 1)
    turns[0] = tilt
    for i in range(count):
        phi = turns[i]
        left = ratio**2 * max(down * phi - 0.5 * phi**2, 0.0)
        turns[i + 1] = up - np.sqrt(up**2 - 2.0 * left)
        falling, rising = np.arccosh(down / (down - phi)), np.arccosh(up / (up - turns[i + 1]))
        times[i + 1] = times[i] + falling + rising
    return turns, times
