"""Free rocking of the undamped system in closed form: the paper's (11), extended to a pendulum.

A free motion that is symmetric (its own mirror image half a period later) and turns at tau = 0 is even in
tau, so phi and psi both vanish a quarter of a period later. Between the two moments the block stands on one
corner and (25) is linear: a static part and two modes cosh(s_j tau), det(M s_j^2 + K) = 0, of which one s_j^2
is positive (the block falling) and one negative (the bob swinging, cosh becomes cos). With the static tilt
split into its modes,

    phi(tau) = sum_j w_j [1 - cosh(s_j tau) / cosh(s_j T/4)],   T/4 = pi / (2 Omega_0)

and psi alike. Of the bare block w = nu, s = 1: phi(0) = nu [1 - 1/cosh(pi/(2 Omega_0))], the paper's (11).
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from tpd.core import checks
from tpd.scene.parameters import Number, Parameters, check_parameters
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
    checks.require_x64()
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
