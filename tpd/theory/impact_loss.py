"""Equivalent friction: the dry friction k that loses as much energy per cycle as the impacts of ratio e."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpd.core import checks
from tpd.scene.impacts import linear_ratio
from tpd.scene.parameters import Number, Parameters, check_parameters
from tpd.theory.equations import Linear


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
    checks.require_x64()
    check_parameters(p)
    checks.not_negative("amplitude", amplitude)
    linear = Linear(p)
    twice, tilt = 2.0 * linear.weight, linear.tilt
    # Beyond this the weight would have done negative work, and k would be negative.
    if all(map(checks.is_concrete, (amplitude, twice, tilt))):
        _check_range(amplitude, np.asarray(twice) / np.asarray(tilt))
    lost = 1.0 - linear_ratio(p.velocity_ratio, p.nu, p.mu, p.lam, p.inertia_ratio) ** 2
    return lost * (twice - tilt * checks.namespace(amplitude).asarray(amplitude)) / 4.0


def _check_range(amplitude: Any, most: Any) -> None:
    phi, most = np.broadcast_arrays(amplitude, most)
    if np.any(phi > most):
        i = np.unravel_index(np.argmax(phi - most), phi.shape)
        raise ValueError(
            f"`amplitude` must be at most {most[i]:g}, twice the tilt at which the block topples of itself, "
            f"but is {phi[i]:g}"
        )


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
